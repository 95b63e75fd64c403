// What the tree alone cannot give back at level 0: runs of exact values (NaN, infinities, voxels beyond a
// hard error bound), and for lossless floats and wide integers the distance of every voxel from the
// tree's value, counted in representable numbers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/base/types.h"
#include "plugins/codec-wavelet/coder.h"

namespace voxloom::wavelet {

// `needed` is 1 where a voxel must be stored exactly.
void encode_patches(ScalarType type, const std::byte* values, std::span<const std::uint8_t> needed, Bytes& out);
// Overwrites the values that were stored.
void decode_patches(ScalarType type, std::span<const std::byte> in, std::byte* values, std::size_t count);

// Of `count` voxels; `near` are those that the tree gives. Nothing is written where both agree everywhere.
void encode_distances(ScalarType type, const std::byte* exact, const std::byte* near, std::size_t count, Bytes& out);
// Turns near values into exact ones.
void decode_distances(ScalarType type, std::span<const std::byte> in, std::byte* values, std::size_t count);

}  // namespace voxloom::wavelet
