// Between a YAML tree and a Graph: reading one from the other, and patching the text where two
// graphs differ.
#pragma once

#include <string>
#include <vector>

#include "core/graph/document.h"
#include "core/graph/yaml_tree.h"

namespace voxloom {

// What the tree says. Everything that is wrong with its structure is added to `problems`; the graph
// then holds what could be understood.
Graph read_graph(const YamlNode& root, std::vector<Problem>& problems);

// A value on its own ("[1, 2]", "0.5"), as on a command line; false where it is none.
bool parse_yaml_value(const std::string& text, GraphParam::Yaml& yaml);

}  // namespace voxloom
