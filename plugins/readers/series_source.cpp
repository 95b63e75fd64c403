#include "series_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "core/base/error.h"
#include "core/base/text.h"

namespace voxloom {

namespace fs = std::filesystem;

VolumePtr ready(VolumePtr volume, const std::stop_token& stop) {
    if (volume->reads_by_region() || volume->desc().dense_bytes() == 0) return volume;
    Buffer voxel(volume->desc().voxel_bytes(), "voxel");
    volume->read({Index3(0), Index3(1)}, voxel.bytes(), stop);
    return volume;
}

namespace {

struct Pattern {
    std::string_view before, after;
    std::size_t digits = 1;
};

Pattern parse_pattern(std::string_view pattern) {
    Pattern p;
    std::size_t begin = pattern.find_first_of("#%");
    std::size_t end = begin;
    if (begin != std::string_view::npos && pattern[begin] == '#') {
        end = std::min(pattern.find_first_not_of('#', begin), pattern.size());
        p.digits = end - begin;
    } else if (begin != std::string_view::npos) {
        end = begin + 1;
        std::size_t width = std::min(pattern.find_first_not_of("0123456789", end), pattern.size());
        std::int64_t digits = 1;
        if (width > end && (!parse_integer(pattern.substr(end, width - end), digits) || digits > 18))
            digits = -1;
        p.digits = std::size_t(std::max<std::int64_t>(digits, 1));
        end = digits >= 0 && width < pattern.size() && pattern[width] == 'd' ? width + 1
                                                                             : std::string_view::npos;
    }
    if (end == std::string_view::npos || pattern.find_first_of("#%", end) != std::string_view::npos)
        fail("the pattern '{}' must have one place for a number, as in step_####.nrrd or "
             "step_%04d.nrrd", pattern);
    p.before = pattern.substr(0, begin);
    p.after = pattern.substr(end);
    return p;
}

}  // namespace

std::int64_t number_in(std::string_view name, std::string_view pattern) {
    const Pattern p = parse_pattern(pattern);
    if (!name.starts_with(p.before)) return -1;
    name.remove_prefix(p.before.size());
    if (!name.ends_with(p.after)) return -1;
    name.remove_suffix(p.after.size());
    std::int64_t number = -1;
    if (name.size() < p.digits || name.find_first_not_of("0123456789") != std::string_view::npos ||
        !parse_integer(name, number))
        return -1;
    return number;
}

namespace {

// The files of a folder that are volumes of their own; a detached data file is not.
std::vector<fs::path> numbered_files(const fs::path& folder, const std::string& pattern) {
    std::vector<std::pair<std::int64_t, fs::path>> numbered;
    std::vector<fs::path> files;
    if (!pattern.empty()) {
        for (const fs::path& file : files_in(folder))
            if (std::int64_t n = number_in(file.filename().string(), pattern); n >= 0)
                numbered.emplace_back(n, file);
        std::sort(numbered.begin(), numbered.end());
        for (auto& [n, file] : numbered) files.push_back(std::move(file));
        if (files.empty()) fail("{} holds no file that fits the pattern '{}'", folder.string(), pattern);
        return files;
    }
    std::set<std::string> kinds;
    for (const fs::path& file : files_in(folder)) {
        const std::string name = lower(file.filename().string());
        for (const char* extension : {".nrrd", ".nhdr", ".mha", ".mhd", ".nii", ".nii.gz", ".hdr", ".dcm",
                                      ".tif", ".tiff", ".h5", ".hdf5", ".raw.yaml"})
            if (name.ends_with(extension)) {
                files.push_back(file);
                kinds.insert(extension);
                break;
            }
    }
    if (files.empty()) fail("{} is a folder without images", folder.string());
    if (kinds.size() > 1)
        fail("{} holds files of several kinds ({}); say by 'pattern' which are the steps, as in "
             "step_####.nrrd", folder.string(),
             join(std::vector<std::string>(kinds.begin(), kinds.end()), ", "));
    return files;
}

// All steps in one file.
class FileSeries final : public Series {
  public:
    FileSeries(SeriesDesc desc, VolumeFilePtr file) : Series(std::move(desc)), file_(std::move(file)) {}
    Value fetch(std::size_t i, const std::stop_token& stop) const override {
        if (i >= desc().times.size()) fail("the series has no step {}", i);
        return ready(file_->volume(std::int64_t(i)), stop);
    }

  private:
    VolumeFilePtr file_;
};

// A file a step.
class NumberedSeries final : public Series {
  public:
    NumberedSeries(SeriesDesc desc, std::vector<fs::path> files, ReadOptions read)
        : Series(std::move(desc)), files_(std::move(files)), read_(std::move(read)) {}
    Value fetch(std::size_t i, const std::stop_token& stop) const override {
        if (i >= files_.size()) fail("the series has no step {}", i);
        check_stop(stop);
        VolumeFilePtr file = open_volume_file(files_[i], read_);
        const VolumeDesc& first = *desc().step.volume();
        const VolumeDesc& own = file->desc;
        if (own.dims != first.dims || own.type != first.type || own.components != first.components ||
            file->steps != 1)
            fail("{} is {}{}, the first step is {}; steps of a series must be alike",
                 files_[i].string(), summary(own),
                 file->steps == 1 ? "" : fmt::format(" at {} times", file->steps), summary(first));
        return ready(file->volume(0), stop);
    }

  private:
    std::vector<fs::path> files_;
    ReadOptions read_;
};

// What the user says comes before what the files say; without either, steps are one apart.
std::vector<double> times_of(const SeriesOptions& options, std::size_t steps,
                             const std::vector<double>& stored) {
    std::vector<double> times = options.times;
    if (times.empty() && options.time_step == 0) times = stored;
    if (times.empty())
        for (std::size_t i = 0; i < steps; ++i)
            times.push_back(double(i) * (options.time_step > 0 ? options.time_step : 1));
    if (times.size() != steps)
        fail("'times' has {} entries and the series {} steps; give one time a step", times.size(), steps);
    for (std::size_t i = 1; i < times.size(); ++i)
        if (!(times[i] > times[i - 1]))
            fail("the times of the series must increase, but {} comes after {}; set 'times' or "
                 "'time_step'", shortest(times[i]), shortest(times[i - 1]));
    return times;
}

}  // namespace

OpenedSeries open_series(const SeriesOptions& options) {
    if (options.path.empty()) fail("no file or folder is given; set 'path'");
    if (!fs::exists(options.path)) fail("{} is not there", options.path.string());
    OpenedSeries opened;
    SeriesDesc desc;
    if (!fs::is_directory(options.path)) {
        if (!options.pattern.empty())
            fail("{} is a file, and 'pattern' goes with a folder; name its folder in 'path'",
                 options.path.string());
        VolumeFilePtr file = open_volume_file(options.path, options.read);
        if (file->steps == 0) fail("{} has no time steps", options.path.string());
        desc.step = ValueDesc(file->desc);
        desc.times = times_of(options, std::size_t(file->steps), file->times);
        desc.time_unit = options.time_unit.empty() ? file->time_unit : options.time_unit;
        opened.warnings = file->warnings;
        opened.files = file->files;
        opened.series = std::make_shared<FileSeries>(std::move(desc), std::move(file));
        return opened;
    }
    std::vector<fs::path> files = numbered_files(options.path, options.pattern);
    VolumeFilePtr first = open_volume_file(files.front(), options.read);
    if (first->steps != 1)
        fail("{} holds {} time steps itself; name that file in 'path'", files.front().string(),
             first->steps);
    desc.step = ValueDesc(first->desc);
    desc.times = times_of(options, files.size(), {});
    desc.time_unit = options.time_unit;
    opened.warnings = first->warnings;
    opened.files = {options.path};
    for (const fs::path& file : files) {
        const std::string extension = lower(file.extension().string());
        // Headers with their voxels elsewhere: both files count.
        if (extension == ".nhdr" || extension == ".mhd" || extension == ".hdr" || extension == ".yaml") {
            const auto& parts = open_volume_file(file, options.read)->files;
            opened.files.insert(opened.files.end(), parts.begin(), parts.end());
        } else {
            opened.files.push_back(file);
        }
    }
    opened.series = std::make_shared<NumberedSeries>(std::move(desc), std::move(files), options.read);
    return opened;
}

}  // namespace voxloom
