#include "plugins/render-slicer/brick_texels.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "plugins/render-slicer/voxels.h"

namespace voxloom::slicer {

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

std::size_t voxels_in(glm::ivec3 n) { return std::size_t(n.x) * std::size_t(n.y) * std::size_t(n.z); }
std::size_t index_in(glm::ivec3 n, int x, int y, int z) {
    return (std::size_t(z) * std::size_t(n.y) + std::size_t(y)) * std::size_t(n.x) + std::size_t(x);
}

// Validity of a box that may reach outside of the level, where the border is replicated.
void read_mask_around(const Bricks& bricks, int level, const Box& box, std::span<std::uint8_t> out) {
    const Index3 last = bricks.desc().levels[std::size_t(level)].dims - Index3(1);
    const Box shown{glm::clamp(box.lo, Index3(0), last), glm::clamp(box.hi - Index3(1), Index3(0), last) + Index3(1)};
    std::vector<std::uint8_t> inside(shown.voxels());
    bricks.read_mask(level, shown, inside);
    const Index3 n = shown.dims();
    std::size_t i = 0;
    for (std::int64_t z = box.lo.z; z < box.hi.z; ++z)
        for (std::int64_t y = box.lo.y; y < box.hi.y; ++y)
            for (std::int64_t x = box.lo.x; x < box.hi.x; ++x) {
                const Index3 p = glm::clamp(Index3(x, y, z), shown.lo, shown.hi - Index3(1)) - shown.lo;
                out[i++] = inside[std::size_t((p.z * n.y + p.y) * n.x + p.x)];
            }
}

// A box of a level's voxels, which may reach outside of it.
struct Decoded {
    Decoded(const BricksPtr& bricks, int level, const Box& box, const std::stop_token& stop)
        : volume(decode(bricks, level, box, stop)), mask(volume.desc().has_mask ? box.voxels() : 0) {
        if (volume.desc().has_mask) volume.read_mask(Box::of(volume.desc().dims), mask);
    }
    glm::ivec3 dims() const { return glm::ivec3(volume.desc().dims); }

    DenseVolume volume;
    std::vector<std::uint8_t> mask;  // empty: all are valid

  private:
    static DenseVolume decode(const BricksPtr& bricks, int level, const Box& box, const std::stop_token& stop) {
        VolumeDesc desc = bricks->desc().volume;
        desc.dims = box.dims();
        Buffer voxels(box.voxels() * desc.voxel_bytes(), "brick");
        read_region(bricks, level, box, voxels.bytes(), BrickCache::global(), stop);
        Buffer valid(desc.has_mask ? box.voxels() : 0, "mask");
        if (desc.has_mask) read_mask_around(*bricks, level, box, valid.as<std::uint8_t>());
        return DenseVolume(desc, std::move(voxels), std::move(valid));
    }
};

// Texels of the voxels [first, first + side); true where one is not finite.
bool write_texels(const Decoded& voxels, glm::ivec3 first, glm::ivec3 side, const Texels& texels, const TexelRows& out) {
    const gpu::TexelLayout& layout = texels.layout;
    const VolumeDesc& desc = voxels.volume.desc();
    const glm::ivec3 n = voxels.dims();
    const std::size_t row = std::size_t(side.x);
    bool invalid = false;
    std::byte* values = out.values;
    for (int z = 0; z < side.z; ++z)
        for (int y = 0; y < side.y; ++y, values += row * layout.bytes()) {
            const std::size_t from = index_in(n, first.x, y + first.y, z + first.z);
            invalid = gpu::to_texels(voxels.volume.data() + from * desc.voxel_bytes(), voxels.mask.empty() ? nullptr : voxels.mask.data() + from,
                                     desc, layout, 0, row, values) || invalid;
        }
    // Slice by slice, of which the box takes its part.
    std::vector<glm::vec4> slice(out.gradients || out.colours ? std::size_t(n.x) * std::size_t(n.y) : 0);
    auto for_each_texel = [&](const auto& compute, const auto& store) {
        for (int z = 0; z < side.z; ++z) {
            compute(z + first.z, slice.data());
            for (int y = 0; y < side.y; ++y)
                for (int x = 0; x < side.x; ++x) store(index_in(side, x, y, z), slice[index_in(n, x + first.x, y + first.y, 0)]);
        }
    };
    if (out.gradients) {
        const Gradients gradients(voxels.volume, layout.from, layout.offset, layout.scale, *texels.gradient_side);
        for_each_texel([&](int z, glm::vec4* g) { gradients.slice(z, g); },
                       [&](std::size_t i, glm::vec4 g) {
                           for (int c = 0; c < 4; ++c)
                               out.gradients[4 * i + std::size_t(c)] = std::int16_t(std::lrint(std::clamp(g[c] / texels.gradient_scale, -1.0f, 1.0f) * 32767.0f));
                       });
    }
    if (out.colours)
        for_each_texel([&](int z, glm::vec4* e) { classify_slice(voxels.volume, layout.from, texels.transfer->one, texels.slab, z, e); },
                       [&](std::size_t i, glm::vec4 e) { out.colours[i] = e; });
    return invalid;
}

const glm::vec2 kNothing(kInfinity, -kInfinity);
void widen(glm::vec2& range, glm::vec2 by) { range = {std::min(range.x, by.x), std::max(range.y, by.y)}; }

// Calls use(range_of), where range_of(i) is voxel i's value as a range, rounded outwards, or nothing where that is
// not valid.
template <class Use>
void with_values(const Decoded& voxels, int from, const Use& use) {
    const VolumeDesc& desc = voxels.volume.desc();
    with_type(desc.type, [&](auto t) {
        using T = decltype(t);
        const T* const v = reinterpret_cast<const T*>(voxels.volume.data());
        const bool color = desc.color;
        const std::size_t c = std::size_t(desc.components);
        use([&voxels, v, c, color, from](std::size_t i) {
            const T* p = v + i * c;
            if (!voxels.mask.empty() && !voxels.mask[i]) return kNothing;
            if constexpr (sizeof(T) <= 2 || std::is_same_v<T, float>)
                if (!color) return std::isfinite(float(p[from])) ? glm::vec2(float(p[from])) : kNothing;
            const double value = color ? 0.2126 * double(p[0]) + 0.7152 * double(p[1]) + 0.0722 * double(p[2]) : double(p[from]);
            if (!std::isfinite(value)) return kNothing;
            const float f = float(value);
            return glm::vec2(double(f) > value ? std::nextafter(f, -kInfinity) : f, double(f) < value ? std::nextafter(f, kInfinity) : f);
        });
    });
}

// kReach is of level 0; one voxel of it is what cubic kernels take of any level.
glm::ivec3 reach_of(const BricksDesc& desc, int level) {
    return (kReach - 2 + desc.levels[std::size_t(level)].stride) / desc.levels[std::size_t(level)].stride + 1;
}

// Along one axis, the voxels [first, first + count) that matter to each block.
struct Window {
    int first, count;
};
using Windows = std::array<std::vector<Window>, 3>;

// What lies in the windows of each block: along x, then of what that gives along y, then along z.
std::vector<glm::vec2> ranges_in(const Decoded& voxels, int from, const Windows& windows) {
    glm::ivec3 n = voxels.dims();
    const glm::ivec3 first_n(int(windows[0].size()), n.y, n.z);
    std::vector<glm::vec2> ranges(voxels_in(first_n), kNothing);
    with_values(voxels, from, [&](const auto& range_of) {
        std::vector<glm::vec2> row(std::size_t(n.x));
        for (int z = 0; z < n.z; ++z)
            for (int y = 0; y < n.y; ++y) {
                for (int x = 0; x < n.x; ++x) row[std::size_t(x)] = range_of(index_in(n, x, y, z));
                for (int b = 0; b < first_n.x; ++b) {
                    const Window& window = windows[0][std::size_t(b)];
                    glm::vec2& out = ranges[index_in(first_n, b, y, z)];
                    for (int x = window.first; x < window.first + window.count; ++x) widen(out, row[std::size_t(x)]);
                }
            }
    });
    n = first_n;
    for (int axis = 1; axis < 3; ++axis) {
        const std::vector<Window>& along = windows[std::size_t(axis)];
        glm::ivec3 fewer = n;
        fewer[axis] = int(along.size());
        const std::size_t stride = index_in(n, 0, axis == 1, axis == 2);
        std::vector<glm::vec2> joined(voxels_in(fewer), kNothing);
        for (int z = 0; z < fewer.z; ++z)
            for (int y = 0; y < fewer.y; ++y)
                for (int x = 0; x < fewer.x; ++x) {
                    glm::ivec3 at(x, y, z);
                    const Window& window = along[std::size_t(at[axis])];
                    at[axis] = window.first;
                    const glm::vec2* r = ranges.data() + index_in(n, at.x, at.y, at.z);
                    glm::vec2& out = joined[index_in(fewer, x, y, z)];
                    for (int i = 0; i < window.count; ++i, r += stride) widen(out, *r);
                }
        ranges = std::move(joined);
        n = fewer;
    }
    return ranges;
}

std::int64_t floor_divided(std::int64_t a, std::int64_t b) { return (a >= 0 ? a : a - b + 1) / b; }

// What is interpolated within `reach` of the blocks of a brick comes from these voxels of a level that is `ratio` times
// as coarse; the brick begins at `first` of its own level, `box` is what there is of theirs.
Windows windows_of_blocks(Index3 first, glm::ivec3 block, glm::ivec3 blocks, glm::ivec3 reach, glm::ivec3 ratio, const Box& box) {
    Windows windows;
    for (int a = 0; a < 3; ++a)
        for (int b = 0; b < blocks[a]; ++b) {
            const std::int64_t lo = first[a] + b * block[a] - reach[a], hi = lo + block[a] + 2 * reach[a];
            const std::int64_t from = std::max(floor_divided(lo, ratio[a]), box.lo[a]);
            const std::int64_t end = std::min(1 - floor_divided(-hi, ratio[a]), box.hi[a]);
            windows[std::size_t(a)].push_back({int(from - box.lo[a]), int(end - from)});
        }
    return windows;
}

// --- mixing in the parent ------------------------------------------------------------------------

// One axis of a brick's texels: between which two of the parent's they lie, how far, and where in the brick that
// they are of, which is the one before it where `before`.
struct Mixed {
    int low;
    float way, along;  // 0..1
    int before;
};
struct Mixing {
    glm::ivec3 side, parent_dims;
    std::array<std::vector<Mixed>, 3> axes;
    const std::array<CornerBlend, 8>& blends;

    // What mixes into `own` at every texel, of `channels`; the parent's times `scale`.
    template <class T>
    void apply(T* own, const T* parent, int channels, glm::vec4 scale = glm::vec4(1.0f)) const {
        for (int z = 0; z < side.z; ++z)
            for (int y = 0; y < side.y; ++y)
                for (int x = 0; x < side.x; ++x, own += channels) {
                    const Mixed &i = axes[0][std::size_t(x)], &j = axes[1][std::size_t(y)], &k = axes[2][std::size_t(z)];
                    const CornerBlend& corners = blends[std::size_t(i.before | j.before << 1 | k.before << 2)];
                    const float share = trilinear([&](int c) { return corners[std::size_t(c)]; }, i.along, j.along, k.along);
                    if (share == 0) continue;
                    for (int c = 0; c < channels; ++c) {
                        const float coarse = trilinear(
                            [&](int o) {
                                return float(parent[index_in(parent_dims, i.low + (o & 1), j.low + (o >> 1 & 1), k.low + (o >> 2)) *
                                                        std::size_t(channels) + std::size_t(c)]);
                            },
                            i.way, j.way, k.way);
                        const float mixed = (1 - share) * float(own[c]) + share * coarse * scale[c];
                        if constexpr (std::is_integral_v<T>)
                            own[c] = T(std::lrint(mixed));
                        else
                            own[c] = mixed;
                    }
                }
    }

    template <class F>
    static float trilinear(const F& at, float x, float y, float z) {
        auto row = [&](int o) { return (1 - x) * at(o) + x * at(o + 1); };
        auto layer = [&](int o) { return (1 - y) * row(o) + y * row(o + 2); };
        return (1 - z) * layer(0) + z * layer(4);
    }
};

bool mix_parent_in(const BricksPtr& bricks, BrickId brick, const std::array<CornerBlend, 8>& blends, const Texels& texels,
                   Apron apron, glm::ivec3 block, const TexelRows& out, FilledBrick& filled, const std::stop_token& stop) {
    const BricksDesc& desc = bricks->desc();
    const BrickId parent = *desc.coarser(brick);
    const glm::ivec3 ratio = desc.levels[std::size_t(parent.level)].stride / desc.levels[std::size_t(brick.level)].stride;
    const Index3 first = Index3(brick.index) * Index3(desc.brick);
    Mixing mixing{.side = desc.brick + apron.below + apron.above, .parent_dims = {}, .axes = {}, .blends = blends};
    Box box;  // of the parent's level
    for (int a = 0; a < 3; ++a) {
        const std::int64_t lo = first[a] - apron.below, hi = lo + mixing.side[a];
        box.lo[a] = floor_divided(lo, ratio[a]);
        box.hi[a] = floor_divided(hi - 1, ratio[a]) + 2;
        for (std::int64_t v = lo; v < hi; ++v) {
            const std::int64_t low = floor_divided(v, ratio[a]);
            const bool before = v < first[a];
            const std::int64_t in_brick = std::min<std::int64_t>(v - first[a] + before * desc.brick[a], desc.brick[a]);
            mixing.axes[std::size_t(a)].push_back({int(low - box.lo[a]), float(v - low * ratio[a]) / float(ratio[a]),
                                                   float(in_brick) / float(desc.brick[a]), before});
        }
    }
    const Box around{box.lo - Index3(kAround), box.hi + Index3(kAround)};
    const Decoded voxels(bricks, parent.level, around, stop);
    mixing.parent_dims = glm::ivec3(box.dims());
    const std::size_t count = box.voxels();
    Buffer values(count * texels.layout.bytes(), "brick"), gradients(out.gradients ? count * 8 : 0, "brick"), colours(out.colours ? count * 16 : 0, "brick");
    const TexelRows rows{values.data(), out.gradients ? gradients.as<std::int16_t>().data() : nullptr,
                         out.colours ? colours.as<glm::vec4>().data() : nullptr};
    const bool invalid = write_texels(voxels, glm::ivec3(kAround), mixing.parent_dims, texels, rows);
    const int channels = texels.layout.channels;
    if (texels.layout.wide)
        mixing.apply(reinterpret_cast<float*>(out.values), reinterpret_cast<const float*>(rows.values), channels);
    else
        mixing.apply(reinterpret_cast<std::uint16_t*>(out.values), reinterpret_cast<const std::uint16_t*>(rows.values), channels);
    if (out.gradients) mixing.apply(out.gradients, rows.gradients, 4, glm::vec4(1.0f / glm::vec3(ratio), 1.0f));  // per step of the brick's level
    if (out.colours) mixing.apply(&out.colours->x, &rows.colours->x, 4);

    const Windows windows = windows_of_blocks(first, block, desc.brick / block, reach_of(desc, brick.level), ratio, around);
    const std::vector<glm::vec2> coarse = ranges_in(voxels, texels.layout.from, windows);
    for (std::size_t i = 0; i < coarse.size(); ++i) widen(filled.ranges[i], coarse[i]);
    return invalid;
}

}  // namespace

CornerBlend continued(const CornerBlend& blend, int neighbour) {
    CornerBlend out;
    for (std::size_t c = 0; c < 8; ++c) out[c] = blend[c & ~std::size_t(neighbour)];
    return out;
}

FilledBrick fill_texels(const BricksPtr& bricks, BrickId brick, const std::array<CornerBlend, 8>& blends, const Texels& texels,
                        Apron apron, glm::ivec3 block, const TexelRows& out, const std::stop_token& stop) {
    const glm::ivec3 size = bricks->desc().brick;
    const Index3 first = Index3(brick.index) * Index3(size);
    const Box around{first - Index3(kAround), first + Index3(size) + Index3(kAround)};
    const Decoded voxels(bricks, brick.level, around, stop);
    FilledBrick filled;
    filled.found_invalid = write_texels(voxels, glm::ivec3(kAround - apron.below), size + apron.below + apron.above, texels, out);
    filled.ranges = ranges_in(voxels, texels.layout.from, windows_of_blocks(first, block, size / block, reach_of(bricks->desc(), brick.level),
                                                                            glm::ivec3(1), around));
    if (blends != std::array<CornerBlend, 8>{} && mix_parent_in(bricks, brick, blends, texels, apron, block, out, filled, stop))
        filled.found_invalid = true;
    return filled;
}

}  // namespace voxloom::slicer
