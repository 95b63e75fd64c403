#include "plugins/codec-wavelet/tree.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/error.h"
#include "core/data/convert.h"
#include "core/base/byte_io.h"

namespace voxloom::wavelet {

ScalarType tree_type_of(ScalarType type) {
    switch (type) {
        case ScalarType::u8:
        case ScalarType::i8: return ScalarType::i16;
        case ScalarType::u16:
        case ScalarType::i16: return ScalarType::i32;
        case ScalarType::u32:
        case ScalarType::i32: return ScalarType::f64;
        default: return type;
    }
}

namespace {

glm::bvec3 halved_below(const TreeDesc& tree, int level) {
    if (level >= tree.top()) return glm::bvec3(false);
    const auto& levels = tree.bricks.levels;
    return glm::notEqual(levels[std::size_t(level)].stride, levels[std::size_t(level) + 1].stride);
}

// The low band of a transformed box, and back into one.
void take_low(const std::int32_t* box, const Shape& shape, std::int32_t* low) {
    const glm::ivec3 n = shape.low();
    for (int z = 0; z < n.z; ++z)
        for (int y = 0; y < n.y; ++y, low += n.x) std::copy_n(box + shape.at({0, y, z}), n.x, low);
}
void put_low(const std::int32_t* low, const Shape& shape, std::int32_t* box) {
    const glm::ivec3 n = shape.low();
    for (int z = 0; z < n.z; ++z)
        for (int y = 0; y < n.y; ++y, low += n.x) std::copy_n(low, n.x, box + shape.at({0, y, z}));
}

}  // namespace

glm::ivec3 families_of(const TreeDesc& tree, int level) {
    return tree.bricks.levels[std::size_t(std::min(level + 1, tree.top()))].bricks;
}

FamilyId family_of(const TreeDesc& tree, BrickId brick) {
    if (const auto parent = tree.bricks.coarser(brick)) return {brick.level, parent->index};
    return {brick.level, brick.index};
}

Box own_box(const TreeDesc& tree, FamilyId family) {
    const Index3 size = Index3(tree.bricks.brick) * glm::mix(Index3(1), Index3(2), halved_below(tree, family.level));
    const Index3 lo = Index3(family.index) * size;
    return {lo, glm::min(lo + size, tree.bricks.levels[std::size_t(family.level)].dims)};
}

namespace {

Box with_shared_faces(const TreeDesc& tree, int level, Box box) {
    if (tree.faces == Faces::shared) box.hi = glm::min(box.hi + Index3(1), tree.bricks.levels[std::size_t(level)].dims);
    return box;
}

}  // namespace

Box box_of(const TreeDesc& tree, FamilyId family) { return with_shared_faces(tree, family.level, own_box(tree, family)); }

Shape shape_of(const TreeDesc& tree, FamilyId family) {
    const Box own = own_box(tree, family), box = box_of(tree, family);
    Shape shape{glm::ivec3(box.dims()), halved_below(tree, family.level)};
    if (tree.split) shape.split = glm::not_(shape.halved);
    if (tree.faces == Faces::shared) shape.shared = {glm::greaterThan(own.lo, Index3(0)), glm::greaterThan(box.hi, own.hi)};
    return shape;
}

Box stored_box(const TreeDesc& tree, BrickId brick) {
    const Box box = tree.bricks.box_of(brick);
    return brick.level > 0 ? with_shared_faces(tree, brick.level, box) : box;
}

void FamilyCodec::crop(Planes& planes, const Box& from, const Box& to) {
    if (from == to) return;
    const Index3 n = from.dims(), lo = to.lo - from.lo, count = to.dims();
    for (auto& plane : planes) {
        auto end = plane.begin();
        for (std::int64_t z = 0; z < count.z; ++z)
            for (std::int64_t y = 0; y < count.y; ++y)
                end = std::copy_n(plane.begin() + ((lo.z + z) * n.y + lo.y + y) * n.x + lo.x, count.x, end);
        plane.erase(end, plane.end());
    }
}

Details FamilyCodec::details_of(FamilyId family, const std::vector<std::int32_t>& low, std::int32_t* box) const {
    Details d;
    d.shape = shape_of(tree_, family);
    d.q = box;
    d.low = low.data();
    d.finest = family.level == 0;
    set_steps(d, tree_.bricks.levels[std::size_t(family.level)].stride);
    return d;
}

void FamilyCodec::set_steps(Details& d, glm::ivec3 fine_stride) const {
    for (int mask : kBandOrder)
        if (d.shape.has(d.shape.band(mask)) && tree_.quantiser.step > 0)
            d.step[std::size_t(mask)] =
                std::max(1.0, tree_.quantiser.step / band_norm(mask, fine_stride, glm::bvec3(glm::ivec3(d.shape.halved) | glm::ivec3(d.shape.split))));
}

void FamilyCodec::rebuild(Details& d) const {
    dequantise(d, tree_.quantiser);
    put_low(d.low, d.shape, d.q);
}

void FamilyCodec::encode(FamilyId family, const Planes& low, Planes& planes, Bytes& out, After after) const {
    ByteWriter writer(out);
    Bytes part;
    if (family.level == tree_.top()) {
        const LevelDesc& level = tree_.bricks.levels.back();
        for (auto& plane : planes) encode_root(plane, glm::ivec3(level.dims), level.stride, out);
        return;
    }
    restore(family, low, planes, [&](const Details& d) {
        part.clear();
        coder_.encode(d, part);
        writer.block(part);
    }, after);
}

void FamilyCodec::decode(FamilyId family, const Planes& low, ByteReader& in, Planes& planes) const {
    thread_local std::vector<std::int32_t> scratch;
    for (std::size_t c = 0; c < planes.size(); ++c) {
        if (family.level == tree_.top()) {
            const LevelDesc& level = tree_.bricks.levels.back();
            decode_root(planes[c], glm::ivec3(level.dims), level.stride, in);
            continue;
        }
        Details d = details_of(family, low[c], planes[c].data());
        coder_.decode(in.block(), d);
        rebuild(d);
        join_family(d.q, d.shape, tree_.rounding, scratch);
    }
}

void FamilyCodec::encode_root(std::vector<std::int32_t>& plane, glm::ivec3 dims, glm::ivec3 stride, Bytes& out) const {
    ByteWriter writer(out);
    if (dims == glm::ivec3(1)) return writer.number(plane[0]);
    Details d;
    d.shape = {dims, glm::greaterThan(dims, glm::ivec3(1))};
    d.q = plane.data();
    std::vector<std::int32_t> scratch;
    forward(d.q, dims, d.shape.halved, tree_.rounding, scratch);
    const glm::ivec3 n = d.shape.low();
    std::vector<std::int32_t> low(std::size_t(n.x) * std::size_t(n.y) * std::size_t(n.z));
    take_low(d.q, d.shape, low.data());
    encode_root(low, n, stride * glm::mix(glm::ivec3(1), glm::ivec3(2), d.shape.halved), out);
    d.low = low.data();
    set_steps(d, stride);
    quantise(d, tree_.quantiser);
    Bytes part;
    coder_.encode(d, part);
    writer.block(part);
    rebuild(d);
    inverse(d.q, dims, d.shape.halved, tree_.rounding, scratch);
}

void FamilyCodec::decode_root(std::vector<std::int32_t>& plane, glm::ivec3 dims, glm::ivec3 stride, ByteReader& in) const {
    if (dims == glm::ivec3(1)) {
        plane[0] = in.number<std::int32_t>();
        return;
    }
    Details d;
    d.shape = {dims, glm::greaterThan(dims, glm::ivec3(1))};
    d.q = plane.data();
    const glm::ivec3 n = d.shape.low();
    std::vector<std::int32_t> scratch, low(std::size_t(n.x) * std::size_t(n.y) * std::size_t(n.z));
    decode_root(low, n, stride * glm::mix(glm::ivec3(1), glm::ivec3(2), d.shape.halved), in);
    d.low = low.data();
    set_steps(d, stride);
    coder_.decode(in.block(), d);
    rebuild(d);
    inverse(d.q, dims, d.shape.halved, tree_.rounding, scratch);
}

namespace {

// Integers of the tree with `fraction` bits below the unit, halves rounded up.
template <class T>
void unfold(const std::int32_t* from, std::size_t count, std::size_t components, int fraction, std::int32_t lo, std::int32_t hi, T* out) {
    const std::int32_t half = fraction > 0 ? 1 << (fraction - 1) : 0;
    const auto one = [=](std::int32_t v) {
        return T(std::clamp(std::int32_t(std::uint32_t(v) + std::uint32_t(half)) >> fraction, lo, hi));
    };
    if (components == 1)  // apart, for the compiler's sake
        for (std::size_t i = 0; i < count; ++i) out[i] = one(from[i]);
    else
        for (std::size_t i = 0; i < count; ++i) out[i * components] = one(from[i]);
}

// What a voxel can be.
ValueRange limits_of_voxels(const VolumeDesc& volume) {
    const auto [lo, hi] = limits_of(volume.type);
    if (!volume.range) return {lo, hi};
    return {std::max(lo, volume.range->min), std::min(hi, volume.range->max)};
}

}  // namespace

bool FamilyCodec::has_small_integers() const {
    const ScalarType type = tree_.bricks.volume.type;
    return !is_float(type) && bytes_of(type) <= 2 && tree_.map.shift() >= 0;
}

void FamilyCodec::to_voxels(const Planes& planes, std::size_t count, std::byte* out) const {
    const VolumeDesc& volume = tree_.bricks.volume;
    const ValueRange limits = limits_of_voxels(volume);
    const std::size_t components = planes.size();
    if (has_small_integers())  // no way through floating point
        return with_type(volume.type, [&](auto t) {
            for (std::size_t c = 0; c < components; ++c)
                unfold(planes[c].data(), count, components, tree_.map.shift(), std::int32_t(limits.min), std::int32_t(limits.max),
                       reinterpret_cast<decltype(t)*>(out) + c);
        });
    std::vector<double> values(count * components);
    for (std::size_t c = 0; c < components; ++c)
        for (std::size_t i = 0; i < count; ++i)
            values[i * components + c] = std::clamp(tree_.map.value(planes[c][i]), limits.min, limits.max);
    from_double(values.data(), values.size(), volume.type, out);
}

void FamilyCodec::to_brick(const Planes& planes, const Box& box, const Box& part, std::byte* out) const {
    const ValueRange limits = limits_of_voxels(tree_.bricks.volume);
    const int fraction = tree_.map.shift();
    const Index3 n = box.dims(), lo = part.lo - box.lo, count = part.dims();
    const std::size_t components = planes.size(), row = std::size_t(count.x);
    with_type(tree_.bricks.tree_type, [&](auto t) {
        auto* to = reinterpret_cast<decltype(t)*>(out);
        for (std::int64_t z = 0; z < count.z; ++z)
            for (std::int64_t y = 0; y < count.y; ++y, to += row * components)
                for (std::size_t c = 0; c < components; ++c)
                    unfold(planes[c].data() + ((lo.z + z) * n.y + lo.y + y) * n.x + lo.x, row, components, fraction,
                           std::int32_t(limits.min), std::int32_t(limits.max), to + c);
    });
}

}  // namespace voxloom::wavelet
