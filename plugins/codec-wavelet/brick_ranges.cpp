#include "plugins/codec-wavelet/brick_ranges.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/data/convert.h"
#include "plugins/codec-wavelet/passes.h"

namespace voxloom::wavelet {

namespace {

constexpr ValueRange kNothing{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};

void widen(ValueRange& range, const ValueRange& by) {
    range.min = std::min(range.min, by.min);
    range.max = std::max(range.max, by.max);
}

// Smallest and largest finite value of a run.
template <class T>
struct Extremes {
    T lo = std::numeric_limits<T>::max(), hi = std::numeric_limits<T>::lowest();
    // `valid`, where there is one, is of voxels of so many components.
    void add(const T* values, std::size_t count, const std::uint8_t* valid, std::size_t components) {
        T low = lo, high = hi;
        for (std::size_t i = 0; i < count; ++i) {
            if (valid && !valid[i / components]) continue;
            if constexpr (std::is_floating_point_v<T>)
                if (!std::isfinite(values[i])) continue;
            low = values[i] < low ? values[i] : low;
            high = values[i] > high ? values[i] : high;
        }
        lo = low;
        hi = high;
    }
    void add(const Extremes& e) {
        lo = std::min(lo, e.lo);
        hi = std::max(hi, e.hi);
    }
};

// row(y, z) and valid(y, z) point at the brick's first voxel of a row. Calls use(part, lo, hi) for parts with a value.
template <class T, class Row, class Valid, class Use>
void each_part(const Box& brick, int components, const Row& row, const Valid& valid, const Use& use) {
    std::array<Extremes<T>, 27> parts;
    const auto c = static_cast<std::size_t>(components);
    const std::size_t count = std::size_t(brick.dims().x) * c;
    for (std::int64_t z = brick.lo.z; z < brick.hi.z; ++z)
        for (std::int64_t y = brick.lo.y; y < brick.hi.y; ++y) {
            const T* values = row(y, z);
            std::array<Extremes<T>, 3> here;
            const std::uint8_t* mask = valid(y, z);
            here[0].add(values, count, mask, c);
            here[1].add(values, c, mask, c);
            here[2].add(values + count - c, c, mask ? mask + brick.dims().x - 1 : nullptr, c);
            const bool in_z[3] = {true, z == brick.lo.z, z + 1 == brick.hi.z};
            const bool in_y[3] = {true, y == brick.lo.y, y + 1 == brick.hi.y};
            for (std::size_t kz = 0; kz < 3; ++kz)
                for (std::size_t ky = 0; ky < 3 && in_z[kz]; ++ky)
                    for (std::size_t kx = 0; kx < 3 && in_y[ky]; ++kx) parts[9 * kz + 3 * ky + kx].add(here[kx]);
        }
    for (std::size_t p = 0; p < parts.size(); ++p)
        if (parts[p].lo <= parts[p].hi) use(p, parts[p].lo, parts[p].hi);
}

}  // namespace

BrickParts no_parts() {
    BrickParts parts;
    parts.range.fill(kNothing);
    return parts;
}

BrickParts parts_of(const Box& brick, const VoxelView& voxels, ScalarType type, int components) {
    BrickParts parts = no_parts();
    with_type(type, [&](auto t) {
        using T = decltype(t);
        const auto row = [&](std::int64_t y, std::int64_t z) {
            return reinterpret_cast<const T*>(voxels.row(brick.lo.x, y, z));
        };
        const auto valid = [&](std::int64_t y, std::int64_t z) { return voxels.mask_row(brick.lo.x, y, z); };
        each_part<T>(brick, components, row, valid, [&](std::size_t p, T lo, T hi) { parts.range[p] = {double(lo), double(hi)}; });
    });
    return parts;
}

void add_parts(const TreeDesc& tree, const Box& brick, const std::vector<std::int32_t>& plane, const Box& box, BrickParts& parts) {
    const VoxelView view{box, reinterpret_cast<const std::byte*>(plane.data()), sizeof(std::int32_t)};
    const auto row = [&](std::int64_t y, std::int64_t z) {
        return reinterpret_cast<const std::int32_t*>(view.row(brick.lo.x, y, z));
    };
    const auto valid = [](std::int64_t, std::int64_t) -> const std::uint8_t* { return nullptr; };
    each_part<std::int32_t>(brick, 1, row, valid, [&](std::size_t p, std::int32_t lo, std::int32_t hi) {
        widen(parts.range[p], {delivered(tree, lo), delivered(tree, hi)});
    });
}

double delivered(const TreeDesc& tree, std::int32_t v) {
    const double value = tree.map.value(v);
    const ScalarType type = tree.bricks.volume.type;
    if (type == ScalarType::f64) return value;
    if (type == ScalarType::f32) return double(float(value));
    const auto [lo, hi] = limits_of(type);
    return std::clamp(round_half_to_even(value), lo, hi);
}

void begin_ranges(std::vector<BrickInfo>& infos) {
    for (BrickInfo& info : infos) info.range = kNothing;
}

void end_ranges(std::vector<BrickInfo>& infos) {
    for (BrickInfo& info : infos)
        if (!(info.range.min <= info.range.max)) info.range = {};
}

void widen_ranges(const BricksDesc& desc, BrickId id, const BrickParts& parts, std::vector<BrickInfo>& infos) {
    for (int part = 0; part < 27; ++part) {
        // The first layer belongs to the range of the neighbour below, the last one to that above.
        const glm::ivec3 mode(part % 3, part / 3 % 3, part / 9);
        const BrickId other{id.level, id.index - glm::ivec3(glm::equal(mode, glm::ivec3(1))) +
                                          glm::ivec3(glm::equal(mode, glm::ivec3(2)))};
        if (desc.has(other)) widen(infos[place_of(desc, other)].range, parts.range[std::size_t(part)]);
    }
}

}  // namespace voxloom::wavelet
