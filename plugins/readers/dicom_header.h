// The elements of a DICOM file, walked from end to end.
//
// GDCM stops the whole process on some files that are cut short or damaged (its checks are asserts,
// and Debian builds with them). So it only gets files whose every element, nested ones too, was seen
// here to lie inside the file; the values that place a slice are picked up on the way.
#pragma once

#include <cstdint>
#include <filesystem>
#include <istream>
#include <map>
#include <string>
#include <vector>

namespace voxloom {

struct DicomHeader {
    using Tag = std::uint32_t;  // group * 0x10000 + element
    static constexpr Tag kSeriesName = 0x0008103e, kThickness = 0x00180050, kSeriesUid = 0x0020000e,
                         kNumber = 0x00200013, kPosition = 0x00200032, kOrientation = 0x00200037,
                         kSamples = 0x00280002, kFrames = 0x00280008, kRows = 0x00280010,
                         kColumns = 0x00280011, kPixelSpacing = 0x00280030, kBitsAllocated = 0x00280100,
                         kBitsStored = 0x00280101, kSigned = 0x00280103, kIntercept = 0x00281052,
                         kSlope = 0x00281053;
    std::map<Tag, std::string> values;  // of the tags above, outside of sequences; numbers as text
    bool has_pixels = false;

    std::string text(Tag tag) const;  // without padding; empty when it is not there
    // Numbers between backslashes; empty unless there are `count` finite ones.
    std::vector<double> numbers(Tag tag, std::size_t count) const;
    double number(Tag tag, double otherwise) const;
};

// True when a file has DICOM's magic at its place.
bool is_dicom(const std::filesystem::path& path);
// Throws Error when the file ends inside an element, or is not built as DICOM is, or has fewer bytes
// of uncompressed pixels than its rows, columns and frames need.
DicomHeader parse_dicom_header(std::istream& in, const std::filesystem::path& path);

}  // namespace voxloom
