#include "plugins/codec-wavelet/memory_plan.h"

#include <tbb/task_arena.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>

#include "core/base/error.h"
#include "plugins/codec-wavelet/level_store.h"
#include "plugins/codec-wavelet/sample.h"

namespace voxloom::wavelet {

namespace {

constexpr std::uint64_t kMiB = std::uint64_t(1) << 20;

// What every step of the work costs, in bytes; a little more rather than less.
struct Costs {
    std::uint64_t fixed = 0;      // program, index, and what threads keep for a family
    double tile_voxel = 0;        // of level 0: read, compressed, and the coarse samples around it
    double coarse_voxel = 0;      // of the others: compressed
    std::uint64_t family = 0;     // voxels
};

Costs costs_of(const Volume& volume, const TreeDesc& tree) {
    const double voxel = double(volume.desc().voxel_bytes()), components = volume.desc().components;
    Costs costs;
    costs.family = box_of(tree, family_at(tree, 0, 0)).voxels();
    const double thread = double(costs.family) * (16 * components + 2 * voxel + 28) + double(kMiB);
    double bricks = 0, families = 0;
    for (int l = 0; l <= tree.top(); ++l) {
        const glm::dvec3 n(tree.bricks.levels[std::size_t(l)].bricks);
        bricks += n.x * n.y * n.z;
        families += double(family_count(tree, l));
    }
    // 24 MiB are what program and libraries take.
    costs.fixed = 24 * kMiB + std::uint64_t(thread * tbb::this_task_arena::max_concurrency() +
                                            bricks * (sizeof(BrickInfo) + 16) + families * (sizeof(FamilyPlace) + 8));
    costs.tile_voxel = (volume.desc().has_mask ? voxel + 1 : volume.data() ? 0 : voxel) + 2.5 * voxel + 4 * components;
    costs.coarse_voxel = 8 * components;
    return costs;
}

std::uint64_t least_of(const Costs& costs) {
    return costs.fixed + 2 * kMiB + 3 * std::uint64_t(double(costs.family) * std::max(costs.tile_voxel, costs.coarse_voxel));
}

}  // namespace

std::uint64_t default_memory() {
    return std::uint64_t(::sysconf(_SC_PHYS_PAGES)) * std::uint64_t(::sysconf(_SC_PAGESIZE)) / 4;
}

std::uint64_t least_memory(const Volume& volume, const TreeDesc& tree) { return least_of(costs_of(volume, tree)); }

MemoryPlan plan_memory(const Volume& volume, const TreeDesc& tree, std::uint64_t limit) {
    const Costs costs = costs_of(volume, tree);
    const std::uint64_t least = least_of(costs);
    if (limit == 0) limit = std::max(default_memory(), least);
    if (limit < least)
        fail("encoding {} takes at least {} MiB of memory, and {} MiB are allowed; allow more, or choose smaller bricks",
             summary(volume.desc()), (least + kMiB - 1) / kMiB, limit / kMiB);
    const auto left = double(limit - costs.fixed);
    const Index3 dims = tree.bricks.levels[0].dims;
    const double slab = double(dims.x) * double(dims.y) * double(box_of(tree, family_at(tree, 0, 0)).dims().z);

    MemoryPlan plan;
    // A slab at a time suits readers of slices; more than that only where slabs are small.
    const double enough = std::max(slab, 32.0 * double(kMiB));
    plan.tile_voxels = std::uint64_t(std::min(left / 3 / costs.tile_voxel, enough));
    plan.coarse_tile_voxels = std::uint64_t(std::min(left / 3 / costs.coarse_voxel, enough));
    double stores = left / 3;
    plan.first_level_in_memory = tree.top() + 1;
    for (int l = tree.top(); l > 0; --l) {
        // As they are, and as they will be decoded; a mask takes a plane of its own.
        stores -= double(LevelStore::bytes(tree, l, 2 * volume.desc().components + volume.desc().has_mask));
        if (stores < 0) break;
        plan.first_level_in_memory = l;
    }
    plan.sample_in_memory = double(Sample::bytes(tree)) < left / 12;
    plan.payload = std::max(kMiB, std::uint64_t(left / 12));  // while it grows it is there three times
    return plan;
}

}  // namespace voxloom::wavelet
