// NRRD, MetaImage, NIfTI and TIFF through ITK's image IO classes, used directly, without factories.
#include <fmt/format.h>

#include "core/base/error.h"
#include "volume_file.h"

#if !VOXLOOM_WITH_ITK

namespace voxloom {
namespace {
[[noreturn]] void without_itk(const std::filesystem::path& path) {
    fail("{} needs ITK, and this voxloom was built without ITK; install libinsighttoolkit5-dev and "
         "libtiff-dev and build again", path.string());
}
}  // namespace
VolumeFile open_itk_file(const std::filesystem::path& path, const std::string&) { without_itk(path); }
VolumeFile open_tiff_folder(const std::vector<std::filesystem::path>& slices) {
    without_itk(slices.front());
}
VolumeFile open_dicom(const std::filesystem::path& path, const std::string&) { without_itk(path); }
}  // namespace voxloom

#else

#include <itkMetaDataObject.h>
#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>
#include <itkTIFFImageIO.h>
#include <tiffio.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstdarg>

#include "core/base/text.h"
#include "itk_part.h"
#include "loaded.h"
#include "text_header.h"

// ITK reads TIFF with a libtiff of its own, whose symbols are renamed and whose headers are not
// installed. It talks to the terminal unless told not to.
extern "C" {
using ItkTiffHandler = void (*)(const char*, const char*, std::va_list);
ItkTiffHandler itk_TIFFSetWarningHandler(ItkTiffHandler);
ItkTiffHandler itk_TIFFSetErrorHandler(ItkTiffHandler);
}

namespace voxloom {

namespace fs = std::filesystem;

std::mutex& itk_mutex() {
    static std::mutex mutex;
    return mutex;
}

std::string sentence_of(const itk::ExceptionObject& e) {
    // "ITK ERROR: NrrdImageIO(0x...): Read: Error reading a.nrrd:\n[nrrd] outer: ...\n[nrrd] inner: why"
    std::string text = e.GetDescription();
    while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.pop_back();
    if (std::size_t line = text.rfind('\n'); line != std::string::npos) text.erase(0, line + 1);
    if (std::size_t bracket = text.find("] "); text.starts_with('[') && bracket != std::string::npos) {
        text.erase(0, bracket + 2);
        if (std::size_t colon = text.find(": "); colon != std::string::npos) text.erase(0, colon + 2);
    }
    if (text.starts_with("ITK ERROR: ")) text.erase(0, 11);
    if (std::size_t close = text.find("): "); close != std::string::npos && text.find("(0x") < close)
        text.erase(0, close + 3);
    return text.empty() ? "ITK cannot read it" : text;
}

void with_itk(const fs::path& path, const std::function<void()>& f) {
    std::lock_guard lock(itk_mutex());
    itk::Object::SetGlobalWarningDisplay(false);
    itk_TIFFSetWarningHandler(nullptr);
    itk_TIFFSetErrorHandler(nullptr);
    try {
        f();
    } catch (const itk::ExceptionObject& e) {
        fail("{} cannot be read: {}", path.string(), sentence_of(e));
    } catch (const std::bad_alloc&) {
        fail("{} cannot be read: there is not enough memory for what its header says", path.string());
    }
}

namespace {

using Component = itk::IOComponentEnum;

ScalarType scalar_type_of_component(Component component, Samples& samples, const fs::path& path) {
    auto wide = [&](bool is_signed) {
        samples.wide = is_signed ? Samples::Wide::i64 : Samples::Wide::u64;
        return ScalarType::f64;
    };
    switch (component) {
        case Component::UCHAR: return ScalarType::u8;
        case Component::CHAR: return ScalarType::i8;
        case Component::USHORT: return ScalarType::u16;
        case Component::SHORT: return ScalarType::i16;
        case Component::UINT: return ScalarType::u32;
        case Component::INT: return ScalarType::i32;
        case Component::FLOAT: return ScalarType::f32;
        case Component::DOUBLE: return ScalarType::f64;
        case Component::ULONG: return sizeof(long) == 4 ? ScalarType::u32 : wide(false);
        case Component::LONG: return sizeof(long) == 4 ? ScalarType::i32 : wide(true);
        case Component::ULONGLONG: return wide(false);
        case Component::LONGLONG: return wide(true);
        default: break;
    }
    fail("{}: its voxels are of a type that is not known here ({}); convert them to integers of up "
         "to 32 bits or to floats", path.string(), itk::ImageIOBase::GetComponentTypeAsString(component));
}

}  // namespace

ItkImage image_of(const itk::ImageIOBase& io, const fs::path& path) {
    ItkImage image;
    VolumeDesc& desc = image.desc;
    const unsigned axes = io.GetNumberOfDimensions();
    desc.dims = Index3(1);
    glm::dmat3 direction(1);
    glm::dvec3 spacing(1), origin(0);
    for (unsigned a = 0; a < axes; ++a) {
        // ITK counts in unsigned 64 bits; what is beyond the signed ones is not a size.
        if (io.GetDimensions(a) > std::uint64_t(1) << 48)
            fail("{}: the header claims {} voxels along axis {}", path.string(), io.GetDimensions(a), a);
        const auto n = std::int64_t(io.GetDimensions(a));
        if (a >= 3) {
            image.outer.push_back(n);
            continue;
        }
        desc.dims[int(a)] = n;
        spacing[int(a)] = io.GetSpacing(a);
        origin[int(a)] = io.GetOrigin(a);
        const std::vector<double> axis = io.GetDirection(a);
        for (unsigned i = 0; i < 3; ++i)
            direction[int(a)][int(i)] = i < axis.size() && i < axes ? axis[i] : double(i == a);
    }
    if (axes > 3) {
        image.outer_spacing = io.GetSpacing(3);
        image.outer_origin = io.GetOrigin(3);
    }
    while (!image.outer.empty() && image.outer.back() == 1) image.outer.pop_back();
    // A plane's third axis completes its two.
    if (axes == 2) direction[2] = glm::cross(direction[0], direction[1]);
    desc.index_to_world = world_matrix(direction, spacing, origin, image.warnings);
    desc.type = scalar_type_of_component(io.GetComponentType(), image.samples, path);
    if (io.GetNumberOfComponents() < 1 || io.GetNumberOfComponents() > 4)
        fail("{}: it has {} components a voxel where 1 to 4 can be read; split them into volumes of "
             "their own", path.string(), io.GetNumberOfComponents());
    desc.components = int(io.GetNumberOfComponents());
    using Pixel = itk::IOPixelEnum;
    desc.color = (io.GetPixelType() == Pixel::RGB && desc.components == 3) ||
                 (io.GetPixelType() == Pixel::RGBA && desc.components == 4);
    desc.name = stem_of(path);
    return image;
}

void read_all(itk::ImageIOBase& io, std::span<std::byte> out, const fs::path& path) {
    const unsigned axes = io.GetNumberOfDimensions();
    itk::ImageIORegion region(axes);
    for (unsigned a = 0; a < axes; ++a) region.SetSize(a, io.GetDimensions(a));
    io.SetIORegion(region);
    if (std::uint64_t(io.GetImageSizeInBytes()) != out.size())
        fail("{} has changed while it was used; run again", path.string());
    if (!out.empty()) io.Read(out.data());
}

namespace {

itk::ImageIOBase::Pointer make_io(const std::string& format) {
    if (format == "nrrd") return itk::NrrdImageIO::New().GetPointer();
    if (format == "meta") return itk::MetaImageIO::New().GetPointer();
    if (format == "nifti") return itk::NiftiImageIO::New().GetPointer();
    return itk::TIFFImageIO::New().GetPointer();
}

// The first thing that libtiff complained of since it was emptied. Guarded by itk_mutex().
std::string& tiff_complaint() {
    static std::string text;
    return text;
}

void keep_tiff_complaint(const char*, const char* format, std::va_list arguments) {
    char text[200];
    std::vsnprintf(text, sizeof text, format, arguments);
    if (tiff_complaint().empty()) tiff_complaint() = text;
}

// Walks through the pages: every one is there, and all of its strips or tiles lie inside the file.
// ITK itself reads what it can of a file that is cut short, and says nothing.
void check_tiff(const fs::path& path) {
    TIFFSetWarningHandler(nullptr);
    TIFFSetErrorHandler(keep_tiff_complaint);
    tiff_complaint().clear();
    const std::uint64_t size = fs::file_size(path);
    std::unique_ptr<TIFF, void (*)(TIFF*)> tiff(TIFFOpen(path.c_str(), "r"), TIFFClose);
    if (!tiff) fail("{} is not a TIFF file, or its header is cut short", path.string());
    std::size_t page = 0;
    do {
        const std::uint32_t parts = TIFFIsTiled(tiff.get()) ? TIFFNumberOfTiles(tiff.get())
                                                            : TIFFNumberOfStrips(tiff.get());
        for (std::uint32_t i = 0; i < parts; ++i) {
            const std::uint64_t at = TIFFGetStrileOffset(tiff.get(), i);
            const std::uint64_t bytes = TIFFGetStrileByteCount(tiff.get(), i);
            if (at > size || bytes > size - at)
                fail("{} is cut short: voxels of page {} lie behind its end; copy it again from its "
                     "source", path.string(), page);
            if (!tiff_complaint().empty()) break;
        }
        ++page;
    } while (tiff_complaint().empty() && TIFFReadDirectory(tiff.get()));
    if (!tiff_complaint().empty())
        fail("{} is cut short or damaged after {} pages: {}", path.string(), page, tiff_complaint());
}

itk::ImageIOBase::Pointer opened(const std::string& format, const fs::path& path) {
    itk::ImageIOBase::Pointer io = make_io(format);
    if (format == "tiff") check_tiff(path);
    io->SetFileName(path.string());
    io->ReadImageInformation();
    return io;
}

// What of a file's length is known beforehand; while it is packed, only that it cannot be enough.
void check_length(const Layout& layout) {
    if (layout.least_bytes == 0) return;
    StoredVoxels whole;
    whole.pieces = {{layout.data, 0}};
    whole.packed = layout.packed;
    check_size(whole, layout.least_bytes);
}

// Unpacks the stream to its end, keeping nothing: niftilib fills what is missing with zeros.
void check_unpacked_length(const Layout& layout, const std::stop_token& stop) {
    if (!layout.packed || layout.least_bytes == 0) return;
    StoredVoxels whole;
    whole.pieces = {{layout.data, 0}};
    whole.packed = true;
    PackedSteps(whole, 1, 1).skip_through(layout.least_bytes, stop);
}

// The whole of what ITK reads, shared by the steps while any of them lives.
std::function<VolumePtr(std::int64_t)> served_by_itk(const VolumeDesc& desc, std::int64_t steps,
                                                     const std::string& format, const fs::path& path,
                                                     const Samples& samples, const Layout& layout) {
    struct Shared {
        std::mutex mutex;
        std::weak_ptr<LoadOnce> source;
    };
    auto shared = std::make_shared<Shared>();
    return [=](std::int64_t step) {
        std::lock_guard lock(shared->mutex);
        std::shared_ptr<LoadOnce> source = shared->source.lock();
        if (!source) {
            source = std::make_shared<LoadOnce>(
                desc.dense_bytes() * std::uint64_t(steps), desc.name,
                [=](std::span<std::byte> out, const std::stop_token& stop) {
                    check_unpacked_length(layout, stop);
                    with_itk(path, [&] { read_all(*opened(format, path), out, path); });
                    check_stop(stop);
                    to_native(out, bytes_of(desc.type), samples, path);
                });
            shared->source = source;
        }
        return loaded_volume(desc, source, desc.dense_bytes() * std::uint64_t(step));
    };
}

// The unpacked beginning of a file that may be a gzip stream.
std::string unpacked_head(const fs::path& path, std::size_t most, bool& packed) {
    std::string head = read_head(path, most);
    packed = std::string_view(head).starts_with("\x1f\x8b");
    if (!packed) return head;
    gzFile in = gzopen(path.c_str(), "rb");
    if (!in) fail("{} cannot be opened", path.string());
    head.assign(most, '\0');
    int n = gzread(in, head.data(), unsigned(most));
    gzclose(in);
    head.resize(std::size_t(std::max(n, 0)));
    return head;
}

// The .hdr that goes with an .img.
fs::path header_of(const fs::path& path) {
    fs::path stem = path;
    if (lower(stem.extension().string()) == ".gz") stem.replace_extension();
    if (lower(stem.extension().string()) != ".img") return path;
    for (const char* extension : {".hdr", ".hdr.gz"})
        if (fs::path header = fs::path(stem).replace_extension(extension); fs::exists(header))
            return header;
    fail("{}: its header {} is not there", path.string(),
         fs::path(stem).replace_extension(".hdr").string());
}

// What the format's own header says beyond ITK: units, name, times.
struct Words {
    std::string unit = "mm", name, time_unit;
};

Words words_of(const NrrdHeader& header) {
    Words words;
    auto usable = [](const std::string& unit) { return !unit.empty() && unit != "none" && unit != "???"; };
    const auto space = header.words("spaceunits"), axes = header.words("units");
    words.unit.clear();
    if (!space.empty() && usable(space[0])) words.unit = space[0];
    else if (!axes.empty() && usable(axes[0])) words.unit = axes[0];
    else if (auto named = header.fields.find("space");
             named != header.fields.end() && lower(named->second).find("left") != std::string::npos)
        words.unit = "mm";  // anatomical spaces are in millimetres
    if (axes.size() == 4 && usable(axes[3])) words.time_unit = axes[3];
    if (auto content = header.fields.find("content"); content != header.fields.end())
        words.name = content->second;
    return words;
}

}  // namespace

VolumeFile open_itk_file(const fs::path& given, const std::string& format) {
    VolumeFile file;
    Words words;
    Layout layout;
    fs::path path = given;

    NrrdHeader nrrd;
    // The header is looked at before ITK sees the file, so that what is no such file is said plainly.
    if (format == "nrrd") {
        nrrd = parse_nrrd_header(read_head(path, kMostHeader), path);
        words = words_of(nrrd);
        file.format = "NRRD";
    } else if (format == "meta") {
        layout = meta_layout(parse_meta_header(read_head(path, kMostHeader), path), path);
        file.format = "MetaImage";
    } else if (format == "nifti") {
        path = header_of(given);
        bool packed = false;
        std::string head = unpacked_head(path, 352, packed);
        layout = nifti_layout(head, path, packed);
        words.time_unit = "s";
        file.format = "NIfTI";
    } else {
        layout.files = {path};
        file.format = "TIFF";
    }

    ItkImage image;
    with_itk(path, [&] {
        itk::ImageIOBase::Pointer io = opened(format, path);
        image = image_of(*io, path);
    });
    if (image.outer.size() > 1)
        fail("{}: it has {} axes; volumes have three, and series a fourth, time", path.string(),
             image.outer.size() + 3);
    const std::int64_t steps = image.outer.empty() ? 1 : image.outer[0];
    const std::uint64_t bytes = checked_product(image.desc.dims, image.desc.voxel_bytes(), path.string());
    if (steps > kMostSteps || bytes > (std::uint64_t(1) << 62) / std::uint64_t(std::max<std::int64_t>(steps, 1)))
        fail("{}: the header claims {} time steps of {}, more than fit in 63 bits", path.string(), steps,
             human_bytes(double(bytes)));
    if (format == "nrrd")
        layout = nrrd_layout(nrrd, path, image.desc.components,
                             bytes / bytes_of(image.desc.type) * std::uint64_t(steps),
                             bytes_of(image.desc.type));
    // MetaImage has no word for colours: ITK calls any three channels RGB.
    if (format == "meta") image.desc.color = image.desc.color && bytes_of(image.desc.type) <= 2;
    if (format == "tiff" && image.desc.spacing() == glm::dvec3(1)) words.unit.clear();

    file.desc = image.desc;
    file.desc.unit = words.unit;
    if (!words.name.empty()) file.desc.name = words.name;
    file.warnings = image.warnings;
    file.files = layout.files;
    file.steps = steps;
    if (!image.outer.empty()) {
        file.time_unit = words.time_unit;
        double spacing = image.outer_spacing;
        if (!std::isfinite(spacing) || spacing <= 0) spacing = 1;
        double first = std::isfinite(image.outer_origin) ? image.outer_origin : 0;
        for (std::int64_t t = 0; t < file.steps; ++t) file.times.push_back(first + double(t) * spacing);
    }
    if (layout.voxels) {
        layout.voxels->samples.wide = image.samples.wide;
        serve_stored(file, std::move(*layout.voxels));
    } else {
        check_length(layout);
        file.volume = served_by_itk(file.desc, file.steps, format, path, image.samples, layout);
    }
    return file;
}

VolumeFile open_tiff_folder(const std::vector<fs::path>& slices) {
    if (slices.size() == 1) return open_itk_file(slices.front(), "tiff");
    VolumeFile file;
    file.format = "TIFF slices";
    file.files = slices;
    file.files.insert(file.files.begin(), slices.front().parent_path());
    ItkImage first;
    with_itk(slices.front(), [&] { first = image_of(*opened("tiff", slices.front()), slices.front()); });
    if (first.desc.dims.z != 1)
        fail("{} has {} pages itself, so the folder is no stack of slices; read it with "
             "readers.series, or name one file", slices.front().string(), first.desc.dims.z);
    file.desc = first.desc;
    file.desc.dims.z = std::int64_t(slices.size());
    file.desc.name = slices.front().parent_path().filename().string();
    if (first.desc.spacing() != glm::dvec3(1)) {
        file.desc.unit = "mm";
        file.warnings.push_back("TIFF says nothing of the distance between slices: it is taken as 1 mm");
    }
    file.warnings.insert(file.warnings.end(), first.warnings.begin(), first.warnings.end());
    auto read_slice = [desc = first.desc, samples = first.samples, slices](std::int64_t z,
                                                                           std::span<std::byte> out) {
        const fs::path& path = slices[std::size_t(z)];
        with_itk(path, [&] {
            itk::ImageIOBase::Pointer io = opened("tiff", path);
            const ItkImage slice = image_of(*io, path);
            if (slice.desc.dims != desc.dims || slice.desc.type != desc.type ||
                slice.desc.components != desc.components)
                fail("{} is {}, the first slice is {}; slices of a stack must be alike",
                     path.string(), summary(slice.desc), summary(desc));
            read_all(*io, out, path);
        });
        to_native(out, bytes_of(desc.type), samples, path);
    };
    file.volume = [desc = file.desc, read_slice](std::int64_t) { return slice_volume(desc, read_slice); };
    return file;
}

}  // namespace voxloom

#endif
