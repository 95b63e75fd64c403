// One edit of a graph's text, and how its tree and its graph follow it, there and back, without the text being
// read again.
//
// Most edits change lines of single nodes, add nodes at the end, or remove some. Where the nodes are a list of
// lines, such a node's lines can be read alone: what they say does not depend on what stands around them. All
// other nodes only move. Whatever does not fit (lists in brackets, block texts, what is not a node) is left to
// those who read the whole text.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/graph/graph_text.h"

namespace voxloom {

// A part of a text that was replaced.
struct Splice {
    std::size_t position;  // in the text before
    std::string removed, inserted;
};
// The text after the splices, which stand in rising order and do not overlap; with `back`, the one before them.
std::string spliced(const std::string& text, const std::vector<Splice>& splices, bool back = false);

// A text that was read.
struct ReadText {
    Graph graph;
    std::shared_ptr<YamlNode> tree;
};

struct GraphEdit {
    std::vector<Splice> splices;

    // A node that is not only elsewhere in the text. On the side where it is not there: no index, no tree.
    struct Side {
        int index = -1;  // among the nodes
        std::shared_ptr<const YamlNode> tree;
        GraphNode node{};
    };
    struct Item {
        Side before, after;
    };
    std::vector<Item> items;  // in rising order of either index; empty: the edit is of something else

    // Of such edits, the whole; null where it has been forgotten.
    std::shared_ptr<const ReadText> before, after;
};

// The items of an edit that turns `from` into `to`; nothing where it must be read as a whole, or does not say
// what `to` says.
std::optional<std::vector<GraphEdit::Item>> items_of_edit(const std::string& text, const YamlNode& tree, const Graph& from, const Graph& to,
                                                          const std::vector<Splice>& splices);

// Tree and graph after an edit that has items; with `back`, before it.
void follow(const GraphEdit& edit, bool back, YamlNode& tree, Graph& graph);

// Whether both trees say the same at the same places.
bool same_places(const YamlNode& a, const YamlNode& b);

}  // namespace voxloom
