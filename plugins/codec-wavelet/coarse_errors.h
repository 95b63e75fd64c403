// Errors of the coarse levels against the original: their samples, interpolated linearly, at every voxel.
#pragma once

#include <memory>
#include <span>

#include "plugins/codec-wavelet/level_store.h"
#include "plugins/codec-wavelet/voxels.h"

namespace voxloom::wavelet {

struct ErrorSum {
    double squares = 0, largest = 0;
};

// The samples of all coarse levels that take part in a box of voxels.
class CoarseErrors {
  public:
    virtual ~CoarseErrors() = default;
    // Of every level from 1 on over one family of level 0, brick by brick: sums[brick * levels + level - 1],
    // bricks x fastest. Voxels that are not finite or not valid do not count. [any thread]
    virtual void measure(const VoxelView& original, FamilyId family, std::vector<ErrorSum>& sums) const = 0;
};

// `decoded` are the levels' integers ([0] is not looked at); `box` is of level 0.
std::unique_ptr<const CoarseErrors> coarse_errors(const TreeDesc& tree, std::span<const LevelStore> decoded, const Box& box,
                                                  const std::stop_token& stop);

}  // namespace voxloom::wavelet
