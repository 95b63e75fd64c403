// Draws a frame's triangles, all of them or within rectangles.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "app/editor/model/batches.h"

namespace voxloom::editor {

// Made, used and ended where the window's context is current. Sets whatever it needs of OpenGL's state and leaves it.
class Painter {
  public:
    Painter();
    ~Painter();
    Painter(const Painter&) = delete;
    Painter& operator=(const Painter&) = delete;

    // What is drawn from now on, in a window of so many pixels, `scale` of them a unit of the lists.
    void load(const std::vector<DrawnList>& lists, const Letters& letters, glm::ivec2 size, glm::vec2 scale);
    // Over `background`, in pixels from the window's upper left.
    void draw(const Rect& part, glm::vec3 background) const;

  private:
    unsigned textured_ = 0, plain_ = 0, array_ = 0, vertices_ = 0, indices_ = 0;
    glm::ivec2 size_{0};
    glm::vec2 scale_{1};
    std::vector<Batch> batches_;
    std::vector<std::uint32_t> vertex_of_, index_of_;  // where each list begins
};

}  // namespace voxloom::editor
