#include "core/data/brick_file.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "core/base/hash.h"
#include "core/base/mapped_file.h"
#include "core/base/output_file.h"

namespace voxloom {

namespace {

constexpr std::uint32_t kEndian = 0x01020304;
constexpr std::size_t kHashed = 8 + 4 + 4 + 8 + 8, kPreamble = kHashed + 8;

std::uint64_t hash_of(std::span<const std::byte> preamble, std::span<const std::byte> head) {
    Hasher hasher;
    hasher.bytes(preamble.first(kHashed));
    hasher.bytes(head);
    return hasher.finish().lo;
}

}  // namespace

std::uint32_t check_of(std::span<const std::byte> bytes) { return std::uint32_t(hash_bytes(bytes).lo); }

Bytes enclose(const BrickFileKind& kind, std::span<const std::byte> head, std::uint64_t payload_bytes) {
    assert(kind.magic.size() == 8);
    Bytes front;
    ByteWriter writer(front);
    writer.bytes(std::as_bytes(std::span(kind.magic)));
    writer.number(kind.version);
    writer.number(kEndian);
    writer.number(std::uint64_t(head.size()));
    writer.number(payload_bytes);
    writer.number(hash_of(front, head));
    writer.bytes(head);
    return front;
}

Envelope open_envelope(const BrickFileKind& kind, std::span<const std::byte> file) {
    if (file.size() < kPreamble || !std::ranges::equal(file.first(8), std::as_bytes(std::span(kind.magic))))
        fail("it does not begin like one");
    ByteReader reader(file.subspan(8));
    const auto version = reader.number<std::uint32_t>(), endian = reader.number<std::uint32_t>();
    if (endian != kEndian) fail("its byte order is not this machine's");
    if (version < kind.oldest || version > kind.version)
        fail("it has version {}, and versions {} to {} are known", version, kind.oldest, kind.version);
    const auto head = reader.number<std::uint64_t>(), payload = reader.number<std::uint64_t>();
    const auto hash = reader.number<std::uint64_t>();
    if (head > reader.left() || payload != reader.left() - head)
        fail("it should have {} bytes of head and {} of data, and has {} of both", head, payload, reader.left());
    Envelope envelope;
    envelope.version = version;
    envelope.head = reader.bytes(head);
    envelope.payload = reader.bytes(payload);
    if (hash_of(file, envelope.head) != hash) fail("its head's checksum is wrong");
    return envelope;
}

void write_brick_file(const std::filesystem::path& path, std::span<const std::byte> front,
                      std::span<const std::byte> payload, const std::stop_token& stop,
                      const std::function<void(std::size_t, std::size_t)>& written) {
    constexpr std::size_t most = 8 << 20;
    OutputFile file(path);
    file.write(front);
    for (std::size_t at = 0; at < payload.size(); at += most) {
        check_stop(stop);
        const auto part = payload.subspan(at, std::min(payload.size() - at, most));
        file.write(part);
        if (written) written(at, part.size());
    }
    check_stop(stop);
    file.commit();
}

void write_volume_desc(const VolumeDesc& volume, ByteWriter& writer) {
    for (int a = 0; a < 3; ++a) writer.number(volume.dims[a]);
    for (int column = 0; column < 4; ++column)
        for (int row = 0; row < 4; ++row) writer.number(volume.index_to_world[column][row]);
    writer.text(volume.unit);
    writer.text(volume.name);
    writer.number(std::uint8_t(volume.type));
    writer.number(std::uint8_t(volume.components));
    writer.number(std::uint8_t(volume.color));
    writer.number(std::uint8_t(volume.significant_bits));
    writer.number(volume.range ? volume.range->min : 0.0);
    writer.number(volume.range ? volume.range->max : 0.0);
}

VolumeDesc read_volume_desc(ByteReader& reader) {
    VolumeDesc volume;
    for (int a = 0; a < 3; ++a) volume.dims[a] = reader.number<std::int64_t>();
    for (int column = 0; column < 4; ++column)
        for (int row = 0; row < 4; ++row) volume.index_to_world[column][row] = reader.number<double>();
    volume.unit = reader.text();
    volume.name = reader.text();
    const auto type = reader.number<std::uint8_t>();
    volume.components = reader.number<std::uint8_t>();
    volume.color = reader.number<std::uint8_t>() != 0;
    volume.significant_bits = reader.number<std::uint8_t>();
    const auto lo = reader.number<double>(), hi = reader.number<double>();
    volume.range = ValueRange{lo, hi};
    if (type >= kScalarTypes || volume.components < 1 || volume.components > 4 || volume.significant_bits > 64)
        fail("its voxel type is not one");
    volume.type = ScalarType(type);
    if (glm::any(glm::lessThan(volume.dims, Index3(0)))) fail("its size is negative");
    (void)volume.dense_bytes();
    const auto [least, most] = limits_of(volume.type);
    if (!(lo <= hi) || !std::isfinite(lo) || !std::isfinite(hi) || lo < least || hi > most)
        fail("its value range is not one");
    return volume;
}

std::optional<std::string> provenance_of(const std::filesystem::path& path) {
    try {
        const MappedFile file(path);
        ByteReader head(open_envelope(kFlatBrickFile, file.bytes()).head);
        return head.text();
    } catch (const Error&) {
        return std::nullopt;
    }
}

}  // namespace voxloom
