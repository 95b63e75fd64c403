// writers.image: pictures to PNG and EXR.
#include <fmt/format.h>

#include "core/graph/node.h"
#include "plugins/writers/image_codec.h"
#include "core/base/output_file.h"
#include "plugins/writers/writers.h"

namespace voxloom {

namespace {

enum class ImageFormat { png, exr, unknown };

ImageFormat format_of(const std::filesystem::path& path) {
    const std::string extension = extension_of(path);
    return extension == ".png"   ? ImageFormat::png
           : extension == ".exr" ? ImageFormat::exr
                                 : ImageFormat::unknown;
}

// 0 where the format does not have the depth asked for.
int bits_of(const std::string& asked, ImageFormat format) {
    if (asked == "auto") return format == ImageFormat::png ? 8 : 32;
    const int bits = asked == "8" ? 8 : asked == "16" ? 16 : 32;
    return bits == 16 || bits == (format == ImageFormat::png ? 8 : 32) ? bits : 0;
}

void describe_writing(Description& d) {
    const std::filesystem::path path = d.params().path("path");
    const ImageFormat format = format_of(path);
    const std::string& bits = d.params().text("bits");
    if (format == ImageFormat::unknown)
        return d.problem(
            fmt::format("'{}' has none of the extensions .png and .exr", path.string()), "path");
    if (format == ImageFormat::exr && !has_exr())
        return d.problem(
            "this build has no OpenEXR; install libopenexr-dev and build again, or write .png",
            "path");
    if (bits_of(bits, format) == 0)
        d.problem(format == ImageFormat::png ? "PNG has 8 or 16 bits a channel; write .exr for 32"
                                             : "EXR has 16 or 32 bits a channel; write .png for 8",
                  "bits");
    if (format == ImageFormat::exr && d.params().text("alpha") == "flatten")
        d.problem("EXR keeps the alpha; write .png to flatten the picture", "alpha");
}

void write_image(Evaluation& e) {
    const ImagePtr image = e.input<Image>("image");
    const std::filesystem::path path = e.output_path("path");
    const ImageFormat format = format_of(path);
    const int bits = bits_of(e.params().text("bits"), format);
    check_stop(e.stop());
    const std::string bytes = format == ImageFormat::png
                                  ? png_bytes(*image, {bits, e.params().text("alpha") == "flatten",
                                                       e.params().vec3("background")})
                                  : exr_bytes(*image, bits);
    check_stop(e.stop());
    OutputFile file(path);
    file.write(bytes);
    file.commit();
    e.measure("file size", double(bytes.size()), "B");
}

}  // namespace

void add_image_writer(Registry& registry) {
    NodeType type;
    type.id = "writers.image";
    type.title = "Write image";
    type.doc = "Writes a picture as PNG, or as EXR where its floats are to be kept.";
    type.keywords = {"save", "export", "file", "png", "exr", "picture"};
    type.inputs = {{"image", PortType::image, "The picture to write."}};
    type.params = {
        param::path_out("path", "image.png",
                        "The file; its extension is the format: .png or .exr."),
        param::choice(
            "bits", {"auto", "8", "16", "32"}, "auto",
            "Bits a channel: 8 or 16 in PNG (auto: 8), 16 or 32, as floats, in EXR (auto: 32)."),
        param::choice(
            "alpha", {"keep", "flatten"}, "keep",
            "Keep the alpha, or lay the picture over the background and write none (PNG)."),
        param::color("background", {0, 0, 0}, "What a flattened picture lies over.")
            .shown_if("alpha", {"flatten"}),
    };
    type.writes_files = true;
    type.method =
        R"(Pictures are premultiplied inside. PNG stores straight alpha, so colours are divided by alpha and
rounded; values outside of 0 to 1 are clamped, NaN becomes 0. EXR stores premultiplied floats as they
are, and the depth as channel Z where the picture has one: take it when the file is to be measured.
The same picture gives the same bytes.)";
    type.describe = describe_writing;
    type.evaluate = write_image;
    registry.add(std::move(type));
}

}  // namespace voxloom
