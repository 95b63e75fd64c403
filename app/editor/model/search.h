// Finding a node type by a few letters.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/plugin/registry.h"

namespace voxloom::editor {

// How well the letters of `query` are found in `text`, in their order and without regard to case:
// 0 when they are not; more for beginnings of words and for letters side by side.
int fuzzy_score(std::string_view query, std::string_view text);

// The types that match in title, id or keyword, best first; all of them, by title, for an empty query.
std::vector<const NodeType*> find_nodes(const std::vector<const NodeType*>& types, std::string_view query);

}  // namespace voxloom::editor
