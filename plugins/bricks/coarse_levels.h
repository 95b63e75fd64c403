// Coarser levels over the bricks of any codec: flat codecs become pyramids.
#pragma once

#include "core/data/dense_pyramid.h"

namespace voxloom::bricks {

// Level 0 stays in the codec and is decoded when it is asked for, with the codec's own bricks; the coarser levels are in
// memory. They are made of what level 0 decodes to, which is read twice.
//
// Errors are against what the codec had: those of level 0 are the codec's, those of the others are measured against the
// decoded level 0 and joined with the codec's as if independent (L2), or at the worst (largest error), so that they
// are exact where the codec lost nothing.
BricksPtr with_coarse_levels(BricksPtr source, PyramidFilter filter, const std::stop_token& stop = {},
                             const std::function<void(double)>& progress = {});

// What its desc() will be, without a look at the voxels.
BricksDesc coarse_levels_desc(const BricksDesc& source, PyramidFilter filter);

}  // namespace voxloom::bricks
