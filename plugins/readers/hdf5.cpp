// HDF5 datasets of three axes (z, y, x as stored), with components after them or time anywhere.
#include <fmt/format.h>

#include "core/base/error.h"
#include "volume_file.h"

#if !VOXLOOM_WITH_HDF5

namespace voxloom {
VolumeFile open_hdf5(const std::filesystem::path& path, const ReadOptions&) {
    fail("{} needs HDF5, and this voxloom was built without HDF5; install libhdf5-dev and build again",
         path.string());
}
}  // namespace voxloom

#else

#include <hdf5.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <mutex>

#include "core/base/text.h"

namespace voxloom {

namespace fs = std::filesystem;

namespace {

// The library is not thread-safe in every build, and prints its errors unless told not to.
class Hdf5Lock {
  public:
    Hdf5Lock() : lock_(mutex()) { H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); }

  private:
    static std::mutex& mutex() {
        static std::mutex m;
        return m;
    }
    std::lock_guard<std::mutex> lock_;
};

// An identifier that closes itself. Always destroyed under the lock.
class Handle {
  public:
    Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
    ~Handle() {
        if (id_ >= 0) close_(id_);
    }
    Handle(const Handle&) = delete;
    Handle& operator=(const Handle&) = delete;
    operator hid_t() const { return id_; }
    bool ok() const { return id_ >= 0; }

  private:
    hid_t id_;
    herr_t (*close_)(hid_t);
};

// The innermost of the library's messages: "truncated file: eof = 96, ...".
std::string reason() {
    std::string text = "the library gives no reason";
    H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD,
             [](unsigned n, const H5E_error2_t* e, void* out) -> herr_t {
                 if (n == 0 && e->desc) *static_cast<std::string*>(out) = e->desc;
                 return 0;
             },
             &text);
    return text;
}

struct Dataset {
    std::string name;
    std::vector<hsize_t> dims;
};

// What can be a volume: three or four axes of numbers.
std::vector<Dataset> datasets_of(hid_t file) {
    std::vector<Dataset> found;
    struct Visit {
        hid_t file;
        std::vector<Dataset>* found;
    } visit{file, &found};
    H5Ovisit2(file, H5_INDEX_NAME, H5_ITER_NATIVE,
              [](hid_t, const char* name, const H5O_info_t* info, void* data) -> herr_t {
                  auto& v = *static_cast<Visit*>(data);
                  if (info->type != H5O_TYPE_DATASET) return 0;
                  Handle set(H5Dopen2(v.file, name, H5P_DEFAULT), H5Dclose);
                  if (!set.ok()) return 0;
                  Handle space(H5Dget_space(set), H5Sclose);
                  Handle type(H5Dget_type(set), H5Tclose);
                  const H5T_class_t kind = H5Tget_class(type);
                  const int rank = H5Sget_simple_extent_ndims(space);
                  if ((kind != H5T_INTEGER && kind != H5T_FLOAT) || rank < 2 || rank > 5) return 0;
                  Dataset dataset{std::string("/") + name, std::vector<hsize_t>(std::size_t(rank))};
                  H5Sget_simple_extent_dims(space, dataset.dims.data(), nullptr);
                  v.found->push_back(std::move(dataset));
                  return 0;
              },
              &visit, H5O_INFO_BASIC);
    return found;
}

std::string extents(const Dataset& set) {
    std::vector<std::string> words;
    for (hsize_t n : set.dims) words.push_back(std::to_string(n));
    return fmt::format("{} ({})", set.name, join(words, " x "));
}

Dataset choose(hid_t file, const fs::path& path, std::string asked) {
    std::vector<Dataset> all = datasets_of(file);
    std::vector<std::string> names, list;
    for (const Dataset& set : all) {
        names.push_back(set.name);
        list.push_back(extents(set));
    }
    if (all.empty()) fail("{} holds no dataset of numbers with two to five axes", path.string());
    if (!asked.empty()) {
        if (!asked.starts_with('/')) asked.insert(0, "/");
        for (const Dataset& set : all)
            if (set.name == asked) return set;
        fail("{} has no dataset '{}'{}; there is {}", path.string(), asked,
             did_you_mean(asked, names), join(list, ", "));
    }
    if (all.size() == 1) return all[0];
    // Beside a volume there are often tables and axes: the only one of three or more axes is meant.
    std::vector<Dataset> deep;
    for (const Dataset& set : all)
        if (set.dims.size() >= 3) deep.push_back(set);
    if (deep.size() == 1) return deep[0];
    fail("{} holds {} datasets; set 'dataset' to one of them: {}", path.string(), all.size(),
         join(list, ", "));
}

// An attribute as numbers; empty where it is not there or is something else.
std::vector<double> numbers_of(hid_t object, const char* name) {
    if (H5Aexists(object, name) <= 0) return {};
    Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose);
    if (!attribute.ok()) return {};
    Handle space(H5Aget_space(attribute), H5Sclose);
    Handle type(H5Aget_type(attribute), H5Tclose);
    const hssize_t n = H5Sget_simple_extent_npoints(space);
    const H5T_class_t kind = H5Tget_class(type);
    if (n < 1 || n > 1 << 20 || (kind != H5T_INTEGER && kind != H5T_FLOAT)) return {};
    std::vector<double> values(static_cast<std::size_t>(n));
    if (H5Aread(attribute, H5T_NATIVE_DOUBLE, values.data()) < 0) return {};
    return values;
}

std::string text_of(hid_t object, const char* name) {
    if (H5Aexists(object, name) <= 0) return {};
    Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose);
    if (!attribute.ok()) return {};
    Handle type(H5Aget_type(attribute), H5Tclose);
    Handle space(H5Aget_space(attribute), H5Sclose);
    if (H5Tget_class(type) != H5T_STRING || H5Sget_simple_extent_npoints(space) != 1) return {};
    if (H5Tis_variable_str(type) > 0) {
        char* value = nullptr;
        if (H5Aread(attribute, type, &value) < 0 || !value) return {};
        std::string text = value;
        H5Dvlen_reclaim(type, space, H5P_DEFAULT, &value);
        return text;
    }
    std::string text(H5Tget_size(type), '\0');
    if (H5Aread(attribute, type, text.data()) < 0) return {};
    text.resize(std::min(text.find('\0'), text.size()));
    return text;
}

// Where x, y, z, component and time stand among the stored axes; -1: not there.
struct Axes {
    int x = -1, y = -1, z = -1, component = -1, time = -1;
    int rank = 0;
};

// `memory` is what HDF5 converts to; 64-bit integers come as doubles after a look at them.
struct Stored {
    fs::path path;
    std::string dataset;
    Axes axes;
    Samples::Wide wide = Samples::Wide::no;
};

hid_t memory_type(ScalarType type, Samples::Wide wide) {
    if (wide == Samples::Wide::i64) return H5T_NATIVE_INT64;
    if (wide == Samples::Wide::u64) return H5T_NATIVE_UINT64;
    switch (type) {
        case ScalarType::u8: return H5T_NATIVE_UINT8;
        case ScalarType::i8: return H5T_NATIVE_INT8;
        case ScalarType::u16: return H5T_NATIVE_UINT16;
        case ScalarType::i16: return H5T_NATIVE_INT16;
        case ScalarType::u32: return H5T_NATIVE_UINT32;
        case ScalarType::i32: return H5T_NATIVE_INT32;
        case ScalarType::f32: return H5T_NATIVE_FLOAT;
        case ScalarType::f64: break;
    }
    return H5T_NATIVE_DOUBLE;
}

ScalarType scalar_type(hid_t type, Samples::Wide& wide, const std::string& what) {
    const std::size_t size = H5Tget_size(type);
    if (H5Tget_class(type) == H5T_FLOAT) {
        if (size > 8) fail("{}: floats of {} bytes are not read; convert them to 64 bits", what, size);
        return size > 4 ? ScalarType::f64 : ScalarType::f32;  // half precision becomes f32
    }
    const bool is_signed = H5Tget_sign(type) == H5T_SGN_2;
    if (size == 1) return is_signed ? ScalarType::i8 : ScalarType::u8;
    if (size == 2) return is_signed ? ScalarType::i16 : ScalarType::u16;
    if (size <= 4) return is_signed ? ScalarType::i32 : ScalarType::u32;
    if (size > 8) fail("{}: integers of {} bytes are not read", what, size);
    wide = is_signed ? Samples::Wide::i64 : Samples::Wide::u64;
    return ScalarType::f64;
}

// Reads by hyperslab. The file is open while the volume lives, so chunks stay in HDF5's cache.
class Hdf5Volume final : public Volume {
  public:
    Hdf5Volume(VolumeDesc desc, Stored stored, std::int64_t step)
        : Volume(std::move(desc)), stored_(std::move(stored)), step_(step) {
        Hdf5Lock lock;
        file_ = H5Fopen(stored_.path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
        if (file_ < 0) fail("{} cannot be opened: {}", stored_.path.string(), reason());
        set_ = H5Dopen2(file_, stored_.dataset.c_str(), H5P_DEFAULT);
        if (set_ < 0) {
            H5Fclose(file_);
            fail("{} has changed while it was used; run again", stored_.path.string());
        }
    }
    ~Hdf5Volume() override {
        Hdf5Lock lock;
        H5Dclose(set_);
        H5Fclose(file_);
    }

    void read(const Box& box, std::span<std::byte> out, const std::stop_token& stop) const override {
        assert(out.size() == box.voxels() * desc().voxel_bytes());
        if (box.empty()) return;
        // Slabs, so that a cancelled read ends soon.
        const Index3 n = box.dims();
        const std::uint64_t slice = std::uint64_t(n.x) * std::uint64_t(n.y) * desc().voxel_bytes();
        const auto slab = std::max<std::int64_t>(1, std::int64_t((16u << 20) / slice));
        for (std::int64_t z = 0; z < n.z; z += slab) {
            check_stop(stop);
            Box part = box;
            part.lo.z = box.lo.z + z;
            part.hi.z = std::min(part.lo.z + slab, box.hi.z);
            read_part(part, out.subspan(std::uint64_t(z) * slice, slice * std::uint64_t(part.dims().z)));
        }
    }

  private:
    void read_part(const Box& box, std::span<std::byte> out) const {
        const Axes& axes = stored_.axes;
        std::vector<hsize_t> start(std::size_t(axes.rank), 0), count(std::size_t(axes.rank), 1);
        auto select = [&](int axis, std::int64_t lo, std::int64_t n) {
            if (axis < 0) return;
            start[std::size_t(axis)] = hsize_t(lo);
            count[std::size_t(axis)] = hsize_t(n);
        };
        const Index3 n = box.dims();
        select(axes.x, box.lo.x, n.x);
        select(axes.y, box.lo.y, n.y);
        select(axes.z, box.lo.z, n.z);
        select(axes.component, 0, desc().components);
        select(axes.time, step_, 1);
        Hdf5Lock lock;
        Handle from(H5Dget_space(set_), H5Sclose);
        Handle to(H5Screate_simple(axes.rank, count.data(), nullptr), H5Sclose);
        if (H5Sget_simple_extent_ndims(from) != axes.rank ||
            H5Sselect_hyperslab(from, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr) < 0 ||
            H5Dread(set_, memory_type(desc().type, stored_.wide), to, from, H5P_DEFAULT, out.data()) < 0)
            fail("{}: dataset {} cannot be read: {}", stored_.path.string(), stored_.dataset, reason());
        Samples samples;
        samples.wide = stored_.wide;
        to_native(out, bytes_of(desc().type), samples, stored_.path);
    }

    Stored stored_;
    std::int64_t step_;
    hid_t file_ = -1, set_ = -1;
};

Axes axes_of(const Dataset& set, int time_axis, const std::string& what) {
    Axes axes;
    axes.rank = int(set.dims.size());
    if (time_axis >= axes.rank) fail("{} has {} axes, so 'time_axis' must be below {}", what, axes.rank, axes.rank);
    axes.time = time_axis;
    std::vector<int> rest;
    for (int a = 0; a < axes.rank; ++a)
        if (a != time_axis) rest.push_back(a);
    // A short last axis after three others is the components.
    if (rest.size() == 4 && set.dims[std::size_t(rest[3])] <= 4) {
        axes.component = rest[3];
        rest.pop_back();
    }
    if (rest.size() < 2 || rest.size() > 3)
        fail("{} has {} axes; three make a volume (z, y, x), a fourth of 1 to 4 the components; if one "
             "is time, name it by 'time_axis' and read it with readers.series", what, axes.rank);
    axes.x = rest[rest.size() - 1];
    axes.y = rest[rest.size() - 2];
    axes.z = rest.size() == 3 ? rest[0] : -1;
    return axes;
}

}  // namespace

VolumeFile open_hdf5(const fs::path& path, const ReadOptions& options) {
    Hdf5Lock lock;
    Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
    if (!file.ok()) fail("{} cannot be opened as HDF5: {}", path.string(), reason());
    const Dataset set = choose(file, path, options.dataset);
    const std::string what = path.string() + ": dataset " + extents(set);
    Handle object(H5Dopen2(file, set.name.c_str(), H5P_DEFAULT), H5Dclose);
    Handle type(H5Dget_type(object), H5Tclose);

    Stored stored{path, set.name, axes_of(set, options.time_axis, what), {}};
    const Axes& axes = stored.axes;
    VolumeFile opened;
    opened.format = "HDF5";
    opened.files = {path};
    VolumeDesc& desc = opened.desc;
    desc.type = scalar_type(type, stored.wide, what);
    auto extent = [&](int axis) {
        if (axis < 0) return std::int64_t(1);
        if (set.dims[std::size_t(axis)] > hsize_t(1) << 48) fail("{} is too large", what);
        return std::int64_t(set.dims[std::size_t(axis)]);
    };
    desc.dims = {extent(axes.x), extent(axes.y), extent(axes.z)};
    desc.components = axes.component < 0 ? 1 : int(extent(axes.component));
    if (desc.components < 1) fail("{} has no components", what);
    opened.steps = extent(axes.time);
    if (opened.steps > kMostSteps) fail("{} claims {} time steps", what, opened.steps);
    std::string name = text_of(object, "name");
    desc.name = name.empty() ? set.name.substr(set.name.rfind('/') + 1) : name;

    // Lengths are listed in the order of the stored axes; one number stands for all.
    auto along_axes = [&](const std::vector<double>& v, glm::dvec3& lengths) {
        const int rank = axes.rank;
        auto pick = [&](int axis, int from_end) {
            if (axis < 0) return 1.0;
            if (v.size() == 1) return v[0];
            return int(v.size()) == rank ? v[std::size_t(axis)] : v[v.size() - std::size_t(from_end)];
        };
        if (v.size() != 1 && v.size() != 3 && int(v.size()) != rank) return false;
        lengths = {pick(axes.x, 1), pick(axes.y, std::min<int>(2, int(v.size()))),
                   pick(axes.z, std::min<int>(3, int(v.size())))};
        return true;
    };
    glm::dvec3 spacing(1), origin(0);
    if (along_axes(numbers_of(object, "element_size_um"), spacing)) desc.unit = "um";
    else if (along_axes(numbers_of(object, "spacing"), spacing)) desc.unit = text_of(object, "unit");
    along_axes(numbers_of(object, "origin"), origin);
    desc.index_to_world = world_matrix(glm::dmat3(1), spacing, origin, opened.warnings);
    desc.dense_bytes();
    if (axes.time >= 0) {
        opened.times = numbers_of(object, "times");
        if (std::int64_t(opened.times.size()) != opened.steps) opened.times.clear();
        opened.time_unit = text_of(object, "time_unit");
    }
    // Contiguous data has its place in the file: what is cut off shows at once.
    Handle creation(H5Dget_create_plist(object), H5Pclose);
    if (H5Pget_layout(creation) == H5D_CONTIGUOUS && H5Pget_external_count(creation) == 0) {
        const haddr_t at = H5Dget_offset(object);
        std::uint64_t size = fs::file_size(path), bytes = H5Dget_storage_size(object);
        if (at != HADDR_UNDEF && (at > size || bytes > size - at))
            fail("{} is cut short: {} bytes of the dataset lie behind its end; copy it again from its "
                 "source", path.string(), at > size ? bytes : bytes - (size - at));
    }
    opened.volume = [desc, stored](std::int64_t step) {
        return std::make_shared<Hdf5Volume>(desc, stored, step);
    };
    return opened;
}

}  // namespace voxloom

#endif
