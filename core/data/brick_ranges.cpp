#include "core/data/brick_ranges.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace voxloom {

namespace {

constexpr ValueRange kNothing{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};

}  // namespace

BrickParts parts_of(const Box& brick, const std::byte* voxels, const Box& voxels_box, ScalarType type, int components) {
    BrickParts parts;
    const Index3 n = voxels_box.dims();
    with_type(type, [&](auto t) {
        using T = decltype(t);
        const T* values = reinterpret_cast<const T*>(voxels);
        for (int part = 0; part < 27; ++part) {
            Box box = brick;
            int digits = part;
            for (int a = 0; a < 3; ++a, digits /= 3) {
                if (digits % 3 == 1) box.hi[a] = box.lo[a] + 1;
                if (digits % 3 == 2) box.lo[a] = box.hi[a] - 1;
            }
            T lo = std::numeric_limits<T>::max(), hi = std::numeric_limits<T>::lowest();
            for (std::int64_t z = box.lo.z; z < box.hi.z; ++z)
                for (std::int64_t y = box.lo.y; y < box.hi.y; ++y) {
                    const std::int64_t row = ((z - voxels_box.lo.z) * n.y + y - voxels_box.lo.y) * n.x - voxels_box.lo.x;
                    for (std::int64_t i = (row + box.lo.x) * components; i < (row + box.hi.x) * components; ++i) {
                        if constexpr (std::is_floating_point_v<T>)
                            if (!std::isfinite(values[i])) continue;
                        lo = std::min(lo, values[i]);
                        hi = std::max(hi, values[i]);
                    }
                }
            parts.range[std::size_t(part)] = lo <= hi ? ValueRange{double(lo), double(hi)} : kNothing;
        }
    });
    return parts;
}

void fill_fine_ranges(const BricksDesc& desc, std::span<const BrickParts> parts, std::vector<BrickInfo>& infos) {
    const glm::i64vec3 n(desc.levels[0].bricks);
    const auto place_of = [&](glm::i64vec3 i) { return std::size_t((i.z * n.y + i.y) * n.x + i.x); };
    for (std::size_t i = 0; i < infos.size(); ++i) {
        const std::int64_t at = std::int64_t(i);
        const glm::ivec3 index(at % n.x, at / n.x % n.y, at / (n.x * n.y));
        ValueRange range = kNothing;
        for (int part = 0; part < 27; ++part) {
            // A neighbour further up gives its first layer, one further down its last.
            const glm::ivec3 mode(part % 3, part / 3 % 3, part / 9);
            const BrickId other{0, index + glm::ivec3(glm::equal(mode, glm::ivec3(1))) -
                                       glm::ivec3(glm::equal(mode, glm::ivec3(2)))};
            if (!desc.has(other)) continue;
            const ValueRange& more = parts[place_of(glm::i64vec3(other.index))].range[std::size_t(part)];
            range.min = std::min(range.min, more.min);
            range.max = std::max(range.max, more.max);
        }
        infos[i].range = range.min <= range.max ? range : ValueRange{};
    }
}

}  // namespace voxloom
