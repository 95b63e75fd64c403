// The index of bricks that are coded each by itself, at one level: where each one's bytes are, and what is known of it.
#pragma once

#include <vector>

#include "core/base/byte_io.h"
#include "core/data/bricks.h"

namespace voxloom {

struct BrickPlace {
    std::uint64_t offset = 0, size = 0;  // in the payload
    std::uint32_t check = 0;
};

// Of each brick, x fastest.
struct BrickIndex {
    std::vector<BrickPlace> places;
    std::vector<BrickInfo> infos;
    std::uint64_t bytes() const { return places.size() * sizeof(BrickPlace) + infos.size() * sizeof(BrickInfo); }
};

// A brick of level 0 by its number, x fastest, and its number.
BrickId brick_at(const BricksDesc& desc, std::size_t number);
std::size_t number_of(const BricksDesc& desc, BrickId id);

// For each brick: varint size, u32 checksum, smallest and largest value (of the scalar type), f64 L2 and largest error. The
// bricks' bytes follow each other in the payload.
void write_brick_index(const BrickIndex& index, ScalarType type, ByteWriter& writer);
// Throws Error for an index that does not fit such bricks or such a payload.
BrickIndex read_brick_index(const BricksDesc& desc, std::uint64_t payload_bytes, ByteReader& reader);

}  // namespace voxloom
