// What files of compressed bricks have in common, whatever the codec.
//
// The envelope, little-endian:
//     8 bytes  magic
//     u32      version
//     u32      0x01020304
//     u64      length of the head
//     u64      length of the payload, which ends the file
//     u64      lower half of the 128-bit XXH3 of the 32 bytes above and the head
//     head, payload
// A wrong head is found on opening. The head holds a checksum for each part of the payload.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>

#include "core/base/byte_io.h"
#include "core/data/volume.h"

namespace voxloom {

struct BrickFileKind {
    std::string_view magic;         // 8 characters
    std::uint32_t version, oldest;  // what is written; all from the oldest on are read
};
// docs/brick-format.md: bricks that are coded each by itself, whatever the codec.
inline constexpr BrickFileKind kFlatBrickFile{"voxbrick", 1, 1};

// The lowest 32 bits of the 128-bit XXH3.
std::uint32_t check_of(std::span<const std::byte> bytes);

// Everything before the payload.
Bytes enclose(const BrickFileKind& kind, std::span<const std::byte> head, std::uint64_t payload_bytes);
struct Envelope {
    std::uint32_t version = 0;
    std::span<const std::byte> head, payload;
};
// Throws Error saying what is wrong, without the file's name.
Envelope open_envelope(const BrickFileKind& kind, std::span<const std::byte> file);

// `front` (what enclose() gave) and the payload, under a temporary name, then renamed. written(offset, bytes) hears of
// each part of the payload that is done with.
void write_brick_file(const std::filesystem::path& path, std::span<const std::byte> front,
                      std::span<const std::byte> payload, const std::stop_token& stop,
                      const std::function<void(std::size_t, std::size_t)>& written = {});

// dims 3 i64; index to world 16 f64, column by column; unit, name; u8 scalar type, components, colour,
// significant bits; f64 smallest and largest finite value.
void write_volume_desc(const VolumeDesc& volume, ByteWriter& writer);
// Throws Error for what is no volume; every number is in its range, dense_bytes() fits.
VolumeDesc read_volume_desc(ByteReader& reader);

// How a flat brick file came to be, in words; empty for any other file.
std::optional<std::string> provenance_of(const std::filesystem::path& path);

}  // namespace voxloom
