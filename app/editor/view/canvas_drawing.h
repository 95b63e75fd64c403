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

// Draws in canvas units.
struct Pen {
    ImDrawList& list;
    const Canvas& canvas;
    double zoom;      // pixels a canvas unit
    float alpha = 1;  // of everything

    explicit Pen(const Canvas& canvas);
    float px(double units) const { return float(units * zoom); }
    ImVec2 at(glm::dvec2 p) const { return im(canvas.to_screen(p)); }
    ImU32 color(ImU32 c) const { return alpha < 1 ? faded(c, alpha) : c; }
    bool readable() const;  // below some zoom names cannot be read and are left out
    bool sees(const NodeBox& box) const;
    void text(glm::dvec2 p, ImU32 color, const std::string& s, double width, double height = 13) const;
    double width_of(const std::string& s, double height = 13) const;  // in canvas units
};

// What is written beside the graph: below its nodes and wires.
void draw_notes(const Pen& pen, const Editor& editor);

std::vector<Wire> wires_of(const Editor& editor);
double distance_to(const Wire& wire, glm::dvec2 point);

// "256 x 256 x 128 u8, 8 MiB": what an output gives, as far as it is known.
std::string flow_text(const Editor& editor, const WireEnd& output);
// The same on the wire, short, where it has been computed and there is room; false where it is not drawn.
bool draw_flow(const Pen& pen, const Editor& editor, const Wire& wire);
// What a node gives, small, within a rectangle of the canvas.
void draw_look(const Pen& pen, Editor& editor, const std::string& node, const NodePorts& ports, const NodeBox& room);

// Of all nodes, groups and comments, of which there is one at least.
std::pair<glm::dvec2, glm::dvec2> bounds_of(const Canvas& canvas);
std::optional<Minimap> minimap_of(const Canvas& canvas);
NodeBox box_of_comment(const Comment& comment);

void draw_graph(Editor& editor, const std::vector<Wire>& wires, int hovered_wire);

}  // namespace voxloom::editor
