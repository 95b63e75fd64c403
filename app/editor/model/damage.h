// Which parts of a window another frame changes.
//
// A frame is lists of triangles, drawn one after the other. Where a list draws the same triangles as in the frame
// before but for some, only what those covered and cover now is another picture.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <string>
#include <vector>

namespace voxloom::editor {

struct DrawnVertex {
    glm::vec2 position, texel;
    std::uint32_t color = 0;
    bool operator==(const DrawnVertex&) const = default;
};
struct DrawnCommand {
    glm::vec4 clip{0};            // x and y of the lower, then of the upper end
    std::uintptr_t texture = 0;   // other texels have another number
    std::uint32_t first_vertex = 0, first_index = 0, count = 0;  // of indices, three a triangle
};
struct DrawnList {
    std::string name;
    std::vector<DrawnVertex> vertices;
    std::vector<std::uint16_t> indices;
    std::vector<DrawnCommand> commands;
};

// Pixels, the upper end not included.
struct Rect {
    glm::ivec2 lo{0}, hi{0};
    bool operator==(const Rect&) const = default;
};

// A few rectangles, which may overlap, within `size`; none where the frames are the same. Lists are told by their
// names; those that change places change everything.
std::vector<Rect> damage(const std::vector<DrawnList>& before, const std::vector<DrawnList>& now, glm::ivec2 size);

}  // namespace voxloom::editor
