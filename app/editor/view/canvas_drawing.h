// How the graph looks.
#pragma once

#include "app/editor/view/editor.h"

namespace voxloom::editor {

// A wire as it is drawn: a cubic Bezier curve in pixels.
struct Wire {
    WireEnd from, to;
    PortType type = PortType::volume;
    bool known = false;  // whether the type is
    glm::dvec2 p[4];
};
std::vector<Wire> wires_of(const Editor& editor);
double distance_to(const Wire& wire, glm::dvec2 point);

// "256 x 256 x 128 u8, 8 MiB": what an output gives, as far as it is known.
std::string flow_text(const Editor& editor, const WireEnd& output);

void draw_graph(Editor& editor, const std::vector<Wire>& wires, int hovered_wire);

}  // namespace voxloom::editor
