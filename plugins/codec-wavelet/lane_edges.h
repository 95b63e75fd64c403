// What the parent's samples foretell of its children's details.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "plugins/codec-wavelet/lane_layout.h"

namespace voxloom::wavelet {

// Where the parent has edges, in the places of the layout. A detail is what linear interpolation of the parent
// misses, so it grows with the parent's slope along its axis, less with its curvature there and its slopes along
// the others: 4 slope + curvature / 2 + other slopes, in units of four quantiser steps, at most 255.
class LaneEdges {
  public:
    void start(const Details& details);
    // For the band that is high along this axis alone.
    const std::uint8_t* find(const Details& details, const LaneLayout& layout, int axis);

  private:
    std::size_t row_ = 0, plane_ = 0;  // of slopes: rows end with a zero
    std::array<std::vector<std::uint32_t>, 3> slopes_;  // to the next sample along each axis, modulo 2^32
    std::vector<std::uint32_t> nothing_;
    std::vector<std::uint8_t> edges_;
};

}  // namespace voxloom::wavelet
