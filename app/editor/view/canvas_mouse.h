// What the mouse does to the graph.
#pragma once

#include "app/editor/view/canvas_drawing.h"

namespace voxloom::editor {

// What is under the pointer.
struct Hit {
    std::optional<WireEnd> port;
    bool port_is_output = false;
    bool map = false;  // the small one of the whole graph, and nothing below it
    int node = -1, comment = -1, group = -1, wire = -1;  // by index; of a group its title
};
Hit hit_test(const Editor& editor, const std::vector<Wire>& wires, glm::dvec2 mouse);
void handle_mouse(Editor& editor, const Hit& hit, const std::vector<Wire>& wires, bool hovered);
// Why the wire in the hand cannot end at the port under the pointer; empty when it can.
std::string other_end_problem(const Editor& editor, const Hit& hit);

inline constexpr double kLeastZoom = 0.08, kMostZoom = 3;

}  // namespace voxloom::editor
