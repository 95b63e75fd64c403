// What is being edited: a document, where it is saved, and what of it is selected.
#pragma once

#include <filesystem>
#include <set>
#include <string>

#include "core/graph/document.h"
#include "core/plugin/registry.h"

namespace voxloom::editor {

struct Workspace {
    Document document;
    std::filesystem::path file;      // empty: never saved
    std::string saved_text;          // what the file holds
    std::set<std::string> selected;  // ids of nodes
    std::set<std::size_t> selected_comments;  // by index of comments_of()

    Workspace() : saved_text(document.text()) {}
    const Graph& graph() const { return document.graph(); }
    bool changed() const { return document.text() != saved_text; }
    // The selected node where there is exactly one, else null.
    const GraphNode* single() const;
};

Workspace open_workspace(const std::filesystem::path& file);  // throws Error
// Relative paths of files to read keep naming the same files when the graph goes to another folder.
void save_workspace(Workspace& workspace, const std::filesystem::path& file, const Registry& registry);
// What saving there would destroy that this workspace knows nothing of, in a sentence; empty where there is nothing.
std::string what_saving_destroys(const Workspace& workspace, const std::filesystem::path& file);
// Undone or removed nodes cannot stay selected.
void forget_missing(Workspace& workspace);

}  // namespace voxloom::editor
