// A node's page in Markdown, made from its description alone: the docs and `voxloom nodes TYPE`.
#pragma once

#include <string>

#include "core/plugin/registry.h"

namespace voxloom::cli {

std::string node_page(const NodeType& type);
std::string node_index(const Registry& registry);

}  // namespace voxloom::cli
