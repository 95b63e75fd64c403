// Edits of several parts, each one step of undo. All throw Error, leaving the document as it was.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/editor/model/layout.h"
#include "app/editor/model/notes.h"
#include "app/editor/model/workspace.h"

namespace voxloom::editor {

// "render" for slicer.render, or "render-2" where that is taken.
std::string fresh_id(const Graph& graph, std::string_view wanted);

// Adds a node, places it where there is room, and selects it. Returns its id.
std::string add_node(Workspace& workspace, const Registry& registry, const NodeType& type, glm::dvec2 at);

// Refuses with the reason of why_not_wired().
void connect(Workspace& workspace, const Registry& registry, const WireEnd& from, const WireEnd& to);
// Takes one wire off; the port's other wires stay.
void disconnect(Workspace& workspace, const WireEnd& from, const WireEnd& to);

// Adds a node and wires `from` to its port `port` (an input), or its output `port` to `to`.
std::string add_behind(Workspace& workspace, const Registry& registry, const Fit& fit, const WireEnd& from, glm::dvec2 at);
std::string add_before(Workspace& workspace, const Registry& registry, const Fit& fit, const WireEnd& to, glm::dvec2 at);

// Puts a node into the wire from -> to; nothing where the node has no ports that fit.
bool insert_on_wire(Workspace& workspace, const Registry& registry, const std::string& id,
                    const WireEnd& from, const WireEnd& to);

// With the selected comments.
void remove_selected(Workspace& workspace);
// The selected nodes become this; they become normal where all of them are this already.
void toggle_use(Workspace& workspace, GraphNode::Use use);
// Selected nodes and comments, by so much; `boxes` say where nodes are that the document has no place for.
void move_selected(Workspace& workspace, const std::vector<NodeBox>& boxes, glm::dvec2 by);
// Every node where auto_layout() puts it.
void arrange(Workspace& workspace, const Registry& registry);
// The selected nodes, one below the other, left edges aligned; below what else stands there.
void align_selected(Workspace& workspace, const Registry& registry);

// The selected nodes and comments as a graph of their own, with the wires between them, and with the
// groups that are selected as a whole.
std::string copy_selected(const Workspace& workspace, const Registry& registry);
// Adds what such a text holds around `at`, under ids that are free, and selects it.
void paste(Workspace& workspace, const Registry& registry, const std::string& text, glm::dvec2 at);

// Whether NODE.PORT is among the graph's outputs, and the change of that.
bool is_output(const Graph& graph, const WireEnd& port);
void set_output(Workspace& workspace, const WireEnd& port, bool on);

}  // namespace voxloom::editor
