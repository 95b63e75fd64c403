#include "plugins/codec-wavelet/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/parallel.h"
#include "core/data/convert.h"

namespace voxloom::wavelet {

namespace {

constexpr ValueRange kNothing{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};

void widen(ValueRange& range, const ValueRange& by) {
    range.min = std::min(range.min, by.min);
    range.max = std::max(range.max, by.max);
}
ValueRange or_zero(const ValueRange& range) { return range.min <= range.max ? range : ValueRange{}; }

BrickId brick_at(const BricksDesc& desc, int level, std::size_t i) {
    const glm::i64vec3 n(desc.levels[std::size_t(level)].bricks);
    const std::int64_t at = std::int64_t(i);
    return {level, glm::ivec3(at % n.x, at / n.x % n.y, at / (n.x * n.y))};
}
std::size_t place_of(const BricksDesc& desc, BrickId id) {
    const glm::i64vec3 n(desc.levels[std::size_t(id.level)].bricks), i(id.index);
    return std::size_t((i.z * n.y + i.y) * n.x + i.x);
}

// A sample of a coarse level as region() delivers it.
double delivered(const TreeDesc& tree, std::int32_t v) {
    const double value = tree.map.value(v);
    const ScalarType type = tree.bricks.volume.type;
    if (type == ScalarType::f64) return value;
    if (type == ScalarType::f32) return double(float(value));
    const auto [lo, hi] = limits_of(type);
    return std::clamp(std::nearbyint(value), lo, hi);
}

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
    for (std::size_t i = 0; i < infos.size(); ++i) {
        const BrickId id = brick_at(desc, 0, i);
        ValueRange range = kNothing;
        for (int part = 0; part < 27; ++part) {
            // A neighbour further up gives its first layer, one further down its last.
            const glm::ivec3 mode(part % 3, part / 3 % 3, part / 9);
            const BrickId other{0, id.index + glm::ivec3(glm::equal(mode, glm::ivec3(1))) -
                                       glm::ivec3(glm::equal(mode, glm::ivec3(2)))};
            if (desc.has(other)) widen(range, parts[place_of(desc, other)].range[std::size_t(part)]);
        }
        infos[i].range = or_zero(range);
    }
}

namespace {

// The error of one level, interpolated linearly, over one brick of level 0.
struct BrickError {
    double squares = 0, largest = 0;
};

class Interpolated {
  public:
    Interpolated(const TreeDesc& tree, const LevelStore& samples, int level)
        : tree_(tree), level_(tree.bricks.levels[std::size_t(level)]), samples_(samples) {}

    BrickError error(const Box& box, std::span<const double> original) const {
        BrickError sum;
        const auto components = std::size_t(tree_.bricks.volume.components);
        std::array<std::vector<Corner>, 3> corners;
        Box around;  // the samples that take part
        for (int a = 0; a < 3; ++a) {
            for (std::int64_t i = box.lo[a]; i < box.hi[a]; ++i) corners[std::size_t(a)].push_back(corner(i, a));
            around.lo[a] = corners[std::size_t(a)].front().first;
            around.hi[a] = std::min(corners[std::size_t(a)].back().first + 2, level_.dims[a]);
            for (Corner& c : corners[std::size_t(a)]) c.first -= around.lo[a];
        }
        const Index3 n = around.dims();
        const auto planes = samples_.read(around);
        std::vector<double> values(around.voxels()), line(static_cast<std::size_t>(n.x));
        for (std::size_t c = 0; c < components; ++c) {
            std::transform(planes[c].begin(), planes[c].end(), values.begin(),
                           [&](std::int32_t v) { return delivered(tree_, v); });
            std::size_t voxel = c;
            for (const Corner& cz : corners[2])
                for (const Corner& cy : corners[1]) {
                    std::fill(line.begin(), line.end(), 0.0);
                    for (int k = 0; k < 4; ++k) {
                        const double w = (k & 1 ? cy.f : 1 - cy.f) * (k & 2 ? cz.f : 1 - cz.f);
                        if (w == 0) continue;
                        const double* row = &values[std::size_t(((cz.first + (k >> 1)) * n.y + cy.first + (k & 1)) * n.x)];
                        for (std::size_t i = 0; i < line.size(); ++i) line[i] += w * row[i];
                    }
                    for (const Corner& cx : corners[0]) {
                        const double truth = original[voxel];
                        voxel += components;
                        if (!std::isfinite(truth)) continue;
                        const auto i = std::size_t(cx.first);
                        const double v = cx.f > 0 ? line[i] * (1 - cx.f) + line[i + 1] * cx.f : line[i];
                        const double e = std::abs(v - truth);
                        sum.squares += e * e;
                        sum.largest = std::max(sum.largest, e);
                    }
                }
        }
        return sum;
    }

  private:
    struct Corner {
        std::int64_t first;
        double f;  // weight of first + 1; 0 at the last sample, which is continued
    };
    Corner corner(std::int64_t fine, int axis) const {
        const std::int64_t stride = level_.stride[axis], first = fine / stride;
        if (first + 1 >= level_.dims[axis]) return {level_.dims[axis] - 1, 0.0};
        return {first, double(fine % stride) / double(stride)};
    }
    const TreeDesc& tree_;
    const LevelDesc& level_;
    const LevelStore& samples_;
};

}  // namespace

void fill_coarse(const TreeDesc& tree, std::span<const LevelStore> decoded, const Volume& volume,
                 std::vector<std::vector<BrickInfo>>& infos, const std::stop_token& stop) {
    const BricksDesc& desc = tree.bricks;
    const int levels = tree.top() + 1;
    for (int l = 1; l < levels; ++l) {
        auto& level = infos[std::size_t(l)];
        const LevelStore& store = decoded[std::size_t(l)];
        parallel_for(0, std::int64_t(level.size()), 8, [&](std::int64_t lo, std::int64_t hi) {
            for (std::int64_t i = lo; i < hi; ++i) {
                const Box own = desc.box_of(brick_at(desc, l, std::size_t(i)));
                const Box box{glm::max(own.lo - Index3(1), Index3(0)), glm::min(own.hi + Index3(1), store.dims())};
                ValueRange range = kNothing;
                for (const auto& plane : store.read(box))
                    for (const std::int32_t v : plane) {
                        const double d = delivered(tree, v);
                        widen(range, {d, d});
                    }
                level[std::size_t(i)].range = or_zero(range);
            }
        }, stop);
    }
    if (levels == 1) return;

    std::vector<BrickError> errors(infos[0].size() * std::size_t(levels));
    parallel_for(0, std::int64_t(infos[0].size()), 1, [&](std::int64_t lo, std::int64_t hi) {
        for (std::int64_t i = lo; i < hi; ++i) {
            check_stop(stop);
            const Box box = desc.box_of(brick_at(desc, 0, std::size_t(i)));
            Buffer voxels(box.voxels() * desc.volume.voxel_bytes(), "brick");
            volume.read(box, voxels.bytes(), stop);
            std::vector<double> original(box.voxels() * std::size_t(desc.volume.components));
            to_double(desc.volume.type, voxels.data(), original.size(), original.data());
            for (int l = 1; l < levels; ++l)
                errors[std::size_t(i) * std::size_t(levels) + std::size_t(l)] =
                    Interpolated(tree, decoded[std::size_t(l)], l).error(box, original);
        }
    }, stop);

    // Added up in the order of bricks, whatever the threads did.
    for (std::size_t i = 0; i < infos[0].size(); ++i) {
        BrickId id = brick_at(desc, 0, i);
        for (int l = 1; l < levels; ++l) {
            const auto octant = std::size_t(desc.octant_of(id));
            id = *desc.coarser(id);
            const BrickError& error = errors[i * std::size_t(levels) + std::size_t(l)];
            BrickInfo& info = infos[std::size_t(l)][place_of(desc, id)];
            info.l2 += error.squares;
            info.octant_l2[octant] += error.squares;
            info.max_error = std::max(info.max_error, error.largest);
        }
    }
    for (int l = 1; l < levels; ++l)
        for (BrickInfo& info : infos[std::size_t(l)]) {
            info.l2 = std::sqrt(info.l2);
            for (double& octant : info.octant_l2) octant = std::sqrt(octant);
            info.exact_error = true;
        }
}

}  // namespace voxloom::wavelet
