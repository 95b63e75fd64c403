// Where a file's voxels stand, read from its header: data file, offset, packing, byte order.
//
// What the voxels mean (sizes, orientation, components) is ITK's to say. This finds them in the file,
// so that a box of a large uncompressed volume can be read without the rest, so that a file that is
// cut short is noticed by its size alone, and so that detached data files are known by name.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stored.h"

namespace voxloom {

inline constexpr std::size_t kMostHeader = 1 << 20;  // bytes; a longer header is not one

// The first bytes of a file, at most `most`. Throws Error when it cannot be read.
std::string read_head(const std::filesystem::path& path, std::size_t most);

// "key: value" fields by lower-case key without blanks ("data file" is "datafile").
using Fields = std::map<std::string, std::string, std::less<>>;

struct NrrdHeader {
    Fields fields;
    std::vector<std::string> data_files;  // of "data file: LIST"
    std::uint64_t end = 0;                // of the header, where attached data begins
    std::vector<std::string> words(std::string_view key) const;   // of a field, quotes taken off
};
// Throws Error when `head` is no NRRD header, or ends before the header does.
NrrdHeader parse_nrrd_header(std::string_view head, const std::filesystem::path& path);

struct MetaHeader {
    Fields fields;
    std::uint64_t end = 0;
};
MetaHeader parse_meta_header(std::string_view head, const std::filesystem::path& path);

// What was found of a file. Voxels is empty where only the library can read them (text, bzip2,
// scaled values, slices in files of their own): then they are loaded whole.
struct Layout {
    std::optional<StoredVoxels> voxels;
    std::vector<std::filesystem::path> files;  // header and data
    // Without `voxels`: what the data file must have at least, unpacked. The libraries do not all
    // notice where it has less. 0: not known.
    std::filesystem::path data;
    std::uint64_t least_bytes = 0;
    bool packed = false;
};

Layout nrrd_layout(const NrrdHeader& header, const std::filesystem::path& path, int components,
                   std::uint64_t samples, std::size_t sample_bytes);
Layout meta_layout(const MetaHeader& header, const std::filesystem::path& path);
// `head` is the unpacked beginning of a .nii, .nii.gz, or .hdr file.
Layout nifti_layout(std::string_view head, const std::filesystem::path& path, bool packed);

}  // namespace voxloom
