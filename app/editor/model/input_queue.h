// Mouse and keys in the order in which they came, a frame's worth at a time.
//
// Dear ImGui 1.86 knows what is down when a frame begins, and nothing of what happened since the frame before. So no frame
// is given more than it can tell apart: a key or button that goes down and up again needs two, and two keys need two.
#pragma once

#include <deque>
#include <glm/glm.hpp>
#include <set>
#include <vector>

namespace voxloom::editor {

struct InputEvent {
    enum class Kind { pointer, wheel, button, key, text };
    Kind kind = Kind::pointer;
    int code = 0;         // of a button or a key its number, of text the character
    bool down = false;    // of a button or a key
    glm::dvec2 at{0};     // of the pointer its place, of the wheel how far it turned
    int typed_by = -1;    // of text: the key
    bool repeated = false;  // of text: the key was held
};

class InputQueue {
  public:
    void add(const InputEvent& event);
    bool empty() const { return events_.empty(); }
    // What the next frame is to see, in order; the rest stays for those after it.
    std::vector<InputEvent> next_frame();
    // Something came up that texts can be typed into, which takes a few frames: the next keys wait until it is ready. Those
    // that are held were meant for what was there before, and type nothing until they are let go.
    void wait_for_texts();

  private:
    static constexpr int kFramesToOpen = 3;
    std::deque<InputEvent> events_;
    std::set<int> down_, silent_;  // keys
    int waiting_ = 0;              // frames
};

}  // namespace voxloom::editor
