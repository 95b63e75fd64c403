// What one view draws of a Bricks, in drawing order.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/data/bricks.h"

namespace voxloom {

struct SelectedBrick {
    BrickId id;
    std::uint8_t octants = 0xff;            // octants drawn from this brick (bit = x | y<<1 | z<<2)
    std::array<float, 8> corner_blend{};    // 0: own samples, 1: the parent's, at each corner
    double predicted_error = 0;             // in the units of the policy that selected it
};

struct Selection {
    std::vector<SelectedBrick> bricks;      // back to front
    double predicted_error = 0;             // of the whole picture
};
using SelectionPtr = std::shared_ptr<const Selection>;

}  // namespace voxloom
