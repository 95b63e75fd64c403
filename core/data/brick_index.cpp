#include "core/data/brick_index.h"

#include <cassert>
#include <cmath>

#include "core/base/error.h"

namespace voxloom {

namespace {

void write_info(const BrickInfo& info, ScalarType type, ByteWriter& writer) {
    with_type(type, [&](auto t) {
        using T = decltype(t);
        writer.number(T(info.range.min));
        writer.number(T(info.range.max));
    });
    writer.number(info.l2);
    writer.number(info.max_error);
}

BrickInfo read_info(ScalarType type, std::uint64_t bytes, ByteReader& reader) {
    BrickInfo info;
    with_type(type, [&](auto t) {
        info.range.min = double(reader.number<decltype(t)>());
        info.range.max = double(reader.number<decltype(t)>());
    });
    info.l2 = info.octant_l2[0] = reader.number<double>();
    info.max_error = reader.number<double>();
    info.compressed_bytes = bytes;
    info.exact_error = true;
    // What lies between the two may be more than a double holds.
    if (!(info.range.min <= info.range.max) || !std::isfinite(info.range.min) || !std::isfinite(info.range.max) || !(info.l2 >= 0) || !(info.max_error >= 0))
        fail("its statistics are not numbers");
    return info;
}

}  // namespace

BrickId brick_at(const BricksDesc& desc, std::size_t number) {
    const glm::i64vec3 n(desc.levels[0].bricks);
    const auto at = std::int64_t(number);
    return {0, glm::ivec3(at % n.x, at / n.x % n.y, at / (n.x * n.y))};
}

std::size_t number_of(const BricksDesc& desc, BrickId id) {
    assert(desc.has(id));
    const glm::i64vec3 n(desc.levels[0].bricks), i(id.index);
    return std::size_t((i.z * n.y + i.y) * n.x + i.x);
}

void write_brick_index(const BrickIndex& index, ScalarType type, ByteWriter& writer) {
    for (std::size_t i = 0; i < index.places.size(); ++i) {
        writer.varint(index.places[i].size);
        writer.number(index.places[i].check);
        write_info(index.infos[i], type, writer);
    }
}

BrickIndex read_brick_index(const BricksDesc& desc, std::uint64_t payload_bytes, ByteReader& reader) {
    const ScalarType type = desc.volume.type;
    const std::uint64_t count = checked_product(Index3(desc.levels[0].bricks), 1, "a grid of bricks");
    // The shortest entry: a length, a checksum, two values and two errors.
    if (count > reader.left() / (1 + 4 + 2 * bytes_of(type) + 16)) fail("its index is too short for its size");
    BrickIndex index{std::vector<BrickPlace>(std::size_t(count)), std::vector<BrickInfo>(std::size_t(count))};
    std::uint64_t offset = 0;
    for (std::size_t i = 0; i < count; ++i) {
        BrickPlace& place = index.places[i];
        place.offset = offset;
        place.size = reader.varint();
        place.check = reader.number<std::uint32_t>();
        if (place.size > payload_bytes - offset) fail("its index points beyond its end");
        offset += place.size;
        index.infos[i] = read_info(type, place.size, reader);
    }
    if (offset != payload_bytes) fail("its index does not cover its data");
    return index;
}

}  // namespace voxloom
