#include "app/editor/model/knobs.h"

#include <set>
#include <string_view>

#include "app/editor/model/param_values.h"
#include "app/editor/model/upstream.h"

namespace voxloom::editor {

std::vector<Knob> knobs_of(const Graph& graph, const Registry& registry, const std::vector<std::string>& nodes, bool all) {
    const std::set<std::string_view> wanted(nodes.begin(), nodes.end());
    std::vector<Knob> knobs;
    for (const GraphNode& node : graph.nodes) {
        const NodeType* type = wanted.count(node.id) ? registry.find(node.type) : nullptr;
        if (!type || node.use != GraphNode::Use::normal) continue;
        for (const ParamSpec& spec : type->params)
            if (spec.quality && is_in_use(node, *type, spec) && (!spec.expert || all || find_param(node, spec.key))) knobs.push_back({node.id, &spec});
    }
    return knobs;
}

std::vector<std::string> nodes_of(const Graph& graph, const std::vector<WireEnd>& ports) {
    std::set<std::string> ids;
    for (const WireEnd& port : ports)
        for (const GraphNode* node : upstream(graph, port.node)) ids.insert(node->id);
    return {ids.begin(), ids.end()};
}

}  // namespace voxloom::editor
