// What BrickInfo says of every brick, as bytes of a file's head: docs/wavelet-format.md.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/byte_io.h"
#include "core/data/bricks.h"

namespace voxloom::wavelet {

struct TreeIndex;

// Values on 65536 levels from the smallest upwards; rounded outward.
struct RangeScale {
    double lo = 0, step = 1;
    std::uint16_t below(double v) const;
    std::uint16_t above(double v) const;
    double value(std::int64_t code) const { return lo + double(code) * step; }
};

struct BrickCodes {
    // Smallest value, largest less smallest, L2 error, largest error less L2 error; modulo 2^16.
    std::array<std::uint16_t, 4> number{};
    std::array<std::uint8_t, 8> share{};  // of the octants, of the L2 error
};

// Of an opened file, whose bricks are a seventh of a BrickInfo each.
struct CodedStatistics {
    RangeScale scale;
    double error_steps = 1, share_steps = 1;
    std::vector<std::vector<BrickCodes>> levels;  // x fastest

    BrickInfo info(int level, std::size_t brick) const;  // all but compressed_bytes
};

void write_statistics(const TreeIndex& index, ByteWriter& writer);
// `version` is the file's.
CodedStatistics read_statistics(const BricksDesc& desc, ByteReader& reader, std::uint32_t version);

}  // namespace voxloom::wavelet
