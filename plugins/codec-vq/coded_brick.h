// One brick and its bytes. Little-endian, T the volume's scalar type, n = ceil(x/4) ceil(y/4) ceil(z/4) blocks:
//     2 T      smallest and largest finite value of the original, 0 and 0 where nothing is finite
//     for each component: n T means; n u8 codewords of the octants; n u8 codewords of the voxels
//     for each component: varint count of blocks that are kept as they are, because something in them is not finite, or too wide;
//         for each: varint blocks since the last one (the first: since the beginning); 64 T
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/buffer.h"
#include "core/base/byte_io.h"
#include "plugins/codec-vq/nearest.h"
#include "plugins/codec-vq/training.h"

namespace voxloom::vq {

enum class Loop : std::uint8_t {
    open,    // both codebooks see the exact means above them, as published
    closed,  // each sees what the decoder will have, so that errors do not add
};

// What blocks of a component of a macroblock are made of.
struct Codebooks {
    Codebook octants, voxels;  // of 8 and of 64 components, in units
};
// Those that hold zero and nothing else.
Codebooks zero_codebooks();

struct BrickForm {
    Index3 dims{0};
    ScalarType type = ScalarType::u8;
    int components = 1;
    double unit = 1;

    std::size_t values() const { return std::size_t(Box::of(dims).voxels()) * std::size_t(components); }
};

struct BrickSearch {
    SearchTable octants, voxels;
};

struct CodedBrick {
    Bytes bytes;
    std::uint64_t constant_blocks = 0, raw_blocks = 0;
};

// `books` and `search` have one entry for each component.
CodedBrick code_brick(const BrickForm& form, Loop loop, std::span<const Codebooks> books,
                      std::span<const BrickSearch> search, std::span<const std::byte> voxels);

// Bytes of a brick without blocks that are kept as they are.
std::uint64_t plain_brick_bytes(const BrickForm& form);

// Throws Error, without the brick's name, for damaged bytes.
void decode_brick(const BrickForm& form, std::span<const Codebooks> books, std::span<const std::byte> bytes,
                  std::span<std::byte> voxels);

}  // namespace voxloom::vq
