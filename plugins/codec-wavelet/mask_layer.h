// Which voxels are valid, family by family: coded without loss, and the same for the coarser levels.
#pragma once

#include <span>

#include "plugins/codec-wavelet/coder.h"
#include "plugins/codec-wavelet/tree.h"

namespace voxloom::wavelet {

using Mask = std::vector<std::uint8_t>;  // 1 where a sample is valid, 0 where not

// Of `dims` samples, x fastest. Nothing is written where all are valid, one byte where none is.
void encode_mask(const Mask& mask, Index3 dims, Bytes& out);
// Throws Error on what no encoder writes.
Mask decode_mask(std::span<const std::byte> in, Index3 dims);

// The mask of a family's low band. A sample is valid where one of the finer samples is that it stands between
// (from 2n - 1 to 2n + 1): so no valid voxel depends on a sample that is not.
Mask low_mask(const Mask& mask, const Shape& shape);

}  // namespace voxloom::wavelet
