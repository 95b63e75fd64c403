#include "plugins/writers/volume_header.h"

#include <algorithm>
#include <bit>

#include "core/base/text.h"
#include "core/graph/params.h"
#include "core/base/output_file.h"

namespace voxloom {

namespace {

constexpr bool kBigEndian = std::endian::native == std::endian::big;

// "a b c": shortest exact numbers, whatever the locale.
std::string words(glm::dvec3 v) {
    return shortest(v.x) + " " + shortest(v.y) + " " + shortest(v.z);
}
std::string vector(glm::dvec3 v) {
    return "(" + shortest(v.x) + "," + shortest(v.y) + "," + shortest(v.z) + ")";
}
std::string list(glm::dvec3 v) {
    return "[" + shortest(v.x) + ", " + shortest(v.y) + ", " + shortest(v.z) + "]";
}
std::string sizes(Index3 n) {
    return std::to_string(n.x) + " " + std::to_string(n.y) + " " + std::to_string(n.z);
}

// A header is made of lines: what would end one becomes a blank.
std::string one_line(std::string text) {
    std::replace_if(
        text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, ' ');
    return text;
}

glm::dvec3 axis(const VolumeDesc& desc, int a) {
    return glm::dvec3(desc.index_to_world[a]);
}

// Unit vector along an axis; the axis itself where it has no length.
glm::dvec3 direction(const VolumeDesc& desc, int a) {
    glm::dvec3 v = axis(desc, a), unit(0.0);
    unit[a] = 1;
    const double length = desc.spacing()[a];
    return length > 0 ? v / length : unit;
}

}  // namespace

std::optional<VolumeFormat> volume_format_of(const std::filesystem::path& path) {
    const std::string extension = extension_of(path);
    if (extension == ".nrrd") return VolumeFormat::nrrd;
    if (extension == ".nhdr") return VolumeFormat::nhdr;
    if (extension == ".mha") return VolumeFormat::mha;
    if (extension == ".mhd") return VolumeFormat::mhd;
    if (extension == ".raw") return VolumeFormat::raw;
    return std::nullopt;
}

// teem.sourceforge.net/nrrd/format.html
std::string nrrd_header(const VolumeDesc& desc, bool gzip, const std::string& data_file) {
    constexpr const char* types[] = {"uint8",  "int8",  "uint16", "int16",
                                     "uint32", "int32", "float",  "double"};
    const bool several = desc.components > 1;
    std::string text = "NRRD0005\n# written by voxloom\n";
    auto line = [&](const char* field, const std::string& value) {
        text += std::string(field) + ": " + value + "\n";
    };
    line("type", types[std::size_t(desc.type)]);
    line("dimension", several ? "4" : "3");
    if (!desc.name.empty()) line("content", one_line(desc.name));
    line("space dimension", "3");
    line("sizes", (several ? std::to_string(desc.components) + " " : "") + sizes(desc.dims));
    line("space directions", std::string(several ? "none " : "") + vector(axis(desc, 0)) + " " +
                                 vector(axis(desc, 1)) + " " + vector(axis(desc, 2)));
    const char* kind = !several               ? ""
                       : !desc.color          ? "vector "
                       : desc.components == 4 ? "RGBA-color "
                                              : "RGB-color ";
    line("kinds", std::string(kind) + "domain domain domain");
    if (!desc.unit.empty()) {
        std::string unit = one_line(desc.unit);
        std::replace(unit.begin(), unit.end(), '"', '\'');
        line("space units", "\"" + unit + "\" \"" + unit + "\" \"" + unit + "\"");
    }
    line("space origin", vector(desc.origin()));
    line("encoding", gzip ? "gzip" : "raw");
    if (bytes_of(desc.type) > 1) line("endian", kBigEndian ? "big" : "little");
    if (!data_file.empty()) line("data file", data_file);
    if (desc.significant_bits > 0)
        text += "significant_bits:=" + std::to_string(desc.significant_bits) + "\n";
    return text + "\n";
}

std::string meta_header(const VolumeDesc& desc, const std::string& data_file) {
    constexpr const char* types[] = {"MET_UCHAR", "MET_CHAR", "MET_USHORT", "MET_SHORT",
                                     "MET_UINT",  "MET_INT",  "MET_FLOAT",  "MET_DOUBLE"};
    std::string text;
    auto line = [&](const char* key, const std::string& value) {
        text += std::string(key) + " = " + value + "\n";
    };
    line("ObjectType", "Image");
    line("NDims", "3");
    line("BinaryData", "True");
    line("BinaryDataByteOrderMSB", kBigEndian ? "True" : "False");
    line("CompressedData", "False");
    line("TransformMatrix", words(direction(desc, 0)) + " " + words(direction(desc, 1)) + " " +
                                words(direction(desc, 2)));
    line("Offset", words(desc.origin()));
    line("CenterOfRotation", "0 0 0");
    line("ElementSpacing", words(desc.spacing()));
    line("DimSize", sizes(desc.dims));
    if (desc.components > 1) line("ElementNumberOfChannels", std::to_string(desc.components));
    line("ElementType", types[std::size_t(desc.type)]);
    line("ElementDataFile", data_file.empty() ? "LOCAL" : data_file);  // must be the last line
    return text;
}

std::string raw_sidecar(const VolumeDesc& desc, bool gzip) {
    std::string text = "# Describes the raw voxels beside it; written by voxloom.\n";
    auto line = [&](const char* key, const std::string& value) {
        text += std::string(key) + ": " + value + "\n";
    };
    line("dims", "[" + std::to_string(desc.dims.x) + ", " + std::to_string(desc.dims.y) + ", " +
                     std::to_string(desc.dims.z) + "]");
    line("type", std::string(name_of(desc.type)));
    line("endianness", kBigEndian ? "big" : "little");
    line("components", std::to_string(desc.components));
    if (desc.color) line("color", "true");
    line("spacing", list(desc.spacing()));
    line("origin", list(desc.origin()));
    std::string columns;
    for (int a = 0; a < 3; ++a) {
        const std::string one = list(direction(desc, a));
        columns += (a ? ", " : "") + one.substr(1, one.size() - 2);
    }
    line("direction", "[" + columns + "]");
    line("offset", "0");
    if (gzip) line("compression", "gzip");
    if (!desc.unit.empty()) line("unit", to_yaml(desc.unit));
    if (!desc.name.empty()) line("name", to_yaml(desc.name));
    if (desc.significant_bits > 0) line("significant_bits", std::to_string(desc.significant_bits));
    return text;
}

}  // namespace voxloom
