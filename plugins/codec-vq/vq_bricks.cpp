#include "plugins/codec-vq/vq_bricks.h"

#include <algorithm>
#include <cassert>

#include "core/base/error.h"
#include "core/data/brick_file.h"

namespace voxloom::vq {

namespace {

constexpr std::uint64_t kMostBrickBytes = std::uint64_t(1) << 30;

std::size_t place_in(glm::ivec3 grid, glm::ivec3 i) {
    return (std::size_t(i.z) * std::size_t(grid.y) + std::size_t(i.y)) * std::size_t(grid.x) + std::size_t(i.x);
}

}  // namespace

std::size_t VqIndex::macroblock_of(BrickId id) const {
    const glm::i64vec3 share = glm::i64vec3(id.index) * glm::i64vec3(macroblocks) / glm::i64vec3(desc.levels[0].bricks);
    return place_in(macroblocks, glm::ivec3(share));
}

std::span<const Codebooks> VqIndex::books_of(BrickId id) const {
    const auto components = std::size_t(desc.volume.components);
    return std::span(books).subspan(macroblock_of(id) * components, components);
}

BricksDesc vq_desc(const VolumeDesc& volume, glm::ivec3 brick) {
    if (brick.x % 4 || brick.y % 4 || brick.z % 4)
        fail("a brick of {} x {} x {} voxels does not hold whole blocks; its sides must be multiples of 4", brick.x, brick.y, brick.z);
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

glm::ivec3 macroblocks_for(const BricksDesc& desc, glm::ivec3 wanted) {
    return glm::clamp(wanted, glm::ivec3(1), glm::max(desc.levels[0].bricks, glm::ivec3(1)));
}

VqBricks::VqBricks(VqIndex index, std::span<const std::byte> payload, std::shared_ptr<const void> keeper, std::uint64_t resident)
    : Bricks(index.desc), index_(std::move(index)), payload_(payload), keeper_(std::move(keeper)), resident_(resident) {}

std::uint64_t VqBricks::resident_bytes() const {
    std::uint64_t numbers = 0;
    for (const Codebooks& books : index_.books) numbers += books.octants.words.size() + books.voxels.words.size();
    return resident_ + numbers * sizeof(float) + index_.bricks.bytes();
}

std::vector<DecodedBrick> VqBricks::refine(BrickId id, const BrickVoxels*, const std::stop_token& stop) const {
    check_stop(stop);
    const Index3 dims = desc().box_of(id).dims();
    auto brick = std::make_shared<BrickVoxels>();
    brick->stored = dims;
    brick->voxels = Buffer(family_bytes(id), "brick");
    try {
        const BrickPlace& place = index_.bricks.places[number_of(desc(), id)];
        const auto bytes = payload_.subspan(std::size_t(place.offset), std::size_t(place.size));
        if (check_of(bytes) != place.check) fail("its checksum is wrong");
        decode_brick(index_.form(dims), index_.books_of(id), bytes, brick->voxels.bytes());
    } catch (const Error& e) {
        fail("the compressed data of brick {} {} {} is damaged ({}); get the file again", id.index.x, id.index.y, id.index.z,
             e.what());
    }
    return {{id, std::move(brick)}};
}

}  // namespace voxloom::vq
