#include "core/data/image.h"

#include "core/base/error.h"

namespace voxloom {

Image::Image(glm::ivec2 size, Format format) : size_(size), format_(format) {
    if (size.x < 0 || size.y < 0) fail("image: size {} x {} is negative", size.x, size.y);
    pixels_ = Buffer(std::uint64_t(size.x) * std::uint64_t(size.y) *
                         (format == Format::rgba32f ? sizeof(glm::vec4) : sizeof(glm::u8vec4)),
                     "image");
}

glm::vec4 Image::at(int x, int y) const {
    std::size_t i = std::size_t(y) * std::size_t(size_.x) + std::size_t(x);
    return format_ == Format::rgba32f ? rgba32f()[i] : glm::vec4(rgba8()[i]) / 255.0f;
}

}  // namespace voxloom
