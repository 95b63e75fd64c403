#include "volume_nodes.h"

#include <fmt/format.h>

#include "core/base/error.h"
#include "series_source.h"
#include "volume_file.h"

namespace voxloom {

namespace fs = std::filesystem;

namespace {

// The spacing that the user gives stands in place of the file's, axis by axis.
VolumeFilePtr opened_volume(const Params& params) {
    ReadOptions options;
    options.format = params.text("format");
    options.dataset = params.text("dataset");
    options.series_uid = params.text("series_uid");
    VolumeFilePtr file = open_volume_file(params.path("path"), options);
    if (file->steps != 1)
        fail("{} holds {} volumes, one for each time; read it with readers.series and take one with "
             "series.step", params.path("path").string(), file->steps);
    return file;
}

SeriesOptions series_options(const Params& params) {
    SeriesOptions options;
    options.path = params.path("path");
    options.pattern = params.text("pattern");
    options.read.format = params.text("format");
    options.read.dataset = params.text("dataset");
    options.read.time_axis = int(params.integer("time_axis"));
    options.times = params.numbers("times");
    options.time_step = params.real("time_step");
    options.time_unit = params.text("time_unit");
    return options;
}

// Problems of a file are shown at the parameter that names it.
template <class F>
void or_problem(Description& d, F&& f) {
    try {
        f();
    } catch (const Error& e) {
        d.problem(e.what(), "path");
    }
}

template <class F>
std::vector<fs::path> or_none(F&& f) {
    try {
        return f();
    } catch (const Error&) {
        return {};  // described as a problem already
    }
}

ParamSpec format_param() {
    return param::choice("format", format_names(), "auto",
                         "How the file is read; auto looks at its first bytes, then at its name.")
        .for_experts();
}
ParamSpec dataset_param() {
    return param::text("dataset", "",
                       "Path of the dataset inside an HDF5 file; empty takes the only one that fits.")
        .in_group("HDF5");
}

NodeType volume_reader() {
    NodeType type;
    type.id = "readers.volume";
    type.title = "Read volume";
    type.doc = "Reads a volume from a file, or from a folder of DICOM or TIFF slices.";
    type.keywords = {"open", "load", "file", "NRRD", "NHDR", "MetaImage", "mha", "mhd", "NIfTI",
                     "DICOM", "TIFF", "HDF5", "raw", "import"};
    type.outputs = {{"volume", PortType::volume, "The volume, its voxels read when they are asked for."}};
    type.params = {
        param::path_in("path", "The file, or the folder with the slices."),
        format_param(),
        dataset_param(),
        param::text("series_uid", "",
                    "Which DICOM series of the folder; empty takes the only one.").in_group("DICOM"),
    };
    type.method = R"(**Formats.** NRRD (attached and detached), MetaImage, NIfTI-1 and Analyze, DICOM (a file or a
folder with one series), TIFF (pages or a folder of numbered slices) through ITK's image IO; HDF5
datasets; raw voxels with a YAML description beside them (`head.raw.yaml`):

```yaml
dims: [256, 256, 128]    # x y z, x fastest
type: u16                # u8 i8 u16 i16 u32 i32 f32 f64
endianness: little
spacing: [1, 1, 2.5]     # also: origin, direction, unit, name, components, color,
offset: 0                # significant_bits, compression (none, gzip), file
```

**Coordinates.** Spacing, origin and orientation are kept in the index-to-world matrix. NRRD, MetaImage,
NIfTI and DICOM are all given in LPS (x to the patient's left, y to the back, z to the head). DICOM
slices are put in order by their position along the slice normal; the step between slices is kept as it
is, so a tilted gantry gives a sheared grid. Missing and unevenly spaced slices are warned of.

**Reading.** Uncompressed NRRD, MetaImage, NIfTI and raw files and HDF5 datasets are read by region, so
they may be larger than memory; stacks of slices slice by slice. Compressed files are unpacked whole.
64-bit integers become `f64`, and one that has no exact double is an error. A file that is cut short is
reported from its size before anything is read, or where it is compressed while it is unpacked.

**When not.** For several times in one file or numbered files use `readers.series`.)";
    type.describe = [](Description& d) {
        or_problem(d, [&] {
            const VolumeFilePtr file = opened_volume(d.params());
            ValueDesc volume(file->desc);
            volume.by_region = file->volume(0)->reads_by_region();
            d.output("volume", std::move(volume));
        });
    };
    type.evaluate = [](Evaluation& e) {
        VolumeFilePtr file = opened_volume(e.params());
        for (const std::string& warning : file->warnings) e.warn(warning);
        VolumePtr volume = file->volume(0);
        if (!volume->reads_by_region()) e.progress(0, "unpacking " + file->desc.name);
        e.output("volume", ready(std::move(volume), e.stop()));
    };
    type.files = [](const Params& params) { return or_none([&] { return opened_volume(params)->files; }); };
    return type;
}

NodeType series_reader() {
    NodeType type;
    type.id = "readers.series";
    type.title = "Read series";
    type.doc = "Reads volumes at several times from a file with four axes or from numbered files.";
    type.keywords = {"time", "4D", "steps", "animation", "open", "load", "sequence", "import"};
    type.outputs = {{"series", PortType::series, "The volumes by time, each read when it is fetched."}};
    type.params = {
        param::path_in("path", "A file whose fourth axis is time, or a folder of numbered files."),
        param::text("pattern", "",
                    "Names of the folder's files with a place for the number, as step_####.nrrd or "
                    "step_%04d.nrrd; empty takes all volumes in natural order."),
        param::list("times", {}, "Time of each step, increasing; empty takes the time step.")
            .in_group("time"),
        param::real("time_step", 0, "Time between steps; 0 takes what the file says, else 1.")
            .range(0, 1e300).slider(0, 10).in_group("time"),
        param::text("time_unit", "", "Unit of the times; empty takes what the file says.")
            .in_group("time"),
        format_param(),
        dataset_param(),
        param::integer("time_axis", -1,
                       "Which axis of an HDF5 dataset, as stored and counted from 0, is time; -1 none.")
            .range(-1, 4).slider(-1, 4).in_group("HDF5"),
    };
    type.method = R"(A file with four axes (NRRD, MetaImage, NIfTI, raw with four `dims`, HDF5 with
`time_axis`) holds a volume for each time; or each time is a file of its own, in the order of the
numbers in their names. Times come from the header (the spacing of the fourth axis), from `time_step`
or from `times`, where steps may be uneven.

**Memory.** Uncompressed steps are read by region. In a gzip file steps are unpacked one by one: going
forward unpacks each once, and the state at each beginning is kept (50 KB), so going back costs no more
than that step. What only ITK can unpack (scaled NIfTI values, text, bzip2) is loaded whole while any
step of it is in use.

**When not.** A single volume is read by `readers.volume`. To draw one step with any graph take it with
`series.step`.)";
    type.describe = [](Description& d) {
        or_problem(d, [&] { d.output("series", open_series(series_options(d.params())).series->desc()); });
    };
    type.evaluate = [](Evaluation& e) {
        OpenedSeries opened = open_series(series_options(e.params()));
        for (const std::string& warning : opened.warnings) e.warn(warning);
        e.output("series", opened.series);
    };
    type.files = [](const Params& params) {
        return or_none([&] { return open_series(series_options(params)).files; });
    };
    return type;
}

std::string no_such_step(std::int64_t index, std::size_t steps) {
    return fmt::format("the series has {} steps, so 'index' must be from 0 to {}, not {}", steps,
                       std::int64_t(steps) - 1, index);
}

NodeType step_node() {
    NodeType type;
    type.id = "series.step";
    type.title = "Step of a series";
    type.doc = "Takes the volume at one step of a series.";
    type.keywords = {"time", "4D", "frame", "pick", "index"};
    type.inputs = {{"series", PortType::series, "Volumes at several times."}};
    type.outputs = {{"volume", PortType::volume, "The volume at that step."}};
    type.params = {param::integer("index", 0, "Which step, counted from 0.")
                       .range(0, 1e9).slider(0, 100)};
    type.method = R"(Fetches one step; the others are not read. Changing `index` reads only that step
again. Between steps nothing is interpolated.)";
    type.describe = [](Description& d) {
        const ValueDesc* input = d.input("series");
        auto* series = input ? std::get_if<std::shared_ptr<const SeriesDesc>>(&input->detail) : nullptr;
        if (!series) return d.output("volume", PortType::volume);
        const std::int64_t index = d.params().integer("index");
        if ((*series)->element != PortType::volume)
            return d.problem(fmt::format("the series is of {}, and only steps that are Volumes can be taken",
                                         name_of((*series)->element)), "series");
        if (std::size_t(index) >= (*series)->times.size())
            d.problem(no_such_step(index, (*series)->times.size()), "index");
        d.output("volume", (*series)->step);
    };
    type.evaluate = [](Evaluation& e) {
        auto series = e.input<Series>("series");
        const std::int64_t index = e.params().integer("index");
        const SeriesDesc& desc = series->desc();
        if (std::size_t(index) >= desc.times.size()) fail("{}", no_such_step(index, desc.times.size()));
        Value step = series->fetch(std::size_t(index), e.stop());
        if (!std::holds_alternative<VolumePtr>(step))
            fail("the series is of {}, and only steps that are Volumes can be taken", name_of(desc.element));
        e.measure("time", desc.times[std::size_t(index)], desc.time_unit);
        e.output("volume", std::move(step));
    };
    return type;
}

}  // namespace

void add_volume_readers(Registry& registry) {
    registry.add(volume_reader());
    registry.add(series_reader());
    registry.add(step_node());
}

}  // namespace voxloom
