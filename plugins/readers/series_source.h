// Where the steps of a series stand: in one file of four axes, or in numbered files.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/data/value.h"
#include "volume_file.h"

namespace voxloom {

struct SeriesOptions {
    std::filesystem::path path;  // a file, or a folder of numbered files
    std::string pattern;         // names in the folder; empty: all volumes that are there
    ReadOptions read;
    std::vector<double> times;   // empty: time_step, else what the files say
    double time_step = 0;        // 0: what the files say
    std::string time_unit;       // empty: what the files say
};

// The series, its headers read; steps are read when they are fetched. Throws Error.
struct OpenedSeries {
    SeriesPtr series;
    std::vector<std::string> warnings;
    std::vector<std::filesystem::path> files;
};
OpenedSeries open_series(const SeriesOptions& options);

// The number in `name` where it fits the pattern: "t_####.nrrd" and "t_%04d.nrrd" take four digits or
// more, "t_#.nrrd" and "t_%d.nrrd" any. -1 where it does not fit. Throws Error when the pattern has
// no place for a number, or two.
std::int64_t number_in(std::string_view name, std::string_view pattern);

// The volume at a step, loaded where it cannot be read by region: so a damaged file is known now, and
// the memory counts for whoever keeps the volume.
VolumePtr ready(VolumePtr volume, const std::stop_token& stop);

}  // namespace voxloom
