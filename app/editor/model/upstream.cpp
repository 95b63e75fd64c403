#include "app/editor/model/upstream.h"

#include <algorithm>

namespace voxloom::editor {

std::vector<const GraphNode*> upstream(const Graph& graph, const std::string& node) {
    std::vector<const GraphNode*> nodes;
    auto add = [&](const std::string& id) {
        const GraphNode* found = graph.find(id);
        if (found && std::ranges::find(nodes, found) == nodes.end()) nodes.push_back(found);
    };
    add(node);
    for (std::size_t i = 0; i < nodes.size(); ++i)  // grows on the way
        for (const GraphInput& input : nodes[i]->inputs)
            for (const WireEnd& end : input.from) add(end.node);
    return nodes;
}

}  // namespace voxloom::editor
