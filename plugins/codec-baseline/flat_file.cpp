// Brick files: docs/brick-format.md.
#include <cmath>

#include "core/base/mapped_file.h"
#include "core/data/brick_file.h"
#include "plugins/codec-baseline/flat_bricks.h"

namespace voxloom::baseline {

namespace {

void write_info(const BrickInfo& info, ScalarType type, ByteWriter& writer) {
    with_type(type, [&](auto t) {
        using T = decltype(t);
        writer.number(T(info.range.min));
        writer.number(T(info.range.max));
    });
    writer.number(info.l2);
    writer.number(info.max_error);
}

BrickInfo read_info(ScalarType type, std::uint64_t bytes, ByteReader& reader) {
    BrickInfo info;
    with_type(type, [&](auto t) {
        info.range.min = double(reader.number<decltype(t)>());
        info.range.max = double(reader.number<decltype(t)>());
    });
    info.l2 = info.octant_l2[0] = reader.number<double>();
    info.max_error = reader.number<double>();
    info.compressed_bytes = bytes;
    info.exact_error = true;
    if (!(info.range.min <= info.range.max) || !std::isfinite(info.range.extent()) || !(info.l2 >= 0) || !(info.max_error >= 0))
        fail("its statistics are not numbers");
    return info;
}

FlatIndex read_head(std::span<const std::byte> head, std::uint64_t payload) {
    ByteReader reader(head);
    FlatIndex index;
    index.provenance = reader.text();
    const VolumeDesc volume = read_volume_desc(reader);
    glm::ivec3 brick;
    for (int a = 0; a < 3; ++a) brick[a] = reader.number<std::int32_t>();
    index.desc = flat_desc(volume, brick);
    const std::string codec = reader.text();
    index.setting.mode = reader.number<std::uint8_t>();
    index.setting.amount = reader.number<double>();
    index.codec = find_codec(codec);
    if (!index.codec) fail("it was compressed by {}, which this program was built without", codec);
    if (!std::isfinite(index.setting.amount)) fail("its setting is not a number");

    const std::uint64_t count = checked_product(Index3(index.desc.levels[0].bricks), 1, "a grid of bricks");
    // The shortest entry: a length, a checksum, two values and two errors.
    if (count > reader.left() / (1 + 4 + 2 * bytes_of(volume.type) + 16)) fail("its index is too short for its size");
    index.places.resize(std::size_t(count));
    index.infos.resize(std::size_t(count));
    std::uint64_t offset = 0;
    for (std::size_t i = 0; i < count; ++i) {
        BrickPlace& place = index.places[i];
        place.offset = offset;
        place.size = reader.varint();
        place.check = reader.number<std::uint32_t>();
        if (place.size > payload - offset) fail("its index points beyond its end");
        offset += place.size;
        index.infos[i] = read_info(volume.type, place.size, reader);
    }
    if (offset != payload) fail("its index does not cover its data");
    if (reader.left() > 0) fail("its head is longer than it should be");
    return index;
}

}  // namespace

Bytes front_of(const FlatIndex& index, std::uint64_t payload_bytes) {
    Bytes head;
    ByteWriter writer(head);
    writer.text(index.provenance);
    write_volume_desc(index.desc.volume, writer);
    for (int a = 0; a < 3; ++a) writer.number(std::int32_t(index.desc.brick[a]));
    writer.text(index.codec->name);
    writer.number(index.setting.mode);
    writer.number(index.setting.amount);
    for (std::size_t i = 0; i < index.places.size(); ++i) {
        writer.varint(index.places[i].size);
        writer.number(index.places[i].check);
        write_info(index.infos[i], index.desc.volume.type, writer);
    }
    return enclose(kFlatBrickFile, head, payload_bytes);
}

void write_file(const FlatBricks& bricks, const std::filesystem::path& path, const std::stop_token& stop) {
    write_brick_file(path, front_of(bricks.index(), bricks.payload().size()), bricks.payload(), stop);
}

FlatBricksPtr open_bytes(std::span<const std::byte> file, std::shared_ptr<const void> keeper, const std::string& name) {
    try {
        const Envelope envelope = open_envelope(kFlatBrickFile, file);
        FlatIndex index = read_head(envelope.head, envelope.payload.size());
        index.desc.compressed_bytes = file.size();
        return std::make_shared<FlatBricks>(std::move(index), envelope.payload, std::move(keeper), 0);
    } catch (const Error& e) {
        fail("{} is not a brick file that can be read: {}; get the file again", name, e.what());
    }
}

FlatBricksPtr open_file(const std::filesystem::path& path) {
    auto file = std::make_shared<const MappedFile>(path);
    return open_bytes(file->bytes(), file, path.string());
}

}  // namespace voxloom::baseline
