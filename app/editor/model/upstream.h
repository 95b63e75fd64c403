// What a node is made of.
#pragma once

#include <string>
#include <vector>

#include "core/graph/document.h"

namespace voxloom::editor {

// The node itself and all that its inputs lead to, the nearest first, each once. Empty where there is no such node.
std::vector<const GraphNode*> upstream(const Graph& graph, const std::string& node);

}  // namespace voxloom::editor
