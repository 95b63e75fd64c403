// Parameters as the interface reads and writes them.
#pragma once

#include <string_view>

#include "core/graph/document.h"
#include "core/graph/node.h"

namespace voxloom::editor {

// As the document has it; null where it has not.
const GraphParam* find_param(const GraphNode& node, std::string_view key);

// The value of a parameter as the document has it, or its default.
ParamValue value_of(const GraphNode& node, const ParamSpec& spec);

// Whether another parameter has not made it meaningless (ParamSpec::shown_if_key).
bool is_in_use(const GraphNode& node, const NodeType& type, const ParamSpec& spec);

// Six significant digits: what a hand can aim at, and what people can read in the file.
double short_number(double v);

}  // namespace voxloom::editor
