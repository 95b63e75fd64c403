// The dense pyramid: the simplest Bricks, all levels in memory, nothing compressed.
#pragma once

#include "core/data/bricks.h"

namespace voxloom {

enum class PyramidFilter {
    subsample,  // LaMar et al.: even samples as they are; aliases
    average,    // (1 2 1)/4 around the even sample, computed on values, NaN left out
    lifting53,  // 5/3 lowpass: update step of the wavelet, kept unrounded for floats
};

// Builds every level and the exact error of every brick. NaN and masked voxels never enter a
// filter: remaining weights are renormalised, and a sample without any stays NaN (floats).
BricksPtr make_dense_pyramid(VolumePtr volume, glm::ivec3 brick, PyramidFilter filter,
                             const std::stop_token& stop = {},
                             const std::function<void(double)>& progress = {});

}  // namespace voxloom
