#include "plugins/codec-wavelet/value_survey.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>

#include "plugins/codec-wavelet/voxels.h"

namespace voxloom::wavelet {

namespace {

// Grids from coarse to fine; each holds the one before it.
constexpr int kGrids = 8;
constexpr std::array<std::array<double, kGrids>, 2> kSteps = {{
    {1, 1.0 / 2, 1.0 / 4, 1.0 / 8, 1.0 / 16, 1.0 / 64, 1.0 / 256, 1.0 / 4096},
    {1, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7},
}};

struct Found {
    double lo = std::numeric_limits<double>::infinity(), hi = -lo;
    std::array<int, 2> grid{0, 0};  // of either kind, the coarsest that holds everything; kGrids: none
    void add(const Found& f) {
        lo = std::min(lo, f.lo);
        hi = std::max(hi, f.hi);
        for (std::size_t k = 0; k < 2; ++k) grid[k] = std::max(grid[k], f.grid[k]);
    }
};

// Does the value come back from its integer? As FamilyCodec::to_voxels() does it.
template <class T>
bool lies_on(T v, double step) {
    const double n = std::nearbyint(double(v) / step);
    return std::abs(n) <= std::exp2(kTreeBits) && T(n * step) == v;
}

template <class T>
void look_at(const T* values, const std::uint8_t* valid, std::size_t count, std::size_t components, Found& found) {
    for (std::size_t i = 0; i < count * components; ++i) {
        if (valid && !valid[i / components]) continue;
        const T v = values[i];
        if constexpr (std::is_floating_point_v<T>) {
            if (!std::isfinite(v)) continue;
            for (std::size_t k = 0; k < 2; ++k)
                while (found.grid[k] < kGrids && !lies_on(v, kSteps[k][std::size_t(found.grid[k])])) ++found.grid[k];
        }
        found.lo = std::min(found.lo, double(v));
        found.hi = std::max(found.hi, double(v));
    }
}

}  // namespace

ValueSurvey survey(const Volume& volume, const TreeDesc& tree, std::uint64_t most_voxels, const std::stop_token& stop,
                   const Progress& progress) {
    const VolumeDesc& desc = volume.desc();
    Found all;
    std::mutex mutex;
    for (std::int64_t at = 0; at < family_count(tree, 0);) {
        const Tile tile = tile_from(tree, 0, at, most_voxels);
        const VoxelTile voxels(volume, tile.box, stop);
        each_family(tree, tile, stop, progress, [&](std::int64_t i) {
            const Box box = own_box(tree, family_at(tree, 0, i));
            Found mine;
            with_type(desc.type, [&](auto t) {
                for (std::int64_t z = box.lo.z; z < box.hi.z; ++z)
                    for (std::int64_t y = box.lo.y; y < box.hi.y; ++y)
                        look_at(reinterpret_cast<const decltype(t)*>(voxels.view().row(box.lo.x, y, z)),
                                voxels.view().mask_row(box.lo.x, y, z), std::size_t(box.dims().x), std::size_t(desc.components), mine);
            });
            const std::lock_guard lock(mutex);
            all.add(mine);
        });
        at = tile.last;
    }
    ValueSurvey result;
    if (!(all.lo <= all.hi)) return result;
    result.range = {all.lo, all.hi};
    if (!is_float(desc.type)) return result;
    for (std::size_t k = 0; k < 2; ++k)
        if (all.grid[k] < kGrids) result.grid = std::max(result.grid, kSteps[k][std::size_t(all.grid[k])]);
    if (std::max(std::abs(all.lo), std::abs(all.hi)) > result.grid * std::exp2(kTreeBits)) result.grid = 0;
    return result;
}

}  // namespace voxloom::wavelet
