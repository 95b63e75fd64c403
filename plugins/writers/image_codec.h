// Pictures as the bytes of a PNG or an EXR file.
#pragma once

#include <string>

#include "core/data/image.h"

namespace voxloom {

// 8 or 16 bits a channel, straight (unpremultiplied) alpha as PNG wants it. With `opaque` the
// picture is laid over `background` and has no alpha. NaN becomes 0. Same pixels, same bytes.
struct PngOptions {
    int bits = 8;
    bool opaque = false;
    glm::dvec3 background{0.0};
};
std::string png_bytes(const Image& image, const PngOptions& options = {});

// R, G, B, A premultiplied as EXR wants it, and Z where the picture has depth, as 32-bit floats or
// 16-bit halves. Numbers are stored as they are. Throws Error where the build has no OpenEXR.
std::string exr_bytes(const Image& image, int bits = 32);
bool has_exr();

}  // namespace voxloom
