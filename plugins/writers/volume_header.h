// Headers of volume files, as text, from a volume's description. World coordinates are kept as the
// full matrix: each axis' direction times its spacing, and the position of voxel (0, 0, 0).
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "core/data/volume.h"

namespace voxloom {

// What the extension of a path asks for, or nothing when it is none of ours.
enum class VolumeFormat {
    nrrd,  // .nrrd: header and voxels in one file
    nhdr,  // .nhdr: the header, and NAME.raw or NAME.raw.gz
    mha,   // .mha: header and voxels in one file
    mhd,   // .mhd: the header, and NAME.raw
    raw,   // .raw: the voxels, and NAME.raw.yaml that describes them
};
std::optional<VolumeFormat> volume_format_of(const std::filesystem::path& path);
inline constexpr const char* kVolumeExtensions = ".nrrd, .nhdr, .mha, .mhd, .raw";

// `data_file`: the name of the file with the voxels, empty when they follow the header.
std::string nrrd_header(const VolumeDesc& desc, bool gzip, const std::string& data_file);
std::string meta_header(const VolumeDesc& desc, const std::string& data_file);
std::string raw_sidecar(const VolumeDesc& desc, bool gzip);

}  // namespace voxloom
