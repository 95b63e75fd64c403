// A family of level 0: its bytes, and what the decoder will give, measured.
#pragma once

#include "plugins/codec-wavelet/brick_ranges.h"
#include "plugins/codec-wavelet/coarse_errors.h"

namespace voxloom::wavelet {

struct MeasuredBrick {
    BrickId id;
    BrickParts parts;
    double squares = 0, largest = 0;  // of the errors of finite, valid values
    std::uint64_t finite = 0;
};

struct EncodedFamily {
    Bytes bytes;
    std::uint32_t check = 0;
    std::uint64_t patches = 0;
    std::int64_t codec_ns = 0;     // CPU time of transform, quantiser and coder
    std::vector<MeasuredBrick> bricks;
    std::vector<ErrorSum> coarse;  // as CoarseErrors::measure() gives them
    // Goes before everything else.
    void add_mask(const Mask& mask, Index3 dims);
    // Lengths of empty streams say nothing that the absence of all bytes does not.
    void drop_if_empty();
};

// Are quantiser and map such that the tree's integers, or the voxels themselves, come back as they are?
bool keeps_integers(const TreeDesc& tree);
bool keeps_voxels(const TreeDesc& tree);

// `bound`: voxels that err by more are stored as they are. Without `coarse` the coarse levels are not measured.
EncodedFamily encode_fine(const FamilyCodec& codec, const TreeDesc& tree, FamilyId family, const VoxelView& original,
                          const FamilyCodec::Planes& low, double bound, const CoarseErrors* coarse);

}  // namespace voxloom::wavelet
