// The dense pyramid: the simplest Bricks, nothing compressed. Level 0 is the volume itself, read by
// region where it is not in memory; the coarser levels are in memory.
#pragma once

#include "core/data/bricks.h"

namespace voxloom {

enum class PyramidFilter {
    subsample,  // LaMar et al.: even samples as they are; aliases
    average,    // (1 2 1)/4 around the even sample
    lifting53,  // (-1 2 6 2 -1)/8, the lowpass of the 5/3 wavelet; overshoots at steps by up to a half
};

// Builds every level, and the exact error of every brick, in parallel; reads the volume twice.
//
// Filters work along one axis after the other, each level on the one below it, in double and rounded
// once; ties of integers go up and down by turns, so that levels neither brighten nor darken. At its ends the volume
// is continued by point reflection (x[-j] = 2 x[0] - x[j]), so that a linear ramp stays that ramp.
//
// What is not valid (NaN, infinities, masked voxels) never enters a filter: the remaining weights, of
// average around it, are renormalised, and a sample without any is not valid either (NaN; 0 and masked
// for integers). subsample keeps what it finds.
//
// The tree type is the volume's, but wider for integers under lifting53, whose overshoot is clamped
// only where values are delivered. The result does not depend on the number of threads.
BricksPtr make_dense_pyramid(VolumePtr volume, glm::ivec3 brick, PyramidFilter filter,
                             const std::stop_token& stop = {},
                             const std::function<void(double)>& progress = {});

// What its desc() will be, without a look at the voxels. Throws Error where `brick` is not possible.
BricksDesc dense_pyramid_desc(const VolumeDesc& volume, glm::ivec3 brick, PyramidFilter filter);

}  // namespace voxloom
