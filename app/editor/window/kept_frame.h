// The window's picture, kept from frame to frame: nothing is drawn where nothing changes, and where OpenGL is done
// in software only what changes is, for there filling a whole window is most of a frame.
#pragma once

#include <imgui.h>

#include <vector>

#include "app/editor/window/painter.h"

struct GLFWwindow;

namespace voxloom::editor {

// Made and used where the window's context is current.
class KeptFrame {
  public:
    explicit KeptFrame(GLFWwindow* window);
    KeptFrame(const KeptFrame&) = delete;
    KeptFrame& operator=(const KeptFrame&) = delete;

    // Everything is drawn next time: the system has thrown something away, or a texture has other texels under the
    // same name.
    void forget() { lists_.clear(); }
    // Whether the back buffer holds the whole picture at any time, or only after something was drawn.
    bool keeps() const { return copy_ != nullptr; }
    // Draws over `background` into the back buffer. False where it is the same
    // as before.
    bool draw(ImDrawData& data, glm::ivec2 size, ImVec4 background);
    // Brings what was drawn last to the screen.
    void show() const;

  private:
    // Copies a part of the back buffer to the screen; the back buffer stays as it is.
    using CopySubBuffer = void (*)(void* display, unsigned long drawable, int x, int y, int width, int height);

    GLFWwindow* window_;
    CopySubBuffer copy_ = nullptr;  // null: buffers are swapped, and nothing is known of the one behind
    void* display_ = nullptr;
    unsigned long drawable_ = 0;
    Painter painter_;
    glm::ivec2 size_{0};
    std::vector<DrawnList> lists_;
    std::vector<Rect> drawn_;
};

}  // namespace voxloom::editor
