// The ports of a node as they are drawn and wired: those of its type, or, where the type is unknown,
// those that the graph's wires speak of.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/graph/document.h"
#include "core/plugin/registry.h"

namespace voxloom::editor {

struct NodePorts {
    const NodeType* type = nullptr;       // null: unknown
    std::vector<PortSpec> inputs, outputs;
    int input(std::string_view key) const;   // -1: there is none
    int output(std::string_view key) const;
};

// Wherever in the text they stand.
inline bool same_end(const WireEnd& a, const WireEnd& b) { return a.node == b.node && a.port == b.port; }

// By index of graph.nodes.
std::vector<NodePorts> ports_of(const Graph& graph, const Registry& registry);
PortType type_of(const PortSpec& output);

// Why `from` (an output) cannot be wired to `to` (an input), one sentence; empty when it can.
std::string why_not_wired(const Graph& graph, const Registry& registry, const WireEnd& from,
                          const WireEnd& to);

// A node type and its first port that fits.
struct Fit {
    const NodeType* type;
    std::string port;
};
std::vector<Fit> nodes_taking(const Registry& registry, PortType type);
std::vector<Fit> nodes_giving(const Registry& registry, PortTypes types);

}  // namespace voxloom::editor
