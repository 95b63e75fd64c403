// Pictures and tables: what people look at in the end.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "core/base/buffer.h"

namespace voxloom {

// Row 0 is the top row, x fastest. Colours are display-referred numbers (a colour map's value is
// what is shown; no tone curve is applied anywhere), premultiplied by alpha.
class Image {
  public:
    enum class Format : std::uint8_t { rgba32f, rgba8 };
    Image(glm::ivec2 size, Format format);

    glm::ivec2 size() const { return size_; }
    Format format() const { return format_; }
    std::span<std::byte> bytes() { return pixels_.bytes(); }
    std::span<const std::byte> bytes() const { return pixels_.bytes(); }
    std::span<glm::vec4> rgba32f() { return pixels_.as<glm::vec4>(); }
    std::span<const glm::vec4> rgba32f() const { return pixels_.as<glm::vec4>(); }
    std::span<glm::u8vec4> rgba8() { return pixels_.as<glm::u8vec4>(); }
    std::span<const glm::u8vec4> rgba8() const { return pixels_.as<glm::u8vec4>(); }
    // Pixel as float whatever the format.
    glm::vec4 at(int x, int y) const;

    // Distance along the viewing axis in world units, one a pixel; empty when there is none.
    std::vector<float> depth;

  private:
    glm::ivec2 size_;
    Format format_;
    Buffer pixels_;
};
using ImagePtr = std::shared_ptr<const Image>;

// Rows of measurements. A column's unit is empty when it has none.
struct Table {
    using Cell = std::variant<std::int64_t, double, std::string>;
    struct Column {
        std::string name, unit;
    };
    std::vector<Column> columns;
    std::vector<std::vector<Cell>> rows;  // each as long as columns
};
using TablePtr = std::shared_ptr<const Table>;

}  // namespace voxloom
