#include "plugins/codec-wavelet/file_format.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/base/error.h"
#include "core/base/byte_io.h"
#include "core/data/brick_file.h"
#include "plugins/codec-wavelet/passes.h"
#include "plugins/codec-wavelet/statistics_code.h"

namespace voxloom::wavelet {

namespace {

// --- head --------------------------------------------------------------------------------------------

void write_tree(const TreeIndex& index, ByteWriter& w) {
    const TreeDesc& tree = index.tree;
    write_volume_desc(tree.bricks.volume, w);
    w.number(std::uint8_t(tree.bricks.brick.x));
    w.number(std::uint8_t(tree.bricks.levels.size()));
    for (const LevelDesc& level : tree.bricks.levels)
        for (int a = 0; a < 3; ++a) w.number(std::uint8_t(std::bit_width(unsigned(level.stride[a])) - 1));
    w.number(std::uint8_t(tree.rounding));
    w.number(std::uint8_t(tree.coder));
    w.number(std::uint8_t(tree.split));
    w.number(std::uint8_t(tree.distances));
    w.number(std::uint8_t(tree.faces));
    w.number(std::uint8_t(tree.bricks.volume.has_mask));
    w.number(tree.map.step);
    w.number(tree.map.offset);
    w.number(tree.quantiser.step);
    w.number(tree.quantiser.threshold);
    w.number(tree.quantiser.centre_one);
    w.number(tree.quantiser.centre_more);
    w.text(tree.provenance);
}

TreeDesc read_tree(ByteReader& r, std::uint32_t version) {
    TreeDesc tree;
    VolumeDesc& v = tree.bricks.volume;
    v = read_volume_desc(r);
    tree.bricks.brick = glm::ivec3(r.number<std::uint8_t>());
    const auto levels = r.number<std::uint8_t>();
    const int brick = tree.bricks.brick.x;
    if (brick < 4 || brick > 64 || !std::has_single_bit(unsigned(brick))) fail("its bricks are not 4 to 64 voxels a side");

    tree.bricks.tree_type = tree_type_of(v.type);
    Index3 dims = v.dims;
    glm::ivec3 exponent(0);
    for (int l = 0; l < levels; ++l) {
        LevelDesc level;
        for (int a = 0; a < 3; ++a) {
            const int e = r.number<std::uint8_t>();
            if (e > 30 || e < exponent[a] || e > exponent[a] + (l > 0)) fail("its levels are not a pyramid");
            if (e > exponent[a]) dims[a] = (dims[a] + 1) / 2;
            exponent[a] = e;
            level.stride[a] = 1 << e;
            const std::int64_t n = (dims[a] + brick - 1) / brick;
            if (n > std::int64_t(1) << 30) fail("its grid of bricks is too large");
            level.bricks[a] = std::int32_t(n);
        }
        level.dims = dims;
        if (l > 0 && level.stride == tree.bricks.levels.back().stride) fail("its levels are not a pyramid");
        tree.bricks.levels.push_back(level);
    }
    if (tree.bricks.levels.empty() || (v.voxels() > 0 && tree.bricks.levels.back().bricks != glm::ivec3(1)))
        fail("its levels do not end in one brick");

    const auto rounding = r.number<std::uint8_t>(), coder = r.number<std::uint8_t>();
    tree.split = r.number<std::uint8_t>() != 0;
    tree.distances = r.number<std::uint8_t>() != 0;
    const auto faces = version >= 2 ? r.number<std::uint8_t>() : std::uint8_t(0);
    v.has_mask = version >= 3 && r.number<std::uint8_t>() != 0;
    tree.map.step = r.number<double>();
    tree.map.offset = r.number<double>();
    tree.quantiser.step = r.number<double>();
    tree.quantiser.threshold = r.number<double>();
    tree.quantiser.centre_one = r.number<double>();
    tree.quantiser.centre_more = r.number<double>();
    tree.provenance = r.text();
    if (rounding > 1 || coder >= kCoderKinds || faces > 1) fail("its coder, rounding or faces are not known to this version");
    tree.faces = Faces(faces);
    tree.rounding = Rounding(rounding);
    tree.coder = CoderKind(coder);
    const Quantiser& q = tree.quantiser;
    for (const double x : {tree.map.step, tree.map.offset, q.step, q.threshold, q.centre_one, q.centre_more})
        if (!std::isfinite(x)) fail("its quantiser is not finite");
    if (!(tree.map.step > 0) || q.step < 0 || q.threshold < 0 || std::abs(q.centre_one) > 1 || std::abs(q.centre_more) > 1)
        fail("its quantiser is out of range");
    return tree;
}

std::uint64_t grid_count(glm::ivec3 grid) { return checked_product(Index3(grid), 1, "a grid of bricks"); }

TreeIndex read_head(std::span<const std::byte> head, std::uint64_t payload, std::uint32_t version) {
    ByteReader r(head);
    TreeIndex index;
    index.tree = read_tree(r, version);
    TreeDesc& tree = index.tree;
    index.coder = make_coder(tree.coder, r.block());
    index.families.resize(tree.bricks.levels.size());
    if (tree.empty()) return index;
    std::uint64_t offset = 0;
    for (int l = tree.top(); l >= 0; --l) {
        const std::uint64_t count = grid_count(families_of(tree, l));
        if (count > r.left() / 5) fail("its index is too short for its size");
        auto& families = index.families[std::size_t(l)];
        families.resize(std::size_t(count));
        for (FamilyPlace& place : families) {
            place.offset = offset;
            place.size = r.varint();
            place.check = r.number<std::uint32_t>();
            if (place.size > payload - offset) fail("its index points beyond its end");
            offset += place.size;
        }
    }
    if (offset != payload) fail("its index does not cover its data");
    index.statistics = read_statistics(tree.bricks, r, version);
    if (r.left() > 0) fail("its head is longer than it should be");
    return index;
}

}  // namespace

Bytes head_of(const TreeIndex& index, std::uint64_t payload) {
    Bytes head;
    ByteWriter w(head);
    write_tree(index, w);
    w.block(index.coder->tables());
    if (!index.tree.empty()) {
        for (int l = index.tree.top(); l >= 0; --l)
            for (const FamilyPlace& place : index.families[std::size_t(l)]) {
                w.varint(place.size);
                w.number(place.check);
            }
        write_statistics(index, w);
    }
    return enclose(kWaveletFile, head, payload);
}

std::uint64_t file_bytes(const TreeIndex& index, std::uint64_t payload) { return head_of(index, payload).size() + payload; }

void write_file(const WaveletBricks& bricks, const std::filesystem::path& path, const std::stop_token& stop) {
    write_brick_file(path, head_of(bricks.index(), bricks.payload().size()), bricks.payload(), stop,
                     [&](std::size_t at, std::size_t bytes) { bricks.forget(at, bytes); });
}

namespace {

std::shared_ptr<const WaveletBricks> open(std::span<const std::byte> bytes, std::shared_ptr<const void> keeper,
                                          const MappedFile* file, const std::string& name) {
    try {
        const Envelope envelope = open_envelope(kWaveletFile, bytes);
        TreeIndex index = read_head(envelope.head, envelope.payload.size(), envelope.version);
        index.tree.bricks.compressed_bytes = bytes.size();
        return std::make_shared<WaveletBricks>(
            std::move(index), Payload{envelope.payload, std::move(keeper), 0, file, bytes.size() - envelope.payload.size()});
    } catch (const Error& e) {
        fail("{} is not a wavelet file that can be read: {}; get the file again", name, e.what());
    }
}

}  // namespace

std::shared_ptr<const WaveletBricks> open_bytes(std::span<const std::byte> bytes, std::shared_ptr<const void> keeper,
                                                const std::string& name) {
    return open(bytes, std::move(keeper), nullptr, name);
}

std::shared_ptr<const WaveletBricks> open_file(const std::filesystem::path& path) {
    const auto file = std::make_shared<const MappedFile>(path);
    return open(file->bytes(), file, file.get(), path.string());
}

}  // namespace voxloom::wavelet
