#include "volume_file.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <list>
#include <mutex>

#include "core/base/error.h"
#include "core/base/text.h"
#include "loaded.h"
#include "stored.h"
#include "text_header.h"

namespace voxloom {

namespace fs = std::filesystem;

std::string lower(std::string text) {
    for (char& c : text)
        if (c >= 'A' && c <= 'Z') c = char(c - 'A' + 'a');
    return text;
}

std::string stem_of(const fs::path& path) {
    std::string name = path.filename().string();
    if (lower(name).ends_with(".gz")) name.resize(name.size() - 3);
    std::size_t dot = name.rfind('.');
    return dot == std::string::npos || dot == 0 ? name : name.substr(0, dot);
}

bool natural_less(std::string_view a, std::string_view b) {
    auto digit = [](char c) { return c >= '0' && c <= '9'; };
    std::size_t i = 0, j = 0;
    while (i < a.size() && j < b.size()) {
        if (digit(a[i]) && digit(b[j])) {
            std::size_t i0 = i, j0 = j;
            while (i < a.size() && digit(a[i])) ++i;
            while (j < b.size() && digit(b[j])) ++j;
            std::string_view m = a.substr(i0, i - i0), n = b.substr(j0, j - j0);
            m.remove_prefix(std::min(m.find_first_not_of('0'), m.size()));
            n.remove_prefix(std::min(n.find_first_not_of('0'), n.size()));
            if (m.size() != n.size()) return m.size() < n.size();
            if (m != n) return m < n;
        } else {
            if (a[i] != b[j]) return a[i] < b[j];
            ++i;
            ++j;
        }
    }
    if (a.size() - i != b.size() - j) return a.size() - i < b.size() - j;
    return a < b;  // "01" and "1"
}

std::vector<fs::path> files_in(const fs::path& folder) {
    std::vector<fs::path> files;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder, error))
        if (entry.is_regular_file(error) && !entry.path().filename().string().starts_with('.'))
            files.push_back(entry.path());
    if (error) fail("{} cannot be listed: {}", folder.string(), error.message());
    std::sort(files.begin(), files.end(), [](const fs::path& a, const fs::path& b) {
        return natural_less(a.filename().string(), b.filename().string());
    });
    return files;
}

glm::dmat4 world_matrix(glm::dmat3 direction, glm::dvec3 spacing, glm::dvec3 origin,
                        std::vector<std::string>& warnings) {
    for (int a = 0; a < 3; ++a) {
        if (!std::isfinite(spacing[a]) || spacing[a] == 0) {
            warnings.push_back(fmt::format("the spacing {} along {} is taken as 1",
                                           shortest(spacing[a]), "xyz"[a]));
            spacing[a] = 1;
        }
        if (!std::isfinite(origin[a])) {
            warnings.push_back(fmt::format("the origin {} along {} is taken as 0",
                                           shortest(origin[a]), "xyz"[a]));
            origin[a] = 0;
        }
    }
    double volume = std::abs(glm::determinant(direction));
    if (!(volume > 1e-6) || !std::isfinite(volume)) {
        warnings.push_back("the axis directions span no space; the axes are taken as x, y and z");
        direction = glm::dmat3(1);
    }
    glm::dmat4 m(1);
    for (int a = 0; a < 3; ++a)
        for (int i = 0; i < 3; ++i) m[a][i] = direction[a][i] * spacing[a] + 0.0;  // no -0
    m[3] = glm::dvec4(origin + 0.0, 1);
    return m;
}

void serve_stored(VolumeFile& file, StoredVoxels stored) {
    const std::uint64_t step_bytes = file.desc.dense_bytes();
    if (step_bytes > std::uint64_t(std::numeric_limits<std::int64_t>::max()) /
                         std::uint64_t(std::max<std::int64_t>(file.steps, 1)))
        fail("{}: {} steps of {} do not fit in 63 bits", file.desc.name, file.steps,
             human_bytes(double(step_bytes)));
    check_size(stored, step_bytes * std::uint64_t(file.steps));
    for (const StoredVoxels::Piece& piece : stored.pieces)
        if (std::find(file.files.begin(), file.files.end(), piece.file) == file.files.end())
            file.files.push_back(piece.file);
    if (!stored.packed) {
        file.volume = [desc = file.desc, steps = file.steps, stored](std::int64_t step) {
            return stored_volume(desc, stored, step, steps);
        };
        return;
    }
    const std::size_t sample_bytes = bytes_of(file.desc.type);
    auto packed = std::make_shared<PackedSteps>(stored, file.steps, sample_bytes);
    file.volume = [desc = file.desc, packed, step_bytes](std::int64_t step) {
        return loaded_volume(desc, std::make_shared<LoadOnce>(
            step_bytes, desc.name,
            [packed, step](std::span<std::byte> out, const std::stop_token& stop) {
                packed->read(step, out, stop);
            }));
    };
}

const std::vector<std::string>& format_names() {
    static const std::vector<std::string> names = {"auto", "nrrd", "meta", "nifti",
                                                   "dicom", "tiff", "hdf5", "raw"};
    return names;
}

namespace {

bool is_tiff(const fs::path& path) {
    std::string extension = lower(path.extension().string());
    return extension == ".tif" || extension == ".tiff";
}

// By the first bytes where they tell, else by the name.
std::string format_of(const fs::path& path) {
    const std::string head = read_head(path, 352);
    const std::string name = lower(path.filename().string());
    auto begins = [&](std::string_view magic) { return std::string_view(head).starts_with(magic); };
    auto ends = [&](std::string_view extension) { return name.ends_with(extension); };
    if (begins("NRRD000")) return "nrrd";
    if (begins("\x89HDF\r\n\x1a\n")) return "hdf5";
    if (begins(std::string_view("II*\0", 4)) || begins(std::string_view("MM\0*", 4)) ||
        begins(std::string_view("II+\0", 4)) || begins(std::string_view("MM\0+", 4)))
        return "tiff";
    if (head.size() >= 132 && std::string_view(head).substr(128, 4) == "DICM") return "dicom";
    if (ends(".nii") || ends(".nii.gz") || ends(".hdr") || ends(".hdr.gz") || ends(".img") ||
        ends(".img.gz"))
        return "nifti";
    if (ends(".mha") || ends(".mhd")) return "meta";
    if (ends(".nrrd") || ends(".nhdr")) return "nrrd";
    if (ends(".dcm")) return "dicom";
    if (ends(".tif") || ends(".tiff")) return "tiff";
    if (ends(".h5") || ends(".hdf5") || ends(".hdf")) return "hdf5";
    if (ends(".yaml") || ends(".yml") || fs::exists(path.string() + ".yaml") || ends(".raw"))
        return "raw";
    fail("{} is in no format that is known here (NRRD, MetaImage, NIfTI, DICOM, TIFF, HDF5); if it "
         "holds raw voxels, describe them in {}.yaml, else set 'format'",
         path.string(), path.string());
}

VolumeFile open_folder(const fs::path& path, const ReadOptions& options) {
    std::vector<fs::path> tiffs;
    for (const fs::path& file : files_in(path))
        if (is_tiff(file)) tiffs.push_back(file);
    if (options.format == "tiff" || (options.format == "auto" && !tiffs.empty())) {
        if (tiffs.empty()) fail("{} holds no TIFF files", path.string());
        return open_tiff_folder(tiffs);
    }
    if (options.format != "auto" && options.format != "dicom")
        fail("{} is a folder; only DICOM and TIFF slices are read from folders, so name a file",
             path.string());
    return open_dicom(path, options.series_uid);
}

VolumeFile open_now(const fs::path& path, const ReadOptions& options) {
    if (path.empty()) fail("no file is given; set 'path'");
    std::error_code error;
    fs::file_status status = fs::status(path, error);
    if (!fs::exists(status)) fail("{} is not there", path.string());
    if (fs::is_directory(status)) return open_folder(path, options);
    if (!fs::is_regular_file(status)) fail("{} is neither a file nor a folder", path.string());
    if (fs::file_size(path, error) == 0) fail("{} is empty", path.string());
    const std::string format = options.format == "auto" ? format_of(path) : options.format;
    if (format == "raw") return open_raw(path);
    if (format == "hdf5") return open_hdf5(path, options);
    if (format == "dicom") return open_dicom(path, options.series_uid);
    return open_itk_file(path, format);
}

// Headers by what was asked for; good while no file that they came from has changed.
struct Known {
    fs::path path;
    ReadOptions options;
    VolumeFilePtr file;
    std::vector<std::pair<fs::path, std::pair<std::int64_t, std::int64_t>>> stamps;
};
constexpr std::size_t kMostKnown = 32;

// Size and time of change in nanoseconds; -1 when it is not there.
std::pair<std::int64_t, std::int64_t> stamp_of(const fs::path& path) {
    struct stat s{};
    if (::stat(path.c_str(), &s) != 0) return {-1, -1};
    return {std::int64_t(s.st_size), std::int64_t(s.st_mtim.tv_sec) * 1'000'000'000 + s.st_mtim.tv_nsec};
}

bool unchanged(const Known& known) {
    return std::all_of(known.stamps.begin(), known.stamps.end(),
                       [](const auto& entry) { return stamp_of(entry.first) == entry.second; });
}

bool same(const ReadOptions& a, const ReadOptions& b) {
    return a.format == b.format && a.dataset == b.dataset && a.series_uid == b.series_uid &&
           a.time_axis == b.time_axis;
}

}  // namespace

VolumeFilePtr open_volume_file(const fs::path& path, const ReadOptions& options) {
    static std::mutex mutex;
    static std::list<Known> known;  // last used first
    {
        std::lock_guard lock(mutex);
        auto it = std::find_if(known.begin(), known.end(), [&](const Known& k) {
            return k.path == path && same(k.options, options);
        });
        if (it != known.end() && unchanged(*it)) {
            known.splice(known.begin(), known, it);
            return it->file;
        }
        if (it != known.end()) known.erase(it);
    }
    // Stamps are taken before reading: a change meanwhile is noticed the next time.
    Known fresh{path, options, nullptr, {{path, stamp_of(path)}}};
    VolumeFile file = open_now(path, options);
    for (const fs::path& member : file.files)
        if (member != path) fresh.stamps.emplace_back(member, stamp_of(member));
    fresh.file = std::make_shared<const VolumeFile>(std::move(file));
    std::lock_guard lock(mutex);
    known.push_front(fresh);
    if (known.size() > kMostKnown) known.pop_back();
    return fresh.file;
}

}  // namespace voxloom
