// Where nodes stand on the canvas. Lengths are canvas units, a pixel each at zoom 1 and scale 1; x to
// the right, y down. A node without a place in the document is given one, which is not written there.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "app/editor/model/ports.h"

namespace voxloom::editor {

// A node is its header, a row for each port, a picture where its type gives what can be looked at, and a
// footer.
inline constexpr double kNodeWidth = 190, kHeaderHeight = 26, kRowHeight = 20, kFooterHeight = 22;
inline constexpr double kSnap = 10;

struct NodeBox {
    glm::dvec2 at{0.0}, size{0.0};
    glm::dvec2 input(int i) const;   // middle of the port, on the left edge
    glm::dvec2 output(int i) const;  // on the right edge
    bool contains(glm::dvec2 p) const;
    bool overlaps(glm::dvec2 lo, glm::dvec2 hi) const;
};

double picture_height(const NodePorts& ports);  // 0: it gives nothing to look at
glm::dvec2 node_size(const NodePorts& ports);

// By index of graph.nodes.
std::vector<NodeBox> boxes_of(const Graph& graph, const std::vector<NodePorts>& ports);

// Sources left, consumers right, in columns; nothing overlaps, and wires cross seldom. Parts that no wire
// leads between stand beside each other.
std::vector<glm::dvec2> auto_layout(const Graph& graph, const std::vector<NodePorts>& ports);

// The place nearest to `wanted`, going down, where a node of this size covers no other.
glm::dvec2 free_place(const std::vector<NodeBox>& boxes, glm::dvec2 wanted, glm::dvec2 size);

glm::dvec2 snapped(glm::dvec2 at);

}  // namespace voxloom::editor
