#include "plugins/scene/materials.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "core/base/parallel.h"
#include "core/data/brick_cache.h"

namespace voxloom::scene {

namespace {

constexpr std::size_t kBins = 128;
using Histogram = std::vector<double>;

VolumePtr volume_of(const Value& data, const std::stop_token& stop) {
    if (auto* volume = std::get_if<VolumePtr>(&data)) return *volume;
    if (auto* bricks = std::get_if<BricksPtr>(&data)) {
        // Boundaries of materials are coarse features: a small level knows them as well.
        const auto& levels = (*bricks)->desc().levels;
        std::size_t level = 0;
        while (level + 1 < levels.size() && Box::of(levels[level].dims).voxels() > (1u << 21)) ++level;
        return level_as_volume(*bricks, int(level), BrickCache::global());
    }
    if (auto* series = std::get_if<SeriesPtr>(&data); series && !(*series)->desc().times.empty())
        return volume_of((*series)->fetch(0, stop), stop);
    return nullptr;
}

Histogram histogram_of(const Volume& volume, ValueRange range, const std::stop_token& stop) {
    const VolumeDesc& desc = volume.desc();
    const double scale = double(kBins) / range.extent();
    Histogram all(kBins, 0.0);
    std::mutex mutex;
    // One slab at a time in memory for each thread, however long the range that it was given.
    constexpr std::int64_t kSlab = 4;
    parallel_for(0, (desc.dims.z + kSlab - 1) / kSlab, 1, [&](std::int64_t first, std::int64_t last) {
        Histogram mine(kBins, 0.0);
        for (std::int64_t i = first; i < last; ++i) {
            check_stop(stop);
            const Box slab{{0, 0, i * kSlab},
                           {desc.dims.x, desc.dims.y, std::min((i + 1) * kSlab, desc.dims.z)}};
            Buffer voxels(slab.voxels() * desc.voxel_bytes(), "slab");
            volume.read(slab, voxels.bytes(), stop);
            with_type(desc.type, [&](auto t) {
                for (auto value : voxels.as<decltype(t)>()) {
                    const double bin = (double(value) - range.min) * scale;
                    if (bin >= 0 && bin <= kBins) mine[std::size_t(std::min(bin, kBins - 1.0))] += 1;
                }
            });
        }
        std::lock_guard lock(mutex);
        for (std::size_t i = 0; i < kBins; ++i) all[i] += mine[i];
    }, stop);
    return all;
}

}  // namespace

std::vector<double> material_boundaries(const Value& data, ValueRange range, int count,
                                        const std::stop_token& stop) {
    const VolumePtr volume = volume_of(data, stop);
    if (!volume) return {};
    const Histogram histogram = histogram_of(*volume, range, stop);

    // Weight and moment up to each bin: a class [a, b) has weight w[b]-w[a] and moment m[b]-m[a].
    std::vector<double> w(kBins + 1, 0.0), m(kBins + 1, 0.0);
    for (std::size_t i = 0; i < kBins; ++i) {
        const double weight = std::sqrt(histogram[i]);
        w[i + 1] = w[i] + weight;
        m[i + 1] = m[i] + weight * (double(i) + 0.5);
    }
    auto between = [&](std::size_t a, std::size_t b) {
        const double weight = w[b] - w[a], moment = m[b] - m[a];
        return weight > 0 ? moment * moment / weight : 0.0;
    };
    // best[k][b]: largest between-class variance of the bins below b cut into k+1 classes.
    std::vector<std::vector<double>> best(std::size_t(count) + 1, std::vector<double>(kBins + 1));
    std::vector<std::vector<std::size_t>> cut(std::size_t(count) + 1, std::vector<std::size_t>(kBins + 1));
    for (std::size_t b = 0; b <= kBins; ++b) best[0][b] = between(0, b);
    for (std::size_t k = 1; k <= std::size_t(count); ++k)
        for (std::size_t b = k; b <= kBins; ++b)
            for (std::size_t a = k; a < b || a == k; ++a) {
                const double variance = best[k - 1][a] + between(a, b);
                if (a == k || variance > best[k][b]) {
                    best[k][b] = variance;
                    cut[k][b] = a;
                }
            }
    std::vector<double> boundaries;
    std::size_t end = kBins;
    for (std::size_t k = std::size_t(count); k > 0; --k) {
        end = cut[k][end];
        // Every cut in a gap between two materials is as good: the middle stays clear of their noise.
        std::size_t lo = end, hi = end;
        while (lo > 0 && histogram[lo - 1] == 0) --lo;
        while (hi < kBins && histogram[hi] == 0) ++hi;
        boundaries.push_back(range.min + double(lo + hi) / (2 * kBins) * range.extent());
    }
    std::ranges::reverse(boundaries);
    return boundaries;
}

}  // namespace voxloom::scene
