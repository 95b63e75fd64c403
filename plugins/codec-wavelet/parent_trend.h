// What the parent's samples foretell of the details between them: a detail is what linear interpolation of the
// parent misses, about -1/16 of the parent's second difference.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "plugins/codec-wavelet/family.h"

namespace voxloom::wavelet {

class ParentTrend {
  public:
    // Once a family, before its bands.
    void look_at(const Details& details);
    // Fills what stands below, for each of the parent's samples (shape.low(), x fastest), in eighths of the
    // band's step, rounded down and limited to 2^24 along each axis.
    void look_at(const Details& details, const Band& band);

    std::vector<std::int32_t> curve, slope;  // second and first difference, absolute, over the band's axes
    std::vector<std::int32_t> foretold;      // less the second difference, of the band's last axis: has its sign

  private:
    void differences(const Details& details, int axis);

    std::array<std::vector<std::int32_t>, 3> second_, first_;  // along each axis, between a sample and the next
    std::vector<std::int32_t> before_, after_;                 // rows beyond the ends
};

}  // namespace voxloom::wavelet
