#include "app/editor/model/workspace.h"

#include "core/base/error.h"

namespace voxloom::editor {

namespace fs = std::filesystem;

namespace {

void move_paths(Document& document, const fs::path& from, const fs::path& to, const Registry& registry) {
    if (from == to) return;
    struct Moved {
        std::string node, key, path;
    };
    std::vector<Moved> moved;
    for (const GraphNode& node : document.graph().nodes) {
        const NodeType* type = registry.find(node.type);
        for (const GraphParam& param : node.params) {
            const ParamSpec* spec = type ? type->find_param(param.key) : nullptr;
            if (!spec || spec->kind != ParamKind::path_in || param.yaml.text.empty()) continue;
            if (fs::path(param.yaml.text).is_relative())
                moved.push_back({node.id, param.key,
                                 (from / param.yaml.text).lexically_normal().lexically_proximate(to).string()});
        }
    }
    Document::Step step(document);
    for (const Moved& m : moved) document.set_param(m.node, m.key, m.path);
}

}  // namespace

const GraphNode* Workspace::single() const {
    return selected.size() == 1 ? graph().find(*selected.begin()) : nullptr;
}

Workspace open_workspace(const fs::path& file) {
    Workspace workspace;
    workspace.document = Document::load(file);
    workspace.file = file;
    workspace.saved_text = workspace.document.text();
    return workspace;
}

void save_workspace(Workspace& workspace, const fs::path& file, const Registry& registry) {
    const fs::path folder = fs::absolute(file).lexically_normal().parent_path();
    Document moved = workspace.document;  // what cannot be saved stays as it is
    move_paths(moved, workspace.graph().folder(), folder, registry);
    moved.save(file);
    workspace.document = std::move(moved);
    workspace.file = file;
    workspace.saved_text = workspace.document.text();
}

std::string what_saving_destroys(const Workspace& workspace, const fs::path& file) {
    std::error_code error;
    if (!fs::exists(file, error)) return {};
    if (workspace.file.empty() || !fs::equivalent(file, workspace.file, error)) return "There is a file of this name already.";
    try {
        if (Document::load(file).text() == workspace.saved_text) return {};
    } catch (const Error&) {  // what is there now is no graph, and was one
    }
    return "Another program has changed the file since it was opened or saved here.";
}

void forget_missing(Workspace& workspace) {
    std::erase_if(workspace.selected, [&](const std::string& id) { return !workspace.graph().find(id); });
    workspace.selected_comments.clear();  // their numbers may be those of others now
}

}  // namespace voxloom::editor
