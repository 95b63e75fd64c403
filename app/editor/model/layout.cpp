#include "app/editor/model/layout.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

namespace voxloom::editor {

namespace {

constexpr double kColumnGap = 90, kRowGap = 30;

// Nodes that feed each node, as indices.
std::vector<std::vector<std::size_t>> sources_of(const Graph& graph) {
    std::map<std::string_view, std::size_t> index;
    for (std::size_t i = 0; i < graph.nodes.size(); ++i) index.emplace(graph.nodes[i].id, i);
    std::vector<std::vector<std::size_t>> sources(graph.nodes.size());
    for (std::size_t i = 0; i < graph.nodes.size(); ++i)
        for (const GraphInput& input : graph.nodes[i].inputs)
            for (const WireEnd& end : input.from)
                if (auto found = index.find(end.node); found != index.end() && found->second != i)
                    sources[i].push_back(found->second);
    return sources;
}

// The longest way from a node without sources. A cycle ends the search after as many rounds as there
// are nodes, and keeps what it has.
std::vector<int> columns_of(const std::vector<std::vector<std::size_t>>& sources) {
    std::vector<int> column(sources.size());
    bool changed = true;
    for (std::size_t round = 0; changed && round < sources.size(); ++round) {
        changed = false;
        for (std::size_t i = 0; i < sources.size(); ++i)
            for (std::size_t from : sources[i])
                if (column[i] <= column[from] && column[from] + 1 < int(sources.size())) {
                    column[i] = column[from] + 1;
                    changed = true;
                }
    }
    return column;
}

// Nodes that wires lead between, in the order of the first of each.
std::vector<std::vector<std::size_t>> parts_of(const std::vector<std::vector<std::size_t>>& sources) {
    std::vector<std::size_t> above(sources.size());
    std::iota(above.begin(), above.end(), std::size_t(0));
    auto root = [&](std::size_t i) {
        while (above[i] != i) i = above[i] = above[above[i]];
        return i;
    };
    for (std::size_t i = 0; i < sources.size(); ++i)
        for (std::size_t from : sources[i]) above[root(i)] = root(from);
    std::map<std::size_t, std::size_t> part;
    std::vector<std::vector<std::size_t>> parts;
    for (std::size_t i = 0; i < sources.size(); ++i) {
        const std::size_t k = part.emplace(root(i), parts.size()).first->second;
        if (k == parts.size()) parts.emplace_back();
        parts[k].push_back(i);
    }
    return parts;
}

// Each column is sorted by the mean height of what feeds it, which keeps most wires from crossing.
void place_in_columns(const std::vector<std::size_t>& part, const std::vector<std::vector<std::size_t>>& sources,
                      const std::vector<int>& column, const std::vector<glm::dvec2>& size, std::vector<glm::dvec2>& at) {
    std::map<int, std::vector<std::size_t>> columns;
    for (std::size_t i : part) columns[column[i]].push_back(i);
    for (auto& [c, nodes] : columns) {
        std::map<std::size_t, double> pull;
        for (std::size_t i : nodes) {
            for (std::size_t from : sources[i]) pull[i] += at[from].y;
            if (!sources[i].empty()) pull[i] /= double(sources[i].size());
        }
        if (c > 0) std::stable_sort(nodes.begin(), nodes.end(), [&](std::size_t a, std::size_t b) { return pull[a] < pull[b]; });
        double height = -kRowGap;
        for (std::size_t i : nodes) height += size[i].y + kRowGap;
        double y = -height / 2;
        for (std::size_t i : nodes) {
            at[i] = {double(c) * (kNodeWidth + kColumnGap), y};
            y += size[i].y + kRowGap;
        }
    }
}

// Parts that no wire leads between stand beside each other, in rows that make the whole about as wide as a
// screen is, not all below each other.
void place_in_rows(const std::vector<std::vector<std::size_t>>& parts, const std::vector<glm::dvec2>& size, std::vector<glm::dvec2>& at) {
    struct Extent {
        glm::dvec2 lo{1e300}, hi{-1e300};
    };
    std::vector<Extent> extents(parts.size());
    double area = 0, room = 0;
    for (std::size_t k = 0; k < parts.size(); ++k) {
        Extent& e = extents[k];
        for (std::size_t i : parts[k]) e.lo = glm::min(e.lo, at[i]), e.hi = glm::max(e.hi, at[i] + size[i]);
        const glm::dvec2 whole = e.hi - e.lo + glm::dvec2(kColumnGap, 2 * kRowGap);
        area += whole.x * whole.y;
        room = std::max(room, whole.x);
    }
    room = std::max(room, std::sqrt(1.6 * area));
    glm::dvec2 next(0.0);
    double below = 0;
    for (std::size_t k = 0; k < parts.size(); ++k) {
        const glm::dvec2 whole = extents[k].hi - extents[k].lo + glm::dvec2(kColumnGap, 2 * kRowGap);
        if (next.x > 0 && next.x + whole.x > room) next = {0, below};
        for (std::size_t i : parts[k]) at[i] += next - extents[k].lo;
        next.x += whole.x;
        below = std::max(below, next.y + whole.y);
    }
}

}  // namespace

glm::dvec2 NodeBox::input(int i) const { return at + glm::dvec2(0, kHeaderHeight + (i + 0.5) * kRowHeight); }
glm::dvec2 NodeBox::output(int i) const { return input(i) + glm::dvec2(size.x, 0); }
bool NodeBox::contains(glm::dvec2 p) const { return overlaps(p, p); }
bool NodeBox::overlaps(glm::dvec2 lo, glm::dvec2 hi) const {
    return lo.x <= at.x + size.x && hi.x >= at.x && lo.y <= at.y + size.y && hi.y >= at.y;
}

double picture_height(const NodePorts& ports) {
    double height = 0;
    for (const PortSpec& port : ports.outputs) {
        if (!ports.type) continue;
        const PortType type = type_of(port);
        if (type == PortType::image || type == PortType::volume || type == PortType::bricks) height = std::max(height, 96.0);
        if (type == PortType::table) height = std::max(height, 68.0);
        if (type == PortType::transfer) height = std::max(height, 44.0);
    }
    return height;
}

glm::dvec2 node_size(const NodePorts& ports) {
    const std::size_t rows = std::max(ports.inputs.size(), ports.outputs.size());
    return {kNodeWidth, kHeaderHeight + double(rows) * kRowHeight + picture_height(ports) + kFooterHeight};
}

glm::dvec2 snapped(glm::dvec2 at) { return glm::round(at / kSnap) * kSnap; }

std::vector<NodeBox> boxes_of(const Graph& graph, const std::vector<NodePorts>& ports) {
    std::vector<NodeBox> boxes(graph.nodes.size());
    bool all_placed = true;
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        boxes[i].size = node_size(ports[i]);
        all_placed = all_placed && graph.nodes[i].at;
    }
    std::vector<glm::dvec2> made;
    if (!all_placed) made = auto_layout(graph, ports);
    for (std::size_t i = 0; i < boxes.size(); ++i) boxes[i].at = graph.nodes[i].at.value_or(made.empty() ? glm::dvec2(0.0) : made[i]);
    return boxes;
}

std::vector<glm::dvec2> auto_layout(const Graph& graph, const std::vector<NodePorts>& ports) {
    const auto sources = sources_of(graph);
    std::vector<glm::dvec2> size, at(sources.size(), glm::dvec2(0.0));
    for (const NodePorts& p : ports) size.push_back(node_size(p));
    const std::vector<int> column = columns_of(sources);
    const auto parts = parts_of(sources);
    for (const auto& part : parts) place_in_columns(part, sources, column, size, at);
    if (parts.size() > 1) place_in_rows(parts, size, at);
    for (glm::dvec2& p : at) p = snapped(p);
    return at;
}

glm::dvec2 free_place(const std::vector<NodeBox>& boxes, glm::dvec2 wanted, glm::dvec2 size) {
    glm::dvec2 at = snapped(wanted);
    const glm::dvec2 gap(kSnap);
    // Each round goes below a box that is in the way, so the rounds are no more than the boxes.
    for (std::size_t round = 0; round <= boxes.size(); ++round) {
        auto hit = std::find_if(boxes.begin(), boxes.end(),
                                [&](const NodeBox& b) { return b.overlaps(at - gap, at + size + gap); });
        if (hit == boxes.end()) break;
        at.y = std::ceil((hit->at.y + hit->size.y + 2 * kSnap) / kSnap) * kSnap;
    }
    return at;
}

}  // namespace voxloom::editor
