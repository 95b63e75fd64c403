// The parameters that trade speed for error, of several nodes together.
#pragma once

#include <string>
#include <vector>

#include "core/graph/document.h"
#include "core/plugin/registry.h"

namespace voxloom::editor {

struct Knob {
    std::string node;
    const ParamSpec* spec = nullptr;  // of the node's type
};

// As far as they are in use; of those for experts such as are set, or `all`. In the order of the graph.
std::vector<Knob> knobs_of(const Graph& graph, const Registry& registry, const std::vector<std::string>& nodes, bool all = false);

// Those nodes that these ports are made of.
std::vector<std::string> nodes_of(const Graph& graph, const std::vector<WireEnd>& ports);

}  // namespace voxloom::editor
