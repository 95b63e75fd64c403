// Takes mouse and keys from a window and gives them to Dear ImGui, so that nothing quick is lost (model/input_queue.h).
#pragma once

#include <optional>
#include <utility>

#include "app/editor/model/input_queue.h"

struct GLFWwindow;

namespace voxloom::editor {

// Of a window whose ImGui back end was made without callbacks; uses the window's user pointer.
class Input {
  public:
    explicit Input(GLFWwindow* window);
    Input(const Input&) = delete;
    Input& operator=(const Input&) = delete;

    // Between the back end's new frame, which would ask how things are by now, and ImGui's.
    void give_to_frame();
    // Behind ImGui's frame: whether something to type into or to answer has come up or gone.
    bool look_for_popups();
    // More has come than one frame can be told.
    bool waits() const { return !queue_.empty(); }
    // Since this was asked last: whether anything has come, and whether the system has thrown away what the window showed.
    bool take_happened() { return std::exchange(happened_, false); }
    bool take_exposed() { return std::exchange(exposed_, false); }

  private:
    static Input& of(GLFWwindow* window);  // that something has happened to
    GLFWwindow* window_;
    InputQueue queue_;
    std::optional<glm::dvec2> pointer_;  // none before it moved
    std::set<int> buttons_;              // that are down
    int key_ = -1;                       // that was pressed or repeated last
    bool repeated_ = false, popup_ = false, happened_ = false, exposed_ = false;
};

}  // namespace voxloom::editor
