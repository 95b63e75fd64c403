// Wavelet files (.vxw): docs/wavelet-format.md.
#pragma once

#include <filesystem>
#include <memory>
#include <stop_token>

#include "core/data/brick_file.h"
#include "plugins/codec-wavelet/wavelet_bricks.h"

namespace voxloom::wavelet {

inline constexpr BrickFileKind kWaveletFile{"voxwave\n", 4, 1};  // docs/wavelet-format.md

// Bytes that a file with this index and so long a payload has.
std::uint64_t file_bytes(const TreeIndex& index, std::uint64_t payload);

// Under a temporary name, then renamed. Throws Error when the disk refuses it.
void write_file(const WaveletBricks& bricks, const std::filesystem::path& path, const std::stop_token& stop = {});

// Maps the file; only its head is read. Throws Error, naming the file, for anything that is not a whole
// wavelet file of a known version.
std::shared_ptr<const WaveletBricks> open_file(const std::filesystem::path& path);
// The same of bytes in memory, which `keeper` keeps alive; `name` is for messages.
std::shared_ptr<const WaveletBricks> open_bytes(std::span<const std::byte> bytes, std::shared_ptr<const void> keeper,
                                                const std::string& name);
// What write_file() writes.
Bytes head_of(const TreeIndex& index, std::uint64_t payload);

}  // namespace voxloom::wavelet
