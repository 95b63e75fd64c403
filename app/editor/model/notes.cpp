#include "app/editor/model/notes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/base/error.h"
#include "core/base/text.h"

namespace voxloom::editor {

namespace {

using Yaml = GraphParam::Yaml;

Yaml text_of(const std::string& text) { return {Yaml::Kind::quoted, text, {}, {}}; }
Yaml number_of(double v) { return {Yaml::Kind::plain, shortest(v), {}, {}}; }
Yaml list_of(std::vector<Yaml> items) { return {Yaml::Kind::list, {}, std::move(items), {}}; }

// The items of one key of `editor:` that are lists, each of at least `least` items.
std::vector<const Yaml*> entries_of(const Graph& graph, std::string_view key, std::size_t least) {
    std::vector<const Yaml*> entries;
    for (const GraphParam& param : graph.editor)
        if (param.key == key)
            for (const Yaml& item : param.yaml.items)
                if (item.kind == Yaml::Kind::list && item.items.size() >= least && item.items[0].kind != Yaml::Kind::list)
                    entries.push_back(&item);
    return entries;
}

void take_out(std::vector<Group>& groups, const std::set<std::string>& nodes) {
    for (Group& group : groups) std::erase_if(group.nodes, [&](const std::string& id) { return nodes.count(id) > 0; });
    std::erase_if(groups, [](const Group& group) { return group.nodes.empty(); });
}

}  // namespace

std::vector<Group> groups_of(const Graph& graph) {
    std::vector<Group> groups;
    std::set<std::string> taken;
    std::set<std::string_view> there;
    for (const GraphNode& node : graph.nodes) there.insert(node.id);
    for (const Yaml* entry : entries_of(graph, "groups", 2)) {
        Group group{entry->items[0].text, {}};
        for (std::size_t i = 1; i < entry->items.size(); ++i)
            if (const std::string& id = entry->items[i].text; there.count(id) && taken.insert(id).second) group.nodes.push_back(id);
        if (!group.nodes.empty()) groups.push_back(std::move(group));
    }
    return groups;
}

std::vector<Comment> comments_of(const Graph& graph) {
    std::vector<Comment> comments;
    for (const Yaml* entry : entries_of(graph, "comments", 3)) {
        Comment comment{entry->items[0].text, {}};
        if (parse_number(entry->items[1].text, comment.at.x) && parse_number(entry->items[2].text, comment.at.y) &&
            std::isfinite(comment.at.x) && std::isfinite(comment.at.y))
            comments.push_back(std::move(comment));
    }
    return comments;
}

void set_groups(Document& document, const std::vector<Group>& groups) {
    std::vector<Yaml> list;
    for (const Group& group : groups) {
        std::vector<Yaml> entry{text_of(group.title)};
        for (const std::string& id : group.nodes) entry.push_back(text_of(id));
        list.push_back(list_of(std::move(entry)));
    }
    document.set_editor("groups", list_of(std::move(list)));
}

void set_comments(Document& document, const std::vector<Comment>& comments) {
    std::vector<Yaml> list;
    for (const Comment& comment : comments)
        list.push_back(list_of({text_of(comment.text), number_of(comment.at.x), number_of(comment.at.y)}));
    document.set_editor("comments", list_of(std::move(list)));
}

std::vector<NodeBox> boxes_of_groups(const std::vector<Group>& groups, const Graph& graph, const std::vector<NodeBox>& nodes) {
    std::map<std::string_view, std::size_t> index;
    for (std::size_t i = 0; i < graph.nodes.size(); ++i) index.emplace(graph.nodes[i].id, i);
    std::vector<NodeBox> boxes;
    for (const Group& group : groups) {
        glm::dvec2 lo(1e300), hi(-1e300);
        for (const std::string& id : group.nodes) {
            const NodeBox& box = nodes[index.at(id)];
            lo = glm::min(lo, box.at);
            hi = glm::max(hi, box.at + box.size);
        }
        lo -= glm::dvec2(kGroupMargin, kGroupMargin + kGroupTitle);
        boxes.push_back({lo, hi + glm::dvec2(kGroupMargin) - lo});
    }
    return boxes;
}

std::size_t group_selected(Workspace& workspace, const std::string& title) {
    if (workspace.selected.empty()) fail("select the nodes of a group first");
    std::vector<Group> groups = groups_of(workspace.graph());
    take_out(groups, workspace.selected);
    groups.push_back({title, {workspace.selected.begin(), workspace.selected.end()}});
    set_groups(workspace.document, groups);
    return groups.size() - 1;
}

void ungroup_selected(Workspace& workspace) {
    std::vector<Group> groups = groups_of(workspace.graph());
    std::erase_if(groups, [&](const Group& group) {
        return std::ranges::any_of(group.nodes, [&](const std::string& id) { return workspace.selected.count(id) > 0; });
    });
    set_groups(workspace.document, groups);
}

std::size_t add_comment(Workspace& workspace, const std::string& text, glm::dvec2 at) {
    std::vector<Comment> comments = comments_of(workspace.graph());
    comments.push_back({text, snapped(at)});
    set_comments(workspace.document, comments);
    workspace.selected.clear();
    workspace.selected_comments = {comments.size() - 1};
    return comments.size() - 1;
}

void set_title(Workspace& workspace, std::size_t group, const std::string& title) {
    std::vector<Group> groups = groups_of(workspace.graph());
    groups.at(group).title = title;
    set_groups(workspace.document, groups);
}

void set_comment(Workspace& workspace, std::size_t comment, const std::string& text) {
    std::vector<Comment> comments = comments_of(workspace.graph());
    comments.at(comment).text = text;
    if (text.empty()) {
        comments.erase(comments.begin() + std::ptrdiff_t(comment));
        workspace.selected_comments.clear();
    }
    set_comments(workspace.document, comments);
}

void rename_node(Workspace& workspace, const std::string& id, const std::string& to) {
    std::vector<Group> groups = groups_of(workspace.graph());
    Document::Step step(workspace.document);
    workspace.document.rename_node(id, to);
    for (Group& group : groups) std::ranges::replace(group.nodes, id, to);
    set_groups(workspace.document, groups);
    if (workspace.selected.erase(id)) workspace.selected.insert(to);
}

}  // namespace voxloom::editor
