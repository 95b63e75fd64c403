// A YAML text as a tree that remembers where in the text everything stands, so that edits can patch
// the text and messages can name line and column.
//
// Parsing is yaml-cpp's, through its events; it reports where things begin. Where they end is found
// here, from the text between one event and the next. What a graph has no use for and an edit could
// break is refused with a sentence: anchors, aliases, tags, directives, several documents, '? '
// keys, pairs without braces in a flow list, block texts with an indentation number, deep nesting.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/graph/document.h"

namespace voxloom {

struct YamlNode {
    enum class Kind : std::uint8_t { null, plain, quoted, sequence, map } kind = Kind::null;
    bool flow = false;               // a collection in [] or {}
    Mark mark;                       // of `begin`; columns count characters
    std::size_t begin = 0, end = 0;  // bytes of the text; a value left out is empty, after its ':'
    std::string text;                // of scalars, unescaped and unfolded
    std::vector<YamlNode> items;     // of a sequence; the values of a map
    std::vector<YamlNode> keys;      // of a map, beside items; scalars, no two alike

    bool is_scalar() const { return kind == Kind::plain || kind == Kind::quoted; }
    int index_of(std::string_view key) const;  // -1 when there is no such key
    const YamlNode* find(std::string_view key) const;
};

inline constexpr std::size_t kMaximumGraphBytes = std::size_t(16) << 20;
inline constexpr int kMaximumGraphDepth = 16;

// Parses; null for a text without content. Adds what is wrong to `problems`: duplicate keys (all of
// them), else the first thing that is refused; the tree is then not to be used.
YamlNode parse_yaml(const std::string& text, std::vector<Problem>& problems);

// The first position from `position` on that is neither white space nor comment.
std::size_t skip_blank(std::string_view text, std::size_t position);

// Offset of the first byte that is not UTF-8, or npos.
std::size_t find_invalid_utf8(std::string_view text);

}  // namespace voxloom
