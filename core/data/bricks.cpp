#include "core/data/bricks.h"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <limits>

#include "core/base/error.h"
#include "core/base/hash.h"
#include "core/data/brick_cache.h"

namespace voxloom {

std::size_t HashOfBrickId::operator()(const BrickId& id) const {
    return std::size_t(hash_bytes(std::as_bytes(std::span<const BrickId, 1>(&id, 1))).lo);
}

namespace {

// The axes that level `level` + 1 halves.
glm::bvec3 halved(const BricksDesc& desc, int level) {
    return glm::notEqual(desc.levels[std::size_t(level)].stride,
                         desc.levels[std::size_t(level) + 1].stride);
}

}  // namespace

bool BricksDesc::has(BrickId id) const {
    return id.level >= 0 && std::size_t(id.level) < levels.size() &&
           glm::all(glm::greaterThanEqual(id.index, glm::ivec3(0))) &&
           glm::all(glm::lessThan(id.index, levels[std::size_t(id.level)].bricks));
}

Box BricksDesc::box_of(BrickId id) const {
    assert(has(id));
    const Index3 lo = Index3(id.index) * Index3(brick);
    return {lo, glm::min(lo + Index3(brick), levels[std::size_t(id.level)].dims)};
}

Box BricksDesc::fine_box_of(BrickId id) const {
    assert(has(id));
    const Index3 stride(levels[std::size_t(id.level)].stride);
    const Index3 lo = Index3(id.index) * Index3(brick) * stride;
    return {lo, glm::min(lo + Index3(brick) * stride, volume.dims)};
}

std::optional<BrickId> BricksDesc::coarser(BrickId id) const {
    assert(has(id));
    if (std::size_t(id.level) + 1 >= levels.size()) return std::nullopt;
    return BrickId{id.level + 1, id.index >> glm::ivec3(halved(*this, id.level))};
}

std::vector<BrickId> BricksDesc::finer(BrickId id) const {
    assert(has(id));
    std::vector<BrickId> all;
    if (id.level == 0) return all;
    const glm::ivec3 shift(halved(*this, id.level - 1));
    for (int octant = 0; octant < 8; ++octant) {
        const glm::ivec3 upper(octant & 1, octant >> 1 & 1, octant >> 2);
        const BrickId finer{id.level - 1, (id.index << shift) + upper};
        if (glm::all(glm::lessThanEqual(upper, shift)) && has(finer)) all.push_back(finer);
    }
    return all;
}

int BricksDesc::octant_of(BrickId id) const {
    assert(has(id));
    if (std::size_t(id.level) + 1 >= levels.size()) return 0;
    const glm::ivec3 upper = id.index & glm::ivec3(halved(*this, id.level));
    return upper.x | upper.y << 1 | upper.z << 2;
}

glm::dmat4 BricksDesc::level_to_world(int level) const {
    glm::dmat4 m = volume.index_to_world;
    for (int a = 0; a < 3; ++a) m[a] *= double(levels[std::size_t(level)].stride[a]);
    return m;
}

std::vector<LevelDesc> pyramid_levels(const VolumeDesc& volume, glm::ivec3 brick, bool flat) {
    for (int a = 0; a < 3; ++a)
        if (brick[a] < 1) fail("bricks: a brick of {} voxels along {} is not possible", brick[a], "xyz"[a]);
    std::vector<LevelDesc> levels;
    LevelDesc level;
    level.dims = volume.dims;
    for (;;) {
        for (int a = 0; a < 3; ++a) {
            const std::int64_t n = level.dims[a] / brick[a] + (level.dims[a] % brick[a] != 0);
            if (n > std::int64_t(1) << 30)
                fail("bricks: {} voxels along {} cut into bricks of {} are too many; take larger bricks",
                     level.dims[a], "xyz"[a], brick[a]);
            level.bricks[a] = std::int32_t(n);
        }
        levels.push_back(level);
        const glm::bvec3 large = glm::greaterThan(level.dims, Index3(brick));
        if (flat || !glm::any(large) || volume.voxels() == 0) return levels;

        const glm::dvec3 spacing = volume.spacing() * glm::dvec3(level.stride);
        double smallest = std::numeric_limits<double>::infinity();
        for (int a = 0; a < 3; ++a)
            if (large[a]) smallest = std::min(smallest, spacing[a]);
        bool any = false;
        for (int pass = 0; pass < 2 && !any; ++pass)  // spacings that are no numbers: halve all
            for (int a = 0; a < 3; ++a)
                if (large[a] && (pass == 1 || spacing[a] <= 1.4142135623730951 * smallest)) {
                    level.dims[a] = level.dims[a] / 2 + level.dims[a] % 2;
                    level.stride[a] *= 2;
                    any = true;
                }
    }
}

Bricks::Bricks(BricksDesc desc) : desc_(std::move(desc)) {
    static std::atomic<std::uint64_t> next{1};
    identity_ = next++;
    assert(!desc_.levels.empty());
}

Bricks::~Bricks() { BrickCache::drop_everywhere(identity_); }

std::uint64_t Bricks::family_bytes(BrickId id) const {
    const std::optional<BrickId> above = parent(id);
    const std::uint64_t bricks = above ? desc_.finer(*above).size() : 1;
    return bricks * checked_product(Index3(desc_.brick), desc_.tree_voxel_bytes(), "brick");
}

void Bricks::read_mask(int, const Box&, std::span<std::uint8_t> out) const {
    std::fill(out.begin(), out.end(), std::uint8_t(1));
}

}  // namespace voxloom
