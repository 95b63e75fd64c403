#include "app/editor/model/ports.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace voxloom::editor {

namespace {

int index_of(const std::vector<PortSpec>& ports, std::string_view key) {
    for (std::size_t i = 0; i < ports.size(); ++i)
        if (ports[i].key == key) return int(i);
    return -1;
}

PortSpec unknown_port(const std::string& key) {
    PortSpec port;
    port.key = key;
    port.doc = "The node's type is not known here; the port is kept as it is.";
    port.many = true;
    return port;
}

// What the wires of the graph say of nodes and ports that no type describes.
void add_wired(std::vector<NodePorts>& ports, const Graph& graph,
               const std::map<std::string, std::size_t, std::less<>>& index) {
    auto add_output = [&](const WireEnd& end) {
        auto found = index.find(end.node);
        if (found == index.end() || end.port.empty()) return;
        NodePorts& from = ports[found->second];
        if (!from.type && index_of(from.outputs, end.port) < 0) from.outputs.push_back(unknown_port(end.port));
    };
    for (std::size_t i = 0; i < graph.nodes.size(); ++i)
        for (const GraphInput& input : graph.nodes[i].inputs) {
            if (!ports[i].type) ports[i].inputs.push_back(unknown_port(input.port));
            for (const WireEnd& end : input.from) add_output(end);
        }
    for (const WireEnd& end : graph.outputs) add_output(end);
}

// Whether `target` is reached from `start` along the wires, downstream.
bool feeds(const Graph& graph, const std::string& start, const std::string& target) {
    std::set<std::string> seen;
    std::vector<std::string> open{target};
    while (!open.empty()) {
        const std::string id = std::move(open.back());
        open.pop_back();
        if (id == start) return true;
        if (!seen.insert(id).second) continue;
        if (const GraphNode* node = graph.find(id))
            for (const GraphInput& input : node->inputs)
                for (const WireEnd& end : input.from) open.push_back(end.node);
    }
    return false;
}

}  // namespace

int NodePorts::input(std::string_view key) const { return index_of(inputs, key); }
int NodePorts::output(std::string_view key) const { return index_of(outputs, key); }

PortType type_of(const PortSpec& output) {
    for (int t = 0; t < kPortTypes; ++t)
        if (output.types.has(PortType(t))) return PortType(t);
    return PortType::volume;
}

std::vector<NodePorts> ports_of(const Graph& graph, const Registry& registry) {
    std::vector<NodePorts> ports(graph.nodes.size());
    std::map<std::string, std::size_t, std::less<>> index;
    for (std::size_t i = 0; i < ports.size(); ++i) {
        index.emplace(graph.nodes[i].id, i);
        ports[i].type = registry.find(graph.nodes[i].type);
        if (!ports[i].type) continue;
        ports[i].inputs = ports[i].type->inputs;
        ports[i].outputs = ports[i].type->outputs;
    }
    add_wired(ports, graph, index);
    return ports;
}

std::string why_not_wired(const Graph& graph, const Registry& registry, const WireEnd& from,
                          const WireEnd& to) {
    const GraphNode* source = graph.find(from.node);
    const GraphNode* target = graph.find(to.node);
    if (!source || !target) return "the node is not there any more";
    if (from.node == to.node) return "a node cannot feed itself";
    if (feeds(graph, to.node, from.node))
        return fmt::format("'{}' already feeds '{}': the wires would run in a cycle", to.node, from.node);
    const NodeType* source_type = registry.find(source->type);
    const NodeType* target_type = registry.find(target->type);
    if (!source_type || !target_type) return {};  // a placeholder takes what it is given
    const PortSpec* output = source_type->find_output(from.port);
    const PortSpec* input = target_type->find_input(to.port);
    if (!output) return fmt::format("{} has no output '{}'", source_type->title, from.port);
    if (!input) return fmt::format("{} has no input '{}'", target_type->title, to.port);
    const PortType type = type_of(*output);
    if (input->types.has(type)) return {};
    return fmt::format("'{}' takes {}, and this is {}", to.port, input->types.text(), name_of(type));
}

std::vector<Fit> nodes_taking(const Registry& registry, PortType type) {
    std::vector<Fit> fits;
    for (const NodeType* node : registry.all())
        for (const PortSpec& port : node->inputs)
            if (port.types.has(type)) {
                fits.push_back({node, port.key});
                break;
            }
    return fits;
}

std::vector<Fit> nodes_giving(const Registry& registry, PortTypes types) {
    std::vector<Fit> fits;
    for (const NodeType* node : registry.all())
        for (const PortSpec& port : node->outputs)
            if (types.has(type_of(port))) {
                fits.push_back({node, port.key});
                break;
            }
    return fits;
}

}  // namespace voxloom::editor
