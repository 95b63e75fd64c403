// DICOM: one file, or a folder with the slices of a series.
//
// All headers of a folder are walked for the few values that place a slice (dicom_header.h). A series' slices
// are put in order along their common normal by their position, never by name or number. The matrix's
// third column is the step from slice to slice as it is, so a tilted gantry gives a sheared grid.
// Voxels come through ITK's GDCMImageIO, which applies rescale slope and intercept.
#if VOXLOOM_WITH_ITK

#include <fmt/format.h>
#include <gdcmTrace.h>
#include <itkGDCMImageIO.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>

#include "core/base/error.h"
#include "core/base/text.h"
#include "dicom_header.h"
#include "itk_part.h"
#include "loaded.h"

namespace voxloom {

namespace fs = std::filesystem;

namespace {

using Header = DicomHeader;

struct Slice {
    fs::path path;
    DicomHeader header;
    double along = 0;  // position on the normal
};

// Those of `files` that are DICOM images.
std::vector<Slice> scan(const std::vector<fs::path>& files) {
    std::vector<Slice> slices;
    for (const fs::path& file : files) {
        if (!is_dicom(file)) continue;
        std::ifstream in(file, std::ios::binary);
        Slice slice{file, parse_dicom_header(in, file)};
        if (slice.header.has_pixels) slices.push_back(std::move(slice));
    }
    return slices;
}

// The series that was asked for, or the only one.
std::vector<Slice> one_series(std::vector<Slice> slices, const fs::path& folder,
                              const std::string& asked) {
    std::map<std::string, std::vector<Slice>> series;
    for (Slice& slice : slices) series[slice.header.text(Header::kSeriesUid)].push_back(std::move(slice));
    if (!asked.empty())
        if (auto it = series.find(asked); it != series.end()) return std::move(it->second);
    if (asked.empty() && series.size() == 1) return std::move(series.begin()->second);
    std::vector<std::string> list;
    for (const auto& [uid, members] : series)
        list.push_back(fmt::format("{} ({}{} slices)", uid,
                                   members[0].header.text(Header::kSeriesName).empty()
                                       ? ""
                                       : "'" + members[0].header.text(Header::kSeriesName) + "', ",
                                   members.size()));
    if (asked.empty())
        fail("{} holds {} series; set 'series_uid' to one of them: {}", folder.string(),
             series.size(), join(list, "; "));
    fail("{} holds no series {}; there is {}", folder.string(), asked, join(list, "; "));
}

// Bits that hold every value that `stored` bits can take after adding the intercept; 0: unknown.
int significant_bits(const Slice& slice, ScalarType type) {
    const auto stored = int(slice.header.number(Header::kBitsStored, 0));
    const double slope = slice.header.number(Header::kSlope, 1), intercept = slice.header.number(Header::kIntercept, 0);
    if (stored < 1 || stored > 32 || slope != 1 || intercept != std::floor(intercept) || is_float(type))
        return 0;
    const bool is_signed = slice.header.number(Header::kSigned, 0) != 0;
    const double span = std::exp2(stored);
    const double lo = (is_signed ? -span / 2 : 0) + intercept, hi = lo + span - 1;
    int bits = lo < 0 ? 1 : 0;
    while (hi > std::exp2(lo < 0 ? bits - 1 : bits) - 1 || lo < -std::exp2(bits - 1)) ++bits;
    return bits < int(8 * bytes_of(type)) ? bits : 0;
}

itk::ImageIOBase::Pointer opened(const fs::path& path) {
    auto io = itk::GDCMImageIO::New();
    io->SetFileName(path.string());
    io->ReadImageInformation();
    return io.GetPointer();
}

// Order along the normal, spacing and the matrix. Without positions: order of instance numbers.
void place(std::vector<Slice>& slices, VolumeFile& file, const fs::path& folder) {
    const auto n = std::int64_t(slices.size());
    auto orientation = slices[0].header.numbers(Header::kOrientation, 6);
    bool placed = !orientation.empty();
    for (const Slice& slice : slices) {
        placed = placed && !slice.header.numbers(Header::kPosition, 3).empty();
        auto other = slice.header.numbers(Header::kOrientation, 6);
        for (std::size_t i = 0; placed && i < 6; ++i)
            if (other.size() != 6 || std::abs(other[i] - orientation[i]) > 1e-3)
                fail("{} is turned against {}; slices of one volume must be parallel, so take the "
                     "localizers out of the folder", slice.path.string(), slices[0].path.string());
    }
    auto pixel = slices[0].header.numbers(Header::kPixelSpacing, 2);
    if (pixel.empty()) {
        file.warnings.push_back("no pixel spacing is given: it is taken as 1");
        pixel = {1, 1};
    } else {
        file.desc.unit = "mm";
    }
    double thickness = slices[0].header.number(Header::kThickness, 1);
    if (!(thickness > 0)) thickness = 1;

    if (!placed) {
        std::stable_sort(slices.begin(), slices.end(), [](const Slice& a, const Slice& b) {
            return a.header.number(Header::kNumber, 0) < b.header.number(Header::kNumber, 0);
        });
        if (n > 1)
            file.warnings.push_back("the slices do not say where they are: they are taken in the order "
                                    "of their instance numbers, one slice thickness apart");
        file.desc.index_to_world = world_matrix(glm::dmat3(1), {pixel[1], pixel[0], thickness},
                                                glm::dvec3(0), file.warnings);
        return;
    }
    const glm::dvec3 x(orientation[0], orientation[1], orientation[2]);
    const glm::dvec3 y(orientation[3], orientation[4], orientation[5]);
    const glm::dvec3 normal = glm::normalize(glm::cross(x, y));
    auto position = [](const Slice& slice) {
        auto p = slice.header.numbers(Header::kPosition, 3);
        return glm::dvec3(p[0], p[1], p[2]);
    };
    for (Slice& slice : slices) slice.along = glm::dot(position(slice), normal);
    std::stable_sort(slices.begin(), slices.end(),
                     [](const Slice& a, const Slice& b) { return a.along < b.along; });

    glm::dvec3 step = normal * thickness;
    if (n > 1) {
        std::vector<double> gaps;
        for (std::size_t i = 1; i < slices.size(); ++i) {
            gaps.push_back(slices[i].along - slices[i - 1].along);
            if (gaps.back() < 1e-4)
                fail("{} and {} stand at the same place; {} holds several volumes (times, echoes) in "
                     "one series, so put each into a folder of its own", slices[i - 1].path.string(),
                     slices[i].path.string(), folder.string());
        }
        std::vector<double> sorted = gaps;
        std::nth_element(sorted.begin(), sorted.begin() + std::ptrdiff_t(sorted.size() / 2), sorted.end());
        const double usual = sorted[sorted.size() / 2];
        std::int64_t missing = 0, uneven = 0;
        for (double gap : gaps) {
            if (std::abs(gap - usual) <= 0.01 * usual) continue;
            const double times = std::round(gap / usual);
            if (times >= 2 && std::abs(gap - times * usual) <= 0.05 * usual) missing += std::int64_t(times) - 1;
            else ++uneven;
        }
        if (missing)
            file.warnings.push_back(fmt::format(
                "{} slices are missing among {} in {}: the ones there are spread evenly over the "
                "whole length", missing, n, folder.string()));
        if (uneven)
            file.warnings.push_back(fmt::format(
                "{} of the {} distances between slices in {} differ from the usual {}: the slices are "
                "spread evenly over the whole length", uneven, n - 1, folder.string(), shortest(usual)));
        step = (position(slices.back()) - position(slices.front())) / double(n - 1);
    }
    glm::dmat3 direction(x, y, glm::normalize(step));
    file.desc.index_to_world = world_matrix(direction, {pixel[1], pixel[0], glm::length(step)},
                                            position(slices.front()), file.warnings);
}

VolumeFile open_folder(const fs::path& folder, std::vector<Slice> slices) {
    VolumeFile file;
    file.format = "DICOM series";
    for (const Slice& slice : slices) {
        if (slice.header.number(Header::kFrames, 1) > 1)
            fail("{} holds {} frames itself; name that file instead of the folder",
                 slice.path.string(), slice.header.text(Header::kFrames));
        if (slice.header.text(Header::kRows) != slices[0].header.text(Header::kRows) || slice.header.text(Header::kColumns) != slices[0].header.text(Header::kColumns))
            fail("{} is {} x {}, {} is {} x {}; slices of one volume must be alike",
                 slice.path.string(), slice.header.text(Header::kColumns), slice.header.text(Header::kRows),
                 slices[0].path.string(), slices[0].header.text(Header::kColumns), slices[0].header.text(Header::kRows));
    }
    ItkImage first;
    with_itk(slices[0].path, [&] { first = image_of(*opened(slices[0].path), slices[0].path); });
    file.desc = first.desc;
    file.desc.dims.z = std::int64_t(slices.size());
    place(slices, file, folder);

    // ITK picks a slice's type from its rescale; where that differs from slice to slice (PET), only
    // a float holds them all.
    bool alike = true;
    for (const Slice& slice : slices)
        for (Header::Tag tag : {Header::kSlope, Header::kIntercept, Header::kBitsStored, Header::kSigned})
            alike = alike && slice.header.text(tag) == slices[0].header.text(tag);
    if (!alike) file.desc.type = ScalarType::f32;
    else file.desc.significant_bits = significant_bits(slices[0], file.desc.type);
    const std::string name = slices[0].header.text(Header::kSeriesName);
    file.desc.name = name.empty() ? folder.filename().string() : name;

    std::vector<fs::path> paths;
    for (const Slice& slice : slices) paths.push_back(slice.path);
    file.files = paths;
    file.files.insert(file.files.begin(), folder);
    file.volume = [desc = file.desc, paths](std::int64_t) {
        return slice_volume(desc, [desc, paths](std::int64_t z, std::span<std::byte> out) {
            const fs::path& path = paths[std::size_t(z)];
            with_itk(path, [&] {
                itk::ImageIOBase::Pointer io = opened(path);
                const ItkImage slice = image_of(*io, path);
                const VolumeDesc& s = slice.desc;
                if (s.dims.x != desc.dims.x || s.dims.y != desc.dims.y || s.dims.z != 1 ||
                    s.components != desc.components || (s.type != desc.type && desc.type != ScalarType::f32))
                    fail("{} is {}, which does not fit {}", path.string(), summary(s), summary(desc));
                if (s.type == desc.type) return read_all(*io, out, path);
                Buffer own(s.dense_bytes(), "slice");
                read_all(*io, own.bytes(), path);
                float* to = reinterpret_cast<float*>(out.data());
                with_type(s.type, [&](auto t) {
                    for (auto v : own.as<decltype(t)>()) *to++ = float(v);
                });
            });
        });
    };
    return file;
}

VolumeFile open_one(const fs::path& path, const Slice& slice) {
    VolumeFile file;
    file.format = "DICOM";
    ItkImage image;
    with_itk(path, [&] { image = image_of(*opened(path), path); });
    if (!image.outer.empty()) fail("{}: it has more than three axes", path.string());
    file.desc = image.desc;
    file.desc.unit = "mm";
    file.desc.significant_bits = significant_bits(slice, file.desc.type);
    if (!slice.header.text(Header::kSeriesName).empty()) file.desc.name = slice.header.text(Header::kSeriesName);
    file.warnings = image.warnings;
    file.files = {path};
    file.volume = [desc = file.desc, path, samples = image.samples](std::int64_t) {
        return loaded_volume(desc, std::make_shared<LoadOnce>(
            desc.dense_bytes(), desc.name,
            [path, desc, samples](std::span<std::byte> out, const std::stop_token&) {
                with_itk(path, [&] { read_all(*opened(path), out, path); });
                to_native(out, bytes_of(desc.type), samples, path);
            }));
    };
    return file;
}

}  // namespace

VolumeFile open_dicom(const fs::path& path, const std::string& series_uid) {
    gdcm::Trace::DebugOff();
    gdcm::Trace::WarningOff();
    gdcm::Trace::ErrorOff();
    const bool folder = fs::is_directory(path);
    const std::vector<fs::path> files = folder ? files_in(path) : std::vector<fs::path>{path};
    std::vector<Slice> slices = scan(files);
    if (slices.empty() && folder)
        fail("{} is a folder without images: none of its {} files is DICOM or TIFF", path.string(),
             files.size());
    if (slices.empty()) fail("{} is not a DICOM image, or its header is cut short", path.string());
    if (folder) return open_folder(path, one_series(std::move(slices), path, series_uid));
    return open_one(path, slices[0]);
}

}  // namespace voxloom

#endif
