#include "plugins/codec-baseline/flat_bricks.h"

#include <cassert>

#include "core/data/brick_file.h"

namespace voxloom::baseline {

namespace {

constexpr std::uint64_t kMostBrickBytes = std::uint64_t(1) << 30;  // what every library can take at once

}  // namespace

Form FlatIndex::form(Index3 dims) const {
    return {dims, desc.volume.type, desc.volume.components, desc.volume.range.value_or(ValueRange{})};
}

BricksDesc flat_desc(const VolumeDesc& volume, glm::ivec3 brick) {
    BricksDesc desc;
    desc.volume = volume;
    desc.brick = brick;
    desc.tree_type = volume.type;
    desc.levels = pyramid_levels(volume, brick, true);
    const Index3 largest = glm::min(volume.dims, Index3(brick));
    if (checked_product(largest, volume.voxel_bytes(), "a brick") > kMostBrickBytes)
        fail("a brick of {} x {} x {} voxels takes more than a gigabyte; take smaller bricks", largest.x, largest.y, largest.z);
    (void)checked_product(Index3(desc.levels[0].bricks), sizeof(BrickInfo), "the bricks' statistics");
    return desc;
}

FlatBricks::FlatBricks(FlatIndex index, std::span<const std::byte> payload, std::shared_ptr<const void> keeper,
                       std::uint64_t resident)
    : Bricks(index.desc), index_(std::move(index)), payload_(payload), keeper_(std::move(keeper)), resident_(resident) {}

std::uint64_t FlatBricks::resident_bytes() const {
    return resident_ + index_.bricks.bytes();
}

std::vector<DecodedBrick> FlatBricks::refine(BrickId id, const BrickVoxels*, const std::stop_token& stop) const {
    check_stop(stop);
    const Index3 dims = desc().box_of(id).dims();
    auto brick = std::make_shared<BrickVoxels>();
    brick->stored = dims;
    brick->voxels = Buffer(family_bytes(id), "brick");
    try {
        const BrickPlace& place = index_.bricks.places[number_of(desc(), id)];
        const auto bytes = payload_.subspan(std::size_t(place.offset), std::size_t(place.size));
        if (check_of(bytes) != place.check) fail("its checksum is wrong");
        decode_brick(*index_.codec, index_.form(dims), index_.setting, bytes, brick->voxels.bytes());
    } catch (const Error& e) {
        fail("the compressed data of brick {} {} {} is damaged ({}); get the file again", id.index.x, id.index.y, id.index.z,
             e.what());
    }
    return {{id, std::move(brick)}};
}

}  // namespace voxloom::baseline
