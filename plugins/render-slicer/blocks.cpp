#include "plugins/render-slicer/blocks.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/parallel.h"

namespace voxloom::slicer {

namespace {

// Widens ranges[bx] by one row of voxels, for blocks along x. Neighbouring blocks share a voxel.
template <class T>
void widen_row(const T* row, const std::uint8_t* valid, const VolumeDesc& desc, int component,
               int size, int reach, std::vector<glm::vec2>& ranges) {
    const int n = int(desc.dims.x), stride = desc.components;
    auto value = [&](int x) {
        const T* v = row + std::size_t(x) * std::size_t(stride);
        if (!desc.color) return double(v[component]);
        return 0.2126 * double(v[0]) + 0.7152 * double(v[1]) + 0.0722 * double(v[2]);
    };
    for (std::size_t b = 0; b < ranges.size(); ++b) {
        const int from = std::max(int(b) * size - reach, 0);
        const int to = std::min((int(b) + 1) * size + reach, n - 1);
        float lo = ranges[b].x, hi = ranges[b].y;
        if constexpr (sizeof(T) <= 2) {
            if (!desc.color && stride == 1 && !valid) {
                // Integers: no conversion in the loop, which then runs in SIMD.
                T a = row[from], z = a;
                for (int x = from; x <= to; ++x) {
                    a = std::min(a, row[x]);
                    z = std::max(z, row[x]);
                }
                ranges[b] = {std::min(lo, float(a)), std::max(hi, float(z))};
                continue;
            }
        }
        for (int x = from; x <= to; ++x) {
            double v = value(x);
            if ((valid && !valid[x]) || !std::isfinite(v)) continue;
            // Rounded outwards, so that a float range never loses a value of a wider type.
            float below = float(v), above = below;
            if (double(below) > v) below = std::nextafter(below, -std::numeric_limits<float>::infinity());
            if (double(above) < v) above = std::nextafter(above, std::numeric_limits<float>::infinity());
            lo = std::min(lo, below);
            hi = std::max(hi, above);
        }
        ranges[b] = {lo, hi};
    }
}

}  // namespace

BlockRanges block_ranges(const Volume& volume, int component, int size, int reach,
                         bool cubic, const std::stop_token& stop) {
    if (cubic) ++reach;
    const VolumeDesc& desc = volume.desc();
    const std::byte* data = volume.data();
    BlockRanges out;
    out.size = size;
    for (int a = 0; a < 3; ++a)
        out.grid[a] = int(std::max<std::int64_t>(1, (desc.dims[a] - 1 + size - 1) / size));
    constexpr float inf = std::numeric_limits<float>::infinity();
    out.ranges.assign(std::size_t(out.grid.x) * std::size_t(out.grid.y) * std::size_t(out.grid.z),
                      {inf, -inf});
    const std::size_t row_voxels = std::size_t(desc.dims.x);
    with_type(desc.type, [&](auto t) {
        using T = decltype(t);
        // One layer of blocks a task; a plane of rows is read once for each row of blocks.
        parallel_for(0, out.grid.z, 1, [&](std::int64_t lo, std::int64_t hi) {
            std::vector<std::uint8_t> mask(desc.has_mask ? row_voxels : 0);
            std::vector<glm::vec2> row_ranges(std::size_t(out.grid.x));
            for (std::int64_t bz = lo; bz < hi; ++bz) {
                const std::int64_t z0 = std::max<std::int64_t>(bz * size - reach, 0);
                const std::int64_t z1 = std::min<std::int64_t>((bz + 1) * size + reach, desc.dims.z - 1);
                for (std::int64_t by = 0; by < out.grid.y; ++by) {
                    const std::int64_t y0 = std::max<std::int64_t>(by * size - reach, 0);
                    const std::int64_t y1 =
                        std::min<std::int64_t>((by + 1) * size + reach, desc.dims.y - 1);
                    check_stop(stop);
                    std::fill(row_ranges.begin(), row_ranges.end(), glm::vec2(inf, -inf));
                    for (std::int64_t z = z0; z <= z1; ++z)
                        for (std::int64_t y = y0; y <= y1; ++y) {
                            if (desc.has_mask)
                                volume.read_mask({{0, y, z}, {desc.dims.x, y + 1, z + 1}}, mask);
                            auto row = reinterpret_cast<const T*>(data) +
                                       (std::size_t(z) * std::size_t(desc.dims.y) + std::size_t(y)) *
                                           row_voxels * std::size_t(desc.components);
                            widen_row(row, desc.has_mask ? mask.data() : nullptr, desc, component, size,
                                      reach, row_ranges);
                        }
                    std::copy(row_ranges.begin(), row_ranges.end(),
                              out.ranges.begin() + (bz * out.grid.y + by) * out.grid.x);
                }
            }
        }, stop);
    });
    glm::vec2 all(inf, -inf);
    for (glm::vec2 r : out.ranges)
        if (r.x <= r.y) all = {std::min(all.x, r.x), std::max(all.y, r.y)};
    auto overshoot = [cubic](glm::vec2 r) {
        if (!cubic || !(r.x < r.y)) return r;
        const float middle = 0.5f * r.x + 0.5f * r.y;
        const float half = float(kCubicOvershoot) * (0.5f * r.y - 0.5f * r.x);
        return glm::vec2(middle - half, middle + half);
    };
    for (glm::vec2& r : out.ranges) r = overshoot(r);
    all = overshoot(all);
    out.all = {all.x, all.y};
    return out;
}

namespace {

// Distances of a row from those of another one, `shift` to the side: there the other kind is at distance 1, and
// one's own kind as far as that one sees, and one more. Rows are apart, so this runs in SIMD.
void relax(const std::uint8_t* from, const std::uint8_t* seen_from, std::uint8_t* to, const std::uint8_t* seen_to,
           int n, int shift) {
    const int begin = std::max(0, -shift), end = std::min(n, n - shift);
    for (int i = begin; i < end; ++i) {
        const std::uint8_t d = seen_from[i + shift] == seen_to[i] ? std::uint8_t(from[i + shift] + 1) : std::uint8_t(1);
        to[i] = std::min(to[i], d);
    }
}

}  // namespace

std::vector<std::int8_t> leaps(glm::ivec3 grid, const std::vector<std::uint8_t>& seen) {
    // Chessboard distances are exact after one sweep forward and one back over the 13 neighbours that
    // each has already passed, as every shortest path can be ordered so. Distances to both kinds are
    // one field: a neighbour of the other kind is at distance 1.
    std::vector<std::uint8_t> d(seen.size(), 127);
    const int n = grid.x;
    auto sweep = [&](int direction) {
        auto at = [&](int count, int i) { return direction > 0 ? i : count - 1 - i; };
        for (int k = 0; k < grid.z; ++k)
            for (int j = 0; j < grid.y; ++j) {
                const int z = at(grid.z, k), y = at(grid.y, j);
                const std::size_t row = (std::size_t(z) * std::size_t(grid.y) + std::size_t(y)) * std::size_t(n);
                auto relax_from = [&](int from_z, int from_y) {
                    if (from_z < 0 || from_z >= grid.z || from_y < 0 || from_y >= grid.y) return;
                    const std::size_t from = (std::size_t(from_z) * std::size_t(grid.y) + std::size_t(from_y)) * std::size_t(n);
                    for (int shift = -1; shift <= 1; ++shift)
                        relax(&d[from], &seen[from], &d[row], &seen[row], n, shift);
                };
                for (int o = -1; o <= 1; ++o) relax_from(z - direction, y + o);
                relax_from(z, y - direction);
                for (int i = 1; i < n; ++i) {
                    const std::size_t here = row + std::size_t(at(n, i)), before = row + std::size_t(at(n, i - 1));
                    d[here] = std::min(d[here], seen[before] == seen[here] ? std::uint8_t(d[before] + 1) : std::uint8_t(1));
                }
            }
    };
    sweep(1);
    sweep(-1);
    std::vector<std::int8_t> signed_distances(d.size());
    for (std::size_t i = 0; i < d.size(); ++i) signed_distances[i] = std::int8_t(seen[i] ? d[i] : -d[i]);
    return signed_distances;
}

}  // namespace voxloom::slicer
