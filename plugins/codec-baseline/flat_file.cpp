// Brick files: docs/brick-format.md.
#include <cmath>

#include "core/base/mapped_file.h"
#include "core/data/brick_file.h"
#include "plugins/codec-baseline/flat_bricks.h"

namespace voxloom::baseline {

namespace {

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

    index.bricks = read_brick_index(index.desc, payload, reader);
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
    write_brick_index(index.bricks, index.desc.volume.type, writer);
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
