// A frame's triangles in the runs that they are drawn in.
//
// Where OpenGL is done in software, a pixel costs what is done for it, and most of a window is of one colour. What needs
// no texture is drawn without one, and what hides everything below is not mixed with it.
#pragma once

#include "app/editor/model/damage.h"

namespace voxloom::editor {

// What a frame's texture of letters is called, and where it is white: what is drawn there needs no texture.
struct Letters {
    std::uintptr_t texture = 0;
    glm::vec2 white{0};
};

struct Batch {
    // Each can draw whatever those behind it can.
    enum class Kind { textured, plain, opaque } kind = Kind::textured;
    glm::vec4 clip{0};
    std::uintptr_t texture = 0;
    std::uint32_t list = 0;
    std::uint32_t first_vertex = 0, first_index = 0, count = 0;  // within the list, as in its commands
};

// All triangles in their order. Few of a kind stay with those beside them: another batch costs more than they do.
std::vector<Batch> batches_of(const std::vector<DrawnList>& lists, const Letters& letters);

}  // namespace voxloom::editor
