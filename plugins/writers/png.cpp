#include <png.h>

#include <cmath>
#include <csetjmp>
#include <vector>

#include "core/base/error.h"
#include "plugins/writers/image_codec.h"

namespace voxloom {

namespace {

// Everything libpng calls back into. Its errors leave by longjmp, so nothing here may throw.
struct PngTarget {
    std::string bytes;
    char message[200] = "";
};

void append(png_structp png, png_bytep data, png_size_t size) {
    auto* target = static_cast<PngTarget*>(png_get_io_ptr(png));
    bool room = true;
    try {
        target->bytes.append(reinterpret_cast<const char*>(data), size);
    } catch (...) {
        room = false;
    }
    if (!room) png_error(png, "out of memory");
}

void on_error(png_structp png, png_const_charp message) {
    auto* target = static_cast<PngTarget*>(png_get_error_ptr(png));
    std::snprintf(target->message, sizeof target->message, "%s", message);
    png_longjmp(png, 1);
}

void on_warning(png_structp, png_const_charp) {}

// No object with a destructor lives in the frame that longjmp returns to.
bool encode(PngTarget& target, glm::ivec2 size, int bits, int color_type, png_bytepp rows) {
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &target, on_error, on_warning);
    png_infop info = png ? png_create_info_struct(png) : nullptr;
    if (!info || setjmp(png_jmpbuf(png))) {
        png_destroy_write_struct(&png, &info);
        return false;
    }
    png_set_user_limits(png, 0x7fffffff, 0x7fffffff);
    png_set_write_fn(png, &target, append, nullptr);
    png_set_IHDR(png, info, png_uint_32(size.x), png_uint_32(size.y), bits, color_type,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_sRGB(png, info, PNG_sRGB_INTENT_PERCEPTUAL);
    png_write_info(png, info);
    png_write_image(png, rows);
    png_write_end(png, nullptr);
    png_destroy_write_struct(&png, &info);
    return true;
}

// What a pixel shows, as straight colour and alpha in [0, 1].
glm::dvec4 straight(glm::dvec4 c, const PngOptions& options) {
    for (int i = 0; i < 4; ++i)
        if (std::isnan(c[i])) c[i] = 0;
    const double alpha = glm::clamp(c.a, 0.0, 1.0);
    if (options.opaque)
        return {glm::clamp(glm::dvec3(c) + (1 - alpha) * options.background, 0.0, 1.0), 1.0};
    if (alpha <= 0) return glm::dvec4(0.0);
    return {glm::clamp(glm::dvec3(c) / alpha, 0.0, 1.0), alpha};
}

}  // namespace

std::string png_bytes(const Image& image, const PngOptions& options) {
    const glm::ivec2 size = image.size();
    if (size.x < 1 || size.y < 1)
        fail("a picture of {} x {} pixels cannot be a PNG", size.x, size.y);
    const std::size_t channels = options.opaque ? 3 : 4,
                      width = std::size_t(size.x) * channels * std::size_t(options.bits / 8);
    std::vector<png_byte> pixels(width * std::size_t(size.y));
    std::vector<png_bytep> rows;
    png_byte* out = pixels.data();
    const double white = options.bits == 8 ? 255 : 65535;
    for (int y = 0; y < size.y; ++y) {
        rows.push_back(out);
        for (int x = 0; x < size.x; ++x) {
            const glm::dvec4 c = straight(glm::dvec4(image.at(x, y)), options);
            for (std::size_t k = 0; k < channels; ++k) {
                const auto v = unsigned(std::nearbyint(c[int(k)] * white));
                if (options.bits == 16) *out++ = png_byte(v >> 8);  // PNG is big-endian
                *out++ = png_byte(v);
            }
        }
    }
    PngTarget target;
    if (!encode(target, size, options.bits,
                options.opaque ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_RGBA, rows.data()))
        fail("libpng: {}", target.message[0] ? target.message : "out of memory");
    return std::move(target.bytes);
}

}  // namespace voxloom
