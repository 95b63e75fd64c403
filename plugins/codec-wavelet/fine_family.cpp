#include "plugins/codec-wavelet/fine_family.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/byte_io.h"
#include "core/base/meter.h"
#include "core/data/brick_file.h"
#include "plugins/codec-wavelet/exact_layer.h"
#include "plugins/codec-wavelet/passes.h"
#include "plugins/codec-wavelet/wavelet_bricks.h"

namespace voxloom::wavelet {

void EncodedFamily::add_mask(const Mask& mask, Index3 dims) {
    Bytes part;
    encode_mask(mask, dims, part);
    ByteWriter(bytes).block(part);
}

void EncodedFamily::drop_if_empty() {
    if (bytes.size() <= 6 && std::all_of(bytes.begin(), bytes.end(), [](std::byte b) { return b == std::byte(0); })) bytes.clear();
}

bool keeps_integers(const TreeDesc& tree) { return tree.quantiser.step <= 0 && tree.quantiser.threshold <= 0; }

bool keeps_voxels(const TreeDesc& tree) {
    const VolumeDesc& volume = tree.bricks.volume;
    return keeps_integers(tree) && is_exact(volume.type, *volume.range) && tree.map.step == 1;
}

namespace {

// Distances and patches, after which `near` is what the decoder gives. All arrays are of one family. A bound of 0 means
// every bit. What is not valid (`mask`, if any) may become anything.
std::uint64_t finish_exactly(const TreeDesc& tree, const Buffer& exact, Buffer& near, const Mask& mask, double bound, Bytes& out) {
    const ScalarType type = tree.bricks.volume.type;
    const std::size_t each = bytes_of(type), count = exact.size() / each;
    std::vector<std::uint8_t> patched(count);
    with_type(type, [&](auto t) {
        using T = decltype(t);
        const auto truth = exact.as<T>(), given = static_cast<const Buffer&>(near).as<T>();
        for (std::size_t i = 0; i < count; ++i) {
            patched[i] = std::abs(double(truth[i]) - double(given[i])) > bound;
            if constexpr (std::is_floating_point_v<T>)
                patched[i] = patched[i] || !std::isfinite(truth[i]) || (bound == 0 && std::signbit(truth[i]) != std::signbit(given[i]));
        }
    });
    const auto components = std::size_t(tree.bricks.volume.components);
    const auto valid = [&](std::size_t i) { return mask.empty() || mask[i / components]; };
    for (std::size_t i = 0; i < count; ++i) patched[i] = patched[i] && valid(i);
    ByteWriter writer(out);
    Bytes part;
    if (tree.distances) {
        Buffer wanted(exact.size(), "voxels to encode");
        for (std::size_t i = 0; i < count; ++i)
            std::copy_n((patched[i] || !valid(i) ? near : exact).data() + i * each, each, wanted.data() + i * each);
        encode_distances(type, wanted.data(), near.data(), count, part);
        std::copy_n(wanted.data(), wanted.size(), near.data());
    }
    writer.block(part);
    part.clear();
    encode_patches(type, exact.data(), patched, part);
    writer.bytes(part);
    std::uint64_t patches = 0;
    for (std::size_t i = 0; i < count; ++i)
        if (patched[i]) {
            std::copy_n(exact.data() + i * each, each, near.data() + i * each);
            ++patches;
        }
    return patches;
}

template <class T>
void add_errors(const T* truth, const T* given, const std::uint8_t* valid, std::size_t count, std::size_t components,
                MeasuredBrick& brick) {
    if (std::is_integral_v<T> && sizeof(T) <= 2 && !valid) {
        std::uint64_t squares = 0;
        std::int32_t largest = 0;
        for (std::size_t i = 0; i < count; ++i) {
            const std::int32_t e = std::abs(std::int32_t(truth[i]) - std::int32_t(given[i]));
            squares += std::uint32_t(e) * std::uint32_t(e);
            largest = std::max(largest, e);
        }
        brick.squares += double(squares);
        brick.largest = std::max(brick.largest, double(largest));
        brick.finite += count;
    } else {
        for (std::size_t i = 0; i < count; ++i) {
            if (valid && !valid[i / components]) continue;
            if constexpr (std::is_floating_point_v<T>)
                if (!std::isfinite(truth[i])) continue;
            const double e = std::abs(double(truth[i]) - double(given[i]));
            brick.squares += e * e;
            brick.largest = std::max(brick.largest, e);
            ++brick.finite;
        }
    }
}

}  // namespace

EncodedFamily encode_fine(const FamilyCodec& codec, const TreeDesc& tree, FamilyId family, const VoxelView& original,
                          const FamilyCodec::Planes& low, double bound, const CoarseErrors* coarse) {
    const VolumeDesc& volume = tree.bricks.volume;
    const Box box = own_box(tree, family);  // shared faces are coded, but given out by the neighbour
    const std::size_t count = box.voxels();
    const bool exact = keeps_voxels(tree);
    EncodedFamily result;
    thread_local FamilyCodec::Planes planes;
    const std::int64_t start = thread_cpu_ns();
    integers_of(tree, original, family, planes);
    Buffer near;
    if (volume.has_mask) result.add_mask(mask_of(original, box_of(tree, family)), box_of(tree, family).dims());
    const auto decode = [&](FamilyCodec::Planes& decoded) {
        FamilyCodec::crop(decoded, box_of(tree, family), box);
        near = Buffer(count * volume.voxel_bytes(), "voxels decoded");
        codec.to_voxels(decoded, count, near.data());
    };
    if (keeps_integers(tree)) {
        if (!exact) {
            FamilyCodec::Planes kept = planes;
            decode(kept);
        }
        codec.encode(family, low, planes, result.bytes, FamilyCodec::After::spoiled);
        result.codec_ns = thread_cpu_ns() - start;
    } else {
        codec.encode(family, low, planes, result.bytes);
        result.codec_ns = thread_cpu_ns() - start;
        decode(planes);
    }

    const bool may_patch = is_float(volume.type) || std::isfinite(bound);
    if (tree.distances || (may_patch && !exact)) {
        Buffer truth(count * volume.voxel_bytes(), "voxels to encode");
        copy_box(box, original.data, original.box, truth.data(), box, volume.voxel_bytes());
        result.patches = finish_exactly(tree, truth, near, original.mask ? mask_of(original, box) : Mask(), bound, result.bytes);
    } else {
        ByteWriter(result.bytes).block({});
    }
    result.drop_if_empty();
    result.check = check_of(result.bytes);

    const Mask mask = exact || !original.mask ? Mask() : mask_of(original, box);
    const VoxelView given = exact ? original : VoxelView{box, near.data(), volume.voxel_bytes(), mask.empty() ? nullptr : mask.data()};
    for (const BrickId& id : bricks_of(tree, family)) {
        const Box part = tree.bricks.box_of(id);
        MeasuredBrick brick{id, parts_of(part, given, volume.type, volume.components)};
        const std::size_t row = std::size_t(part.dims().x) * std::size_t(volume.components);
        if (exact && !original.mask) {
            brick.finite = part.voxels() * std::uint64_t(volume.components);
        } else {
            with_type(volume.type, [&](auto t) {
                using T = decltype(t);
                for (std::int64_t z = part.lo.z; z < part.hi.z; ++z)
                    for (std::int64_t y = part.lo.y; y < part.hi.y; ++y)
                        add_errors(reinterpret_cast<const T*>(original.row(part.lo.x, y, z)),
                                   reinterpret_cast<const T*>(given.row(part.lo.x, y, z)), original.mask_row(part.lo.x, y, z), row,
                                   std::size_t(volume.components), brick);
            });
        }
        result.bricks.push_back(std::move(brick));
    }
    if (coarse) coarse->measure(original, family, result.coarse);
    return result;
}

}  // namespace voxloom::wavelet
