#include "plugins/codec-wavelet/analysis.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <mutex>

#include "core/base/meter.h"
#include "plugins/codec-wavelet/passes.h"

namespace voxloom::wavelet {

namespace {

constexpr ValueRange kNothing{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};

// Of small integers; others need their range before they are mapped.
ValueRange range_of(const VoxelView& voxels, const Box& box, ScalarType type, int components) {
    ValueRange range = kNothing;
    with_type(type, [&](auto t) {
        using T = decltype(t);
        T lo = std::numeric_limits<T>::max(), hi = std::numeric_limits<T>::lowest();
        const std::int64_t n = box.dims().x * components;
        for (std::int64_t z = box.lo.z; z < box.hi.z; ++z)
            for (std::int64_t y = box.lo.y; y < box.hi.y; ++y) {
                const T* row = reinterpret_cast<const T*>(voxels.row(box.lo.x, y, z));
                for (std::int64_t i = 0; i < n; ++i) {
                    lo = row[i] < lo ? row[i] : lo;
                    hi = row[i] > hi ? row[i] : hi;
                }
            }
        range = {double(lo), double(hi)};
    });
    return range;
}

double mean_detail(std::vector<std::int32_t>& box, const Shape& shape) {
    Details d;
    d.shape = shape;
    d.q = box.data();
    double sum = 0;
    for_each_row(d, [&](const std::int32_t* q, std::size_t n) {
        std::uint64_t row = 0;
        for (std::size_t x = 0; x < n; ++x) row += q[x] < 0 ? 0u - std::uint32_t(q[x]) : std::uint32_t(q[x]);
        sum += double(row);
    });
    return sum / double(shape.voxels());
}

// Transforms the planes of a family; what is left of them is the low band. Returns the mean size of the details.
double to_low_band(const TreeDesc& tree, FamilyId family, FamilyCodec::Planes& planes, CoefficientCounts::Bands* counts) {
    thread_local std::vector<std::int32_t> scratch;
    const Shape shape = shape_of(tree, family);
    const glm::ivec3 n = shape.low();
    double activity = 0;
    for (auto& plane : planes) {
        if (counts) {
            split_family(plane.data(), shape, tree.rounding, scratch);
            counts->add(shape, plane.data());
        } else {
            forward(plane.data(), shape.dims, shape.halved, tree.rounding, scratch, shape.shared);
        }
        activity += mean_detail(plane, shape);
        std::size_t to = 0;
        for (int z = 0; z < n.z; ++z)
            for (int y = 0; y < n.y; ++y, to += std::size_t(n.x))
                std::copy_n(plane.begin() + std::ptrdiff_t(shape.at({0, y, z})), n.x, plane.begin() + std::ptrdiff_t(to));
        plane.resize(to);
    }
    return activity;
}

}  // namespace

FamilyCodec::Planes Encoding::originals(FamilyId family) const {
    auto planes = original[std::size_t(family.level)].read(box_of(tree, family));
    planes.resize(std::size_t(tree.bricks.volume.components));
    return planes;
}

Mask Encoding::mask(FamilyId family) const {
    const Box box = box_of(tree, family);
    std::vector<std::int32_t> plane(box.voxels());
    original[std::size_t(family.level)].read(box, tree.bricks.volume.components, plane.data());
    return {plane.begin(), plane.end()};
}

void analyse(Encoding& e, bool counts, const Progress& progress) {
    const TreeDesc& tree = e.tree;
    const int top = tree.top(), components = tree.bricks.volume.components;
    const bool range_known = tree.bricks.volume.range.has_value();
    e.original.clear();
    e.original.resize(std::size_t(top) + 1);
    const bool masked = tree.bricks.volume.has_mask;  // the levels' masks are one more plane
    for (int l = 1; l <= top; ++l)
        e.original[std::size_t(l)] = LevelStore(tree, l, components + masked, l >= e.memory.first_level_in_memory);
    e.sample = Sample(tree, e.memory.sample_in_memory);
    e.counts = CoefficientCounts(tree);
    ValueRange range = kNothing;
    std::mutex mutex;
    std::atomic<std::int64_t> transform_ns{0};

    for (int l = 0; l < std::max(top, 1); ++l) {
        const Progress here = progress.part(l == 0 ? 0 : 1 - 0.15 / l, 1 - 0.15 / (l + 1));
        const std::uint64_t most = l == 0 ? e.memory.tile_voxels : e.memory.coarse_tile_voxels;
        const Selection counted = select(tree, l, kCountedFamilies);
        const auto one = [&](std::int64_t i, const VoxelView& voxels) {
            const FamilyId family = family_at(tree, l, i);
            if (l == 0) {
                if (!range_known) {
                    const ValueRange mine = range_of(voxels, own_box(tree, family), e.type(), components);
                    const std::lock_guard lock(mutex);
                    range = {std::min(range.min, mine.min), std::max(range.max, mine.max)};
                }
            }
            if (l == top) {  // the root is not transformed here
                if (l == 0) e.sample.keep(tree, i, voxels, 0);
                return;
            }
            thread_local FamilyCodec::Planes planes;
            const std::int64_t start = thread_cpu_ns();
            if (l == 0)
                integers_of(tree, voxels, family, planes);
            else
                planes = e.originals(family);
            const auto bands = counts && counted.has(i) ? std::make_unique<CoefficientCounts::Bands>() : nullptr;
            const double activity = to_low_band(tree, family, planes, bands.get());
            transform_ns += thread_cpu_ns() - start;
            if (l == 0) e.sample.keep(tree, i, voxels, activity);
            if (masked) {
                const Mask low = low_mask(l == 0 ? mask_of(voxels, box_of(tree, family)) : e.mask(family), shape_of(tree, family));
                planes.emplace_back(low.begin(), low.end());
            }
            e.original[std::size_t(l) + 1].write(tree.bricks.box_of({l + 1, family.index}), planes, parent_box(tree, family));
            if (!bands) return;
            const std::lock_guard lock(mutex);
            e.counts.add(l, *bands);
        };
        for (std::int64_t at = 0; at < family_count(tree, l);) {
            const Tile tile = tile_from(tree, l, at, most);
            if (l == 0) {
                const VoxelTile voxels(e.volume, tile.box, e.stop);
                each_family(tree, tile, e.stop, here, [&](std::int64_t i) { one(i, voxels.view()); });
            } else {
                each_family(tree, tile, e.stop, here, [&](std::int64_t i) { one(i, {}); });
            }
            at = tile.last;
        }
    }
    e.sample.finish();
    e.transform_seconds = double(transform_ns) * 1e-9;
    if (!range_known) e.tree.bricks.volume.range = range;
    progress(1);
}

}  // namespace voxloom::wavelet
