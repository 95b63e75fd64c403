#include "plugins/codec-wavelet/wavelet_bricks.h"

#include <algorithm>
#include <cassert>

#include "core/base/byte_io.h"
#include "core/base/error.h"
#include "core/data/brick_file.h"
#include "core/data/convert.h"
#include "plugins/codec-wavelet/exact_layer.h"
#include "plugins/codec-wavelet/mask_layer.h"
#include "plugins/codec-wavelet/passes.h"

namespace voxloom::wavelet {

namespace {

std::size_t place_in(glm::ivec3 grid, glm::ivec3 i) {
    return (std::size_t(i.z) * std::size_t(grid.y) + std::size_t(i.y)) * std::size_t(grid.x) + std::size_t(i.x);
}

// The parent's integers, a plane for each component.
FamilyCodec::Planes parent_planes(const TreeDesc& tree, const BrickVoxels& parent) {
    const auto components = std::size_t(tree.bricks.volume.components);
    const std::size_t count = Box::of(parent.stored).voxels();
    FamilyCodec::Planes planes(components, std::vector<std::int32_t>(count));
    auto spread = [&](auto values) {
        for (std::size_t c = 0; c < components; ++c)
            for (std::size_t i = 0; i < count; ++i) planes[c][i] = std::int32_t(values[i * components + c]);
    };
    if (tree.has_state())
        spread(parent.decoder_state.as<std::int32_t>());
    else if (tree.bricks.tree_type == ScalarType::i16)
        spread(parent.voxels.as<std::int16_t>());
    else
        spread(parent.voxels.as<std::int32_t>());
    return planes;
}

template <class T>
Buffer interleaved(const FamilyCodec::Planes& planes, std::size_t count) {
    Buffer out(count * planes.size() * sizeof(T), "brick");
    T* to = out.as<T>().data();
    for (std::size_t c = 0; c < planes.size(); ++c)
        for (std::size_t i = 0; i < count; ++i) to[i * planes.size() + c] = T(planes[c][i]);
    return out;
}

// The family's voxels in tree_type.
Buffer tree_voxels(const TreeDesc& tree, const FamilyCodec::Planes& planes, std::size_t count) {
    if (!tree.has_state())
        return tree.bricks.tree_type == ScalarType::i16 ? interleaved<std::int16_t>(planes, count)
                                                        : interleaved<std::int32_t>(planes, count);
    std::vector<double> values(count * planes.size());
    for (std::size_t c = 0; c < planes.size(); ++c)
        for (std::size_t i = 0; i < count; ++i) values[i * planes.size() + c] = tree.map.value(planes[c][i]);
    Buffer out(values.size() * bytes_of(tree.bricks.tree_type), "brick");
    from_double(values.data(), values.size(), tree.bricks.tree_type, out.data());
    return out;
}

}  // namespace

WaveletBricks::WaveletBricks(TreeIndex index, Payload payload)
    : Bricks(index.tree.bricks), index_(std::move(index)), payload_(std::move(payload)) {}

std::uint64_t WaveletBricks::resident_bytes() const {
    std::uint64_t sum = payload_.resident;
    for (const auto& families : index_.families) sum += families.size() * sizeof(FamilyPlace);
    for (const auto& infos : index_.infos) sum += infos.size() * sizeof(BrickInfo);
    for (const auto& codes : index_.statistics.levels) sum += codes.size() * sizeof(BrickCodes);
    return sum;
}

std::size_t TreeIndex::bricks_of_level(int level) const {
    return Box::of(Index3(tree.bricks.levels[std::size_t(level)].bricks)).voxels();
}

// A family's bytes count for its bricks in equal parts.
BrickInfo TreeIndex::info(int level, std::size_t brick) const {
    if (!infos.empty()) return infos[std::size_t(level)][brick];
    BrickInfo info = statistics.info(level, brick);
    const glm::i64vec3 n(tree.bricks.levels[std::size_t(level)].bricks);
    const auto i = std::int64_t(brick);
    const BrickId id{level, glm::ivec3(i % n.x, i / n.x % n.y, i / (n.x * n.y))};
    const FamilyId family = family_of(tree, id);
    const std::vector<BrickId> bricks = bricks_of(tree, family);
    const auto place = std::size_t(std::ranges::find(bricks, id) - bricks.begin());
    const std::uint64_t all = families[std::size_t(level)][place_in(families_of(tree, level), family.index)].size;
    info.compressed_bytes = share_of(all, place, bricks.size());
    return info;
}

BrickInfo WaveletBricks::info(BrickId id) const {
    assert(desc().has(id));
    return index_.info(id.level, place_in(desc().levels[std::size_t(id.level)].bricks, id.index));
}

std::uint64_t WaveletBricks::family_bytes(BrickId id) const {
    const FamilyId family = family_of(index_.tree, id);
    std::uint64_t voxels = 0;
    for (const BrickId& brick : bricks_of(index_.tree, family)) voxels += stored_box(index_.tree, brick).voxels();
    const bool state = index_.tree.has_state() && id.level > 0;
    return voxels * (desc().tree_voxel_bytes() + (state ? sizeof(std::int32_t) * std::uint64_t(desc().volume.components) : 0));
}

namespace {

const Bytes kNothing(64);
bool is_nothing(std::span<const std::byte> bytes) { return bytes.data() == kNothing.data(); }

[[noreturn]] void fail_damaged(BrickId id, const Error& e) {
    fail("the compressed data of brick {} {} {} of level {} is damaged ({}); get the file again", id.index.x, id.index.y,
         id.index.z, id.level, e.what());
}

}  // namespace

std::span<const std::byte> WaveletBricks::family_stream(BrickId id) const {
    const glm::ivec3 grid = families_of(index_.tree, id.level);
    const FamilyPlace& place = index_.families[std::size_t(id.level)][place_in(grid, family_of(index_.tree, id).index)];
    const auto bytes = payload_.bytes.subspan(std::size_t(place.offset), std::size_t(place.size));
    if (check_of(bytes) != place.check) fail("its checksum is wrong");
    return bytes.empty() ? std::span<const std::byte>(kNothing) : bytes;
}

void WaveletBricks::read_mask(int level, const Box& box, std::span<std::uint8_t> out) const {
    if (box.empty()) return;
    const TreeDesc& tree = index_.tree;
    const Index3 brick(desc().brick);
    const FamilyId first = family_of(tree, {level, glm::ivec3(box.lo / brick)});
    const FamilyId last = family_of(tree, {level, glm::ivec3((box.hi - Index3(1)) / brick)});
    for (int z = first.index.z; z <= last.index.z; ++z)
        for (int y = first.index.y; y <= last.index.y; ++y)
            for (int x = first.index.x; x <= last.index.x; ++x) {
                const FamilyId family{level, {x, y, z}};
                const BrickId id = bricks_of(tree, family).front();
                const Box coded = box_of(tree, family);
                try {
                    const Mask mask = decode_mask(ByteReader(family_stream(id)).block(), coded.dims());
                    copy_box(intersect(own_box(tree, family), box), reinterpret_cast<const std::byte*>(mask.data()), coded,
                             reinterpret_cast<std::byte*>(out.data()), box, 1);
                } catch (const Error& e) {
                    fail_damaged(id, e);
                }
            }
}

std::vector<DecodedBrick> WaveletBricks::refine(BrickId id, const BrickVoxels* parent, const std::stop_token& stop) const {
    check_stop(stop);
    const TreeDesc& tree = index_.tree;
    const VolumeDesc& volume = tree.bricks.volume;
    const FamilyId family = family_of(tree, id);
    const Box box = box_of(tree, family), own = own_box(tree, family);
    const std::size_t count = box.voxels(), components = std::size_t(volume.components);
    const FamilyCodec codec(tree, *index_.coder);

    // Large blocks are expensive to get anew for every family, so each thread keeps its own.
    thread_local FamilyCodec::Planes planes;
    thread_local Bytes fine;
    planes.resize(components);
    for (auto& plane : planes) plane.resize(count);
    Buffer voxels;       // above level 0
    bool plain = false;  // at level 0: the planes are all there is to the voxels
    try {
        FamilyCodec::Planes low;
        if (parent) low = parent_planes(tree, *parent);
        const auto bytes = family_stream(id);
        ByteReader in(bytes);
        if (volume.has_mask) in.block();
        codec.decode(family, low, in, planes);
        if (id.level == 0) {
            std::span<const std::byte> distances, patches;
            if (in.left() > 0 && !is_nothing(bytes)) {
                distances = in.block();
                patches = in.bytes(in.left());
            }
            plain = codec.has_small_integers() && distances.empty() && patches.empty();
            if (!plain) {
                FamilyCodec::crop(planes, box, own);
                fine.resize(own.voxels() * volume.voxel_bytes());
                codec.to_voxels(planes, own.voxels(), fine.data());
                decode_distances(volume.type, distances, fine.data(), own.voxels() * components);
                decode_patches(volume.type, patches, fine.data(), own.voxels() * components);
            }
        } else {
            voxels = tree_voxels(tree, planes, count);
        }
    } catch (const Error& e) {
        fail_damaged(id, e);
    }

    Buffer state;
    if (tree.has_state() && id.level > 0) state = interleaved<std::int32_t>(planes, count);
    std::vector<DecodedBrick> bricks;
    for (const BrickId& child : bricks_of(index_.tree, family)) {
        auto brick = std::make_shared<BrickVoxels>();
        const Box part = stored_box(tree, child);
        brick->stored = part.dims();
        brick->voxels = Buffer(part.voxels() * desc().tree_voxel_bytes(), "brick");
        if (plain)
            codec.to_brick(planes, box, part, brick->voxels.data());
        else if (id.level == 0)
            convert_box(part, volume.type, fine.data(), own, desc().tree_type, brick->voxels.data(), part, volume.components);
        else
            copy_box(part, voxels.data(), box, brick->voxels.data(), part, desc().tree_voxel_bytes());
        if (state.size() > 0) {
            const std::size_t each = components * sizeof(std::int32_t);
            brick->decoder_state = Buffer(part.voxels() * each, "brick");
            copy_box(part, state.data(), box, brick->decoder_state.data(), part, each);
        }
        bricks.push_back({child, std::move(brick)});
    }
    return bricks;
}

}  // namespace voxloom::wavelet
