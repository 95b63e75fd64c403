#include "plugins/codec-wavelet/passes.h"

#include <algorithm>

namespace voxloom::wavelet {

std::int64_t family_count(const TreeDesc& tree, int level) {
    const glm::i64vec3 n(families_of(tree, level));
    return n.x * n.y * n.z;
}

FamilyId family_at(const TreeDesc& tree, int level, std::int64_t i) {
    const glm::i64vec3 n(families_of(tree, level));
    return {level, glm::ivec3(i % n.x, i / n.x % n.y, i / (n.x * n.y))};
}

Box parent_box(const TreeDesc& tree, FamilyId family) { return stored_box(tree, {family.level + 1, family.index}); }

std::vector<BrickId> bricks_of(const TreeDesc& tree, FamilyId family) {
    if (family.level == tree.top()) return {{family.level, glm::ivec3(0)}};
    return tree.bricks.finer({family.level + 1, family.index});
}

std::size_t place_of(const BricksDesc& desc, BrickId id) {
    const glm::i64vec3 n(desc.levels[std::size_t(id.level)].bricks), i(id.index);
    return std::size_t((i.z * n.y + i.y) * n.x + i.x);
}

Tile tile_from(const TreeDesc& tree, int level, std::int64_t first, std::uint64_t most_voxels) {
    const glm::i64vec3 n(families_of(tree, level));
    const Index3 dims = tree.bricks.levels[std::size_t(level)].dims, family = box_of(tree, family_at(tree, level, 0)).dims();
    const std::uint64_t row = std::uint64_t(dims.x) * std::uint64_t(family.y) * std::uint64_t(family.z);
    const std::uint64_t slab = std::uint64_t(dims.x) * std::uint64_t(dims.y) * std::uint64_t(family.z);
    const glm::i64vec3 at(family_at(tree, level, first).index);
    std::int64_t count = 0;
    if (at.x == 0 && at.y == 0 && slab <= most_voxels)
        count = std::min(n.z - at.z, std::int64_t(most_voxels / slab)) * n.x * n.y;
    else if (at.x == 0 && row <= most_voxels)
        count = std::min(n.y - at.y, std::int64_t(most_voxels / row)) * n.x;
    else
        count = std::clamp(std::int64_t(most_voxels / Box::of(family).voxels()), std::int64_t(1), n.x - at.x);
    const Box begin = box_of(tree, family_at(tree, level, first)), end = box_of(tree, family_at(tree, level, first + count - 1));
    return {level, first, first + count, {glm::min(begin.lo, end.lo), end.hi}};
}

}  // namespace voxloom::wavelet
