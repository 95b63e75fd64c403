#include "app/editor/model/commands.h"

#include <algorithm>
#include <map>

#include "core/base/error.h"
#include "core/graph/graph_text.h"

namespace voxloom::editor {

namespace {

const GraphInput* find_input(const Graph& graph, const WireEnd& to) {
    const GraphNode* node = graph.find(to.node);
    if (!node) return nullptr;
    auto it = std::find_if(node->inputs.begin(), node->inputs.end(),
                           [&](const GraphInput& input) { return input.port == to.port; });
    return it == node->inputs.end() ? nullptr : &*it;
}

bool takes_many(const Graph& graph, const Registry& registry, const WireEnd& to) {
    const GraphNode* node = graph.find(to.node);
    const NodeType* type = node ? registry.find(node->type) : nullptr;
    const PortSpec* port = type ? type->find_input(to.port) : nullptr;
    return port && port->many;
}

}  // namespace

std::string fresh_id(const Graph& graph, std::string_view wanted) {
    std::string base(wanted.substr(wanted.rfind('.') + 1).substr(0, 90));
    if (!is_node_name(base)) base = "node";
    std::string id = base;
    for (int n = 2; graph.find(id); ++n) id = base + "-" + std::to_string(n);
    return id;
}

std::string add_node(Workspace& workspace, const Registry& registry, const NodeType& type, glm::dvec2 at) {
    const std::string id = fresh_id(workspace.graph(), type.id);
    NodePorts ports{&type, type.inputs, type.outputs};
    const auto boxes = boxes_of(workspace.graph(), ports_of(workspace.graph(), registry));
    workspace.document.add_node(id, type.id, free_place(boxes, at, node_size(ports)));
    workspace.selected = {id};
    return id;
}

void connect(Workspace& workspace, const Registry& registry, const WireEnd& from, const WireEnd& to) {
    if (std::string reason = why_not_wired(workspace.graph(), registry, from, to); !reason.empty())
        throw Error(reason);
    const GraphInput* input = find_input(workspace.graph(), to);
    if (input && std::any_of(input->from.begin(), input->from.end(), [&](const WireEnd& end) { return same_end(end, from); }))
        return;
    workspace.document.connect(from.node, from.port, to.node, to.port,
                               takes_many(workspace.graph(), registry, to));
}

void disconnect(Workspace& workspace, const WireEnd& from, const WireEnd& to) {
    const GraphInput* input = find_input(workspace.graph(), to);
    if (!input) return;
    std::vector<WireEnd> kept = input->from;
    std::erase_if(kept, [&](const WireEnd& end) { return same_end(end, from); });
    Document::Step step(workspace.document);
    workspace.document.disconnect(to.node, to.port);
    for (const WireEnd& end : kept)
        workspace.document.connect(end.node, end.port, to.node, to.port, true);
}

std::string add_behind(Workspace& workspace, const Registry& registry, const Fit& fit, const WireEnd& from, glm::dvec2 at) {
    Document::Step step(workspace.document);
    const std::string id = add_node(workspace, registry, *fit.type, at);
    connect(workspace, registry, from, {id, fit.port, {}});
    return id;
}

std::string add_before(Workspace& workspace, const Registry& registry, const Fit& fit, const WireEnd& to, glm::dvec2 at) {
    Document::Step step(workspace.document);
    const std::string id = add_node(workspace, registry, *fit.type, at);
    connect(workspace, registry, {id, fit.port, {}}, to);
    return id;
}

bool insert_on_wire(Workspace& workspace, const Registry& registry, const std::string& id,
                    const WireEnd& from, const WireEnd& to) {
    const GraphNode* node = workspace.graph().find(id);
    const NodeType* type = node ? registry.find(node->type) : nullptr;
    if (!type || id == from.node || id == to.node) return false;
    for (const PortSpec& in : type->inputs)
        for (const PortSpec& out : type->outputs) {
            const WireEnd enter{id, in.key, {}}, leave{id, out.key, {}};
            if (!why_not_wired(workspace.graph(), registry, from, enter).empty()) continue;
            if (!why_not_wired(workspace.graph(), registry, leave, to).empty()) continue;
            Document::Step step(workspace.document);
            disconnect(workspace, from, to);
            connect(workspace, registry, from, enter);
            connect(workspace, registry, leave, to);
            return true;
        }
    return false;
}

void remove_selected(Workspace& workspace) {
    std::vector<Comment> comments = comments_of(workspace.graph());
    for (auto i = workspace.selected_comments.rbegin(); i != workspace.selected_comments.rend(); ++i)
        if (*i < comments.size()) comments.erase(comments.begin() + std::ptrdiff_t(*i));
    Document::Step step(workspace.document);
    workspace.document.remove_nodes({workspace.selected.begin(), workspace.selected.end()});
    set_groups(workspace.document, groups_of(workspace.graph()));
    set_comments(workspace.document, comments);
    workspace.selected.clear();
    workspace.selected_comments.clear();
}

void toggle_use(Workspace& workspace, GraphNode::Use use) {
    const bool all = std::ranges::all_of(workspace.selected, [&](const std::string& id) {
        const GraphNode* node = workspace.graph().find(id);
        return node && node->use == use;
    });
    workspace.document.set_use({workspace.selected.begin(), workspace.selected.end()}, all ? GraphNode::Use::normal : use);
}

void move_selected(Workspace& workspace, const std::vector<NodeBox>& boxes, glm::dvec2 by) {
    std::vector<std::pair<std::string, glm::dvec2>> places;
    for (std::size_t i = 0; i < boxes.size(); ++i)
        if (const std::string& id = workspace.graph().nodes[i].id; workspace.selected.count(id))
            places.emplace_back(id, glm::round(boxes[i].at + by));
    std::vector<Comment> comments = comments_of(workspace.graph());
    for (std::size_t i : workspace.selected_comments)
        if (i < comments.size()) comments[i].at = glm::round(comments[i].at + by);
    Document::Step step(workspace.document);
    workspace.document.move_nodes(places);
    if (!workspace.selected_comments.empty()) set_comments(workspace.document, comments);
}

void arrange(Workspace& workspace, const Registry& registry) {
    const auto at = auto_layout(workspace.graph(), ports_of(workspace.graph(), registry));
    std::vector<std::pair<std::string, glm::dvec2>> places;
    for (std::size_t i = 0; i < at.size(); ++i) places.emplace_back(workspace.graph().nodes[i].id, at[i]);
    workspace.document.move_nodes(places);
}

void align_selected(Workspace& workspace, const Registry& registry) {
    const auto boxes = boxes_of(workspace.graph(), ports_of(workspace.graph(), registry));
    std::vector<NodeBox> others;
    std::vector<std::pair<double, std::size_t>> order;
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        if (workspace.selected.count(workspace.graph().nodes[i].id)) order.emplace_back(boxes[i].at.y, i);
        else others.push_back(boxes[i]);
    }
    if (order.size() < 2) return;
    std::sort(order.begin(), order.end());
    double x = boxes[order.front().second].at.x, y = order.front().first;
    for (auto& [top, i] : order) x = std::min(x, boxes[i].at.x);
    std::vector<std::pair<std::string, glm::dvec2>> places;
    for (auto& [top, i] : order) {
        const glm::dvec2 at = free_place(others, {x, std::max(y, top)}, boxes[i].size);
        places.emplace_back(workspace.graph().nodes[i].id, at);
        y = at.y + boxes[i].size.y + 3 * kSnap;
    }
    workspace.document.move_nodes(places);
}

std::string copy_selected(const Workspace& workspace, const Registry& registry) {
    const auto boxes = boxes_of(workspace.graph(), ports_of(workspace.graph(), registry));
    std::vector<GraphNode> nodes;
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        GraphNode node = workspace.graph().nodes[i];
        if (!workspace.selected.count(node.id)) continue;
        node.at = boxes[i].at;
        for (GraphInput& input : node.inputs)
            std::erase_if(input.from, [&](const WireEnd& end) { return !workspace.selected.count(end.node); });
        std::erase_if(node.inputs, [](const GraphInput& input) { return input.from.empty(); });
        nodes.push_back(std::move(node));
    }
    const std::vector<Comment> all = comments_of(workspace.graph());
    std::vector<Comment> comments;
    for (std::size_t i : workspace.selected_comments)
        if (i < all.size()) comments.push_back(all[i]);
    if (nodes.empty() && comments.empty()) return {};
    std::vector<Group> groups = groups_of(workspace.graph());
    std::erase_if(groups, [&](const Group& group) {
        return !std::ranges::all_of(group.nodes, [&](const std::string& id) { return workspace.selected.count(id) > 0; });
    });
    Document document;
    document.add_nodes(nodes);
    set_groups(document, groups);
    set_comments(document, comments);
    return document.text();
}

void paste(Workspace& workspace, const Registry& registry, const std::string& text, glm::dvec2 at) {
    Graph pasted;
    try {
        pasted = Document::parse(text, "clipboard").graph();
    } catch (const Error&) {
        fail("the clipboard holds no nodes; copy some with Ctrl+C, or the text of a graph");
    }
    std::vector<Comment> comments = comments_of(workspace.graph()), pasted_comments = comments_of(pasted);
    std::vector<Group> groups = groups_of(workspace.graph()), pasted_groups = groups_of(pasted);
    if (pasted.nodes.empty() && pasted_comments.empty()) return;
    const auto boxes = boxes_of(pasted, ports_of(pasted, registry));
    glm::dvec2 lo(1e300);
    for (const NodeBox& box : boxes) lo = glm::min(lo, box.at);
    for (const Comment& comment : pasted_comments) lo = glm::min(lo, comment.at);

    std::map<std::string, std::string> renamed;
    Graph taken = workspace.graph();
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        GraphNode& node = pasted.nodes[i];
        const std::string id = fresh_id(taken, node.id);
        renamed[node.id] = id;
        taken.nodes.emplace_back().id = id;
        node.id = id;
        node.at = snapped(at + boxes[i].at - lo);
    }
    for (GraphNode& node : pasted.nodes) {
        for (GraphInput& input : node.inputs) {
            std::erase_if(input.from, [&](const WireEnd& end) { return !renamed.count(end.node); });
            for (WireEnd& end : input.from) end.node = renamed[end.node];
        }
        std::erase_if(node.inputs, [](const GraphInput& input) { return input.from.empty(); });
    }
    for (Group& group : pasted_groups) {
        for (std::string& id : group.nodes) id = renamed[id];
        groups.push_back(std::move(group));
    }
    workspace.selected.clear();
    workspace.selected_comments.clear();
    for (Comment& comment : pasted_comments) {
        workspace.selected_comments.insert(comments.size());
        comments.push_back({comment.text, snapped(at + comment.at - lo)});
    }
    for (const GraphNode& node : pasted.nodes) workspace.selected.insert(node.id);
    Document::Step step(workspace.document);
    workspace.document.add_nodes(pasted.nodes);
    set_groups(workspace.document, groups);
    set_comments(workspace.document, comments);
}

bool is_output(const Graph& graph, const WireEnd& port) {
    return std::any_of(graph.outputs.begin(), graph.outputs.end(), [&](const WireEnd& end) { return same_end(end, port); });
}

void set_output(Workspace& workspace, const WireEnd& port, bool on) {
    std::vector<std::pair<std::string, std::string>> outputs;
    for (const WireEnd& end : workspace.graph().outputs)
        if (!same_end(end, port)) outputs.emplace_back(end.node, end.port);
    if (on) outputs.emplace_back(port.node, port.port);
    workspace.document.set_outputs(outputs);
}

}  // namespace voxloom::editor
