// What people write beside a graph: titles of groups of nodes, and comments. Both stand in the graph's
// file, where a run does not look:
//
//   editor: { groups: [[A title, ct, view]], comments: [["A text", 40, -120]] }
//
// Every change is one step of undo.
#pragma once

#include <string>
#include <vector>

#include "app/editor/model/layout.h"
#include "app/editor/model/workspace.h"

namespace voxloom::editor {

struct Group {
    std::string title;
    std::vector<std::string> nodes;  // ids; a node is in one group at most
};
struct Comment {
    std::string text;
    glm::dvec2 at{0.0};  // upper left corner
};

// What cannot be understood is left out, and so are nodes that are not there and groups without any.
std::vector<Group> groups_of(const Graph& graph);
std::vector<Comment> comments_of(const Graph& graph);
void set_groups(Document& document, const std::vector<Group>& groups);
void set_comments(Document& document, const std::vector<Comment>& comments);

inline constexpr double kGroupMargin = 14, kGroupTitle = 24;
// Around its nodes, with room for the title above them. By index of `groups`.
std::vector<NodeBox> boxes_of_groups(const std::vector<Group>& groups, const Graph& graph,
                                     const std::vector<NodeBox>& nodes);

// The selected nodes leave their groups for a new one. Returns its index.
std::size_t group_selected(Workspace& workspace, const std::string& title);
// Groups with a selected node are none any more; their nodes stay.
void ungroup_selected(Workspace& workspace);
// Selects the comment, alone. Returns its index.
std::size_t add_comment(Workspace& workspace, const std::string& text, glm::dvec2 at);
void set_title(Workspace& workspace, std::size_t group, const std::string& title);
// A comment without a text is removed.
void set_comment(Workspace& workspace, std::size_t comment, const std::string& text);
// A node's new name goes into its group as well.
void rename_node(Workspace& workspace, const std::string& id, const std::string& to);

}  // namespace voxloom::editor
