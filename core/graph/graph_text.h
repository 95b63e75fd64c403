// Between a YAML text and a Graph: reading one from the other, and patching the text where two
// graphs differ.
#pragma once

#include <string>
#include <vector>

#include "core/graph/document.h"
#include "core/graph/yaml_tree.h"

namespace voxloom {

// What the tree says. Everything that is wrong with its structure is added to `problems`; the graph
// then holds what could be understood. Where nothing is wrong, node i of the graph is item i of the
// tree's list of nodes.
Graph read_graph(const YamlNode& root, std::vector<Problem>& problems);

// The same of one item of the list of nodes; its id may be that of another one.
GraphNode read_graph_node(const YamlNode& item, std::vector<Problem>& problems);

// Parts of same_content().
bool same_node(const GraphNode& a, const GraphNode& b);
bool same_beside_nodes(const Graph& a, const Graph& b);

// A value on its own ("[1, 2]", "0.5"), as on a command line; false where it is none.
bool parse_yaml_value(const std::string& text, GraphParam::Yaml& yaml);

// How a value is held in a graph and written in one line.
GraphParam::Yaml yaml_of(const ParamValue& value);
std::string to_text(const GraphParam::Yaml& yaml);

bool is_node_name(std::string_view name);  // 1 to 100 lower-case letters, digits, '_' and '-'

// Replaces `length` bytes from `position` on.
struct TextPatch {
    std::size_t position = 0, length = 0;
    std::string inserted;
};

// Which patches turn the text of `from`, parsed to `root`, into one of `to`, in rising order. The
// graphs may differ in what their nodes and outputs hold, or `to` lacks some nodes, or has more at
// its end. `surgical` patches touch what changed alone; otherwise whole nodes are written anew.
std::vector<TextPatch> patches_between(const std::string& text, const YamlNode& root,
                                       const Graph& from, const Graph& to, bool surgical);

}  // namespace voxloom
