// What a file of voxels says of itself, whatever its format: one or several steps of one volume.
//
// Opening reads headers only, so that it can run on every edit of a graph. Where voxels stand in the
// file uncompressed they are read by region (stored.h); what is compressed, or stored in a way that
// only the format's library knows, is loaded whole at the first read (loaded.h).
//
// World coordinates: NRRD, MetaImage, NIfTI and DICOM are all given in LPS (x to the patient's left,
// y to the back, z to the head), as ITK does; RAS headers are turned into it. Units are millimetres
// where the format or its field says so.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/data/volume.h"
#include "stored.h"

namespace voxloom {

inline constexpr std::int64_t kMostSteps = 10'000'000;  // more are a damaged header

struct ReadOptions {
    std::string format = "auto";  // one of format_names()
    std::string dataset;          // HDF5: path inside the file; empty: the only one that fits
    std::string series_uid;       // DICOM: which series of a folder; empty: the only one
    int time_axis = -1;           // HDF5: the axis, as stored, that is time; -1: none
};

struct VolumeFile {
    std::string format;  // "NRRD", for people
    VolumeDesc desc;     // of each step
    std::int64_t steps = 1;
    std::vector<double> times;  // one a step; empty: the file does not say
    std::string time_unit;
    std::vector<std::string> warnings;
    std::vector<std::filesystem::path> files;  // all that the voxels depend on
    // The volume at a step; cheap: voxels are read when asked for. [any thread]
    std::function<VolumePtr(std::int64_t step)> volume;
};
using VolumeFilePtr = std::shared_ptr<const VolumeFile>;

// "auto", "nrrd", "meta", "nifti", "dicom", "tiff", "hdf5", "raw".
const std::vector<std::string>& format_names();

// Reads the headers of a file, or of a folder of slices. Throws Error: no such file, a format that is
// not known, a header that is cut or wrong, fewer bytes than the header promises. Headers are kept by
// path, size and time of change, so asking again costs a look at the file's status.
VolumeFilePtr open_volume_file(const std::filesystem::path& path, const ReadOptions& options = {});

// --- for the formats -------------------------------------------------------------------------------

VolumeFile open_itk_file(const std::filesystem::path& path, const std::string& format);
VolumeFile open_tiff_folder(const std::vector<std::filesystem::path>& slices);
VolumeFile open_dicom(const std::filesystem::path& path, const std::string& series_uid);
VolumeFile open_hdf5(const std::filesystem::path& path, const ReadOptions& options);
VolumeFile open_raw(const std::filesystem::path& path);

// Completes `file` (desc, steps and name are there) with voxels that are read where they stand.
// Throws Error when the files are too short for them.
void serve_stored(VolumeFile& file, StoredVoxels stored);

// Files of a folder in natural order ("slice2" before "slice10"), hidden ones left out.
std::vector<std::filesystem::path> files_in(const std::filesystem::path& folder);
bool natural_less(std::string_view a, std::string_view b);
// "ct.nii.gz" gives "ct".
std::string stem_of(const std::filesystem::path& path);
std::string lower(std::string text);

// The matrix from axis directions (columns), spacing and origin. What cannot be is mended, with a
// warning: spacing that is 0 or not finite becomes 1, directions that span no space the axes.
glm::dmat4 world_matrix(glm::dmat3 direction, glm::dvec3 spacing, glm::dvec3 origin,
                        std::vector<std::string>& warnings);

}  // namespace voxloom
