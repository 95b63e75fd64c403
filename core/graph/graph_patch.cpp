// Patches the text of a graph at the places where two graphs differ. Knows the two ways in which
// YAML writes a collection: in brackets (flow), where entries are parted by commas, and as lines
// (block), where an entry owns its lines.
#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <utility>

#include "core/base/text.h"
#include "core/graph/graph_text.h"

namespace voxloom {

namespace {

using Yaml = GraphParam::Yaml;
using Kind = YamlNode::Kind;

constexpr std::size_t kColumns = 100;  // flow lists and maps are broken beyond

std::string scalar(const std::string& s) {
    return to_yaml(ParamValue(s));
}

Yaml yaml_of(const std::vector<WireEnd>& ends, bool is_list) {
    auto plain = [](const WireEnd& end) {
        Yaml yaml;
        yaml.text = end.port.empty() ? end.node : end.node + "." + end.port;
        return yaml;
    };
    if (!is_list) return ends.empty() ? Yaml() : plain(ends.front());
    Yaml list;
    list.kind = Yaml::Kind::list;
    for (const WireEnd& end : ends) list.items.push_back(plain(end));
    return list;
}

// Empty where the key is left out.
std::string text_of(std::optional<glm::dvec2> at) {
    return at ? fmt::format("[{}, {}]", shortest(at->x), shortest(at->y)) : "";
}

std::string text_of(GraphNode::Use use) {
    return use == GraphNode::Use::normal ? "" : std::string(name_of(use));
}

// Quoted only where it would not read back: the keys of a graph are names such as x, y and n.
std::string key_text(const std::string& key) {
    return is_node_name(key) && key[0] != '-' && key != "null" ? key : scalar(key);
}

// One line of a map: the form in which `in` and `set` are compared and written.
struct Entry {
    std::string key;
    Yaml value;
};

std::vector<Entry> entries_of(const std::vector<GraphInput>& inputs) {
    std::vector<Entry> entries;
    for (const GraphInput& input : inputs)
        entries.push_back({input.port, yaml_of(input.from, input.is_list)});
    return entries;
}

std::vector<Entry> entries_of(const std::vector<GraphParam>& params) {
    std::vector<Entry> entries;
    for (const GraphParam& param : params) entries.push_back({param.key, param.yaml});
    return entries;
}

const Entry* find(const std::vector<Entry>& entries, std::string_view key) {
    for (const Entry& entry : entries)
        if (entry.key == key) return &entry;
    return nullptr;
}

std::string to_text(const Entry& entry) {
    return key_text(entry.key) + ": " + voxloom::to_text(entry.value);
}

std::string to_text(const std::vector<Entry>& entries) {
    std::vector<std::string> parts;
    for (const Entry& entry : entries) parts.push_back(to_text(entry));
    return "{ " + join(parts, ", ") + " }";
}

// "id: ct", "type: readers.volume", ...: the lines of a node.
std::vector<std::string> lines_of(const GraphNode& node) {
    std::vector<std::string> lines{"id: " + scalar(node.id), "type: " + scalar(node.type)};
    if (std::string use = text_of(node.use); !use.empty()) lines.push_back("use: " + use);
    if (!node.inputs.empty()) lines.push_back("in: " + to_text(entries_of(node.inputs)));
    if (!node.params.empty()) lines.push_back("set: " + to_text(entries_of(node.params)));
    if (std::string at = text_of(node.at); !at.empty()) lines.push_back("at: " + at);
    return lines;
}

bool same_wires(const std::vector<WireEnd>& a, const std::vector<WireEnd>& b) {
    return std::equal(
        a.begin(), a.end(), b.begin(), b.end(),
        [](const WireEnd& x, const WireEnd& y) { return x.node == y.node && x.port == y.port; });
}

// Quotes matter only where the text could be taken for something else.
bool same(const Yaml& a, const Yaml& b) {
    auto is_list = [](const Yaml& y) { return y.kind == Yaml::Kind::list; };
    if (is_list(a) || is_list(b))
        return is_list(a) && is_list(b) &&
               std::equal(a.items.begin(), a.items.end(), b.items.begin(), b.items.end(), same);
    double number;
    bool ambiguous = parse_number(a.text, number) || a.text == "true" || a.text == "false";
    return a.text == b.text && (a.kind == b.kind || !ambiguous);
}

bool same(const std::vector<Entry>& a, const std::vector<Entry>& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Entry& x, const Entry& y) {
        return x.key == y.key && same(x.value, y.value);
    });
}

bool same(const GraphNode& a, const GraphNode& b) {
    return a.id == b.id && a.type == b.type && a.use == b.use && a.at == b.at &&
           std::equal(a.inputs.begin(), a.inputs.end(), b.inputs.begin(), b.inputs.end(),
                      [](const GraphInput& x, const GraphInput& y) {
                          return x.port == y.port && x.is_list == y.is_list &&
                                 same_wires(x.from, y.from);
                      }) &&
           std::equal(a.params.begin(), a.params.end(), b.params.begin(), b.params.end(),
                      [](const GraphParam& x, const GraphParam& y) {
                          return x.key == y.key && same(x.yaml, y.yaml);
                      });
}

class Patcher {
  public:
    Patcher(const std::string& text, const YamlNode& root, bool surgical)
        : text_(text),
          root_(root),
          surgical_(surgical),
          newline_(text.find("\r\n") == std::string::npos ? "\n" : "\r\n") {}

    std::vector<TextPatch> run(const Graph& from, const Graph& to) {
        patch_outputs(from.outputs, to.outputs);
        patch_entries(root_, "editor", entries_of(from.editor), entries_of(to.editor));
        patch_nodes(from.nodes, to.nodes);
        std::stable_sort(
            patches_.begin(), patches_.end(),
            [](const TextPatch& a, const TextPatch& b) { return a.position < b.position; });
        return std::move(patches_);
    }

  private:
    struct Span {
        std::size_t begin, end;
    };

    // --- what changed
    // ------------------------------------------------------------------------------

    void patch_outputs(const std::vector<WireEnd>& from, const std::vector<WireEnd>& to) {
        if (same_wires(from, to)) return;
        int i = root_.index_of("outputs");
        Yaml list = yaml_of(to, true);
        if (to.empty())
            remove_entries(root_, {i});
        else if (i < 0)
            insert_entry(root_, root_.index_of("voxloom"), "outputs: " + voxloom::to_text(list));
        else if (surgical_)
            patch_value(root_, i, yaml_of(from, true), list);
        else
            replace_value(root_, i, voxloom::to_text(list));
    }

    void patch_nodes(const std::vector<GraphNode>& from, const std::vector<GraphNode>& to) {
        int list = root_.index_of("nodes");
        std::vector<int> removed;
        std::size_t k = 0;
        for (std::size_t i = 0; i < from.size(); ++i) {
            bool gone = to.size() < from.size() && (k >= to.size() || to[k].id != from[i].id);
            if (gone)
                removed.push_back(int(i));
            else
                patch_node(root_.items[std::size_t(list)].items[i], from[i], to[k++],
                           i + 1 == from.size());
        }
        if (!removed.empty() && removed.size() == from.size())
            replace_value(root_, list, "[]");
        else if (!removed.empty())
            remove_items(root_.items[std::size_t(list)], removed);
        if (k == to.size()) return;
        if (from.empty()) return add_first_nodes(list, to);
        for (; k < to.size(); ++k) append_node(root_.items[std::size_t(list)], to[k]);
    }

    void append_node(const YamlNode& nodes, const GraphNode& node) {
        if (nodes.flow)
            append_item(nodes, "{ " + join(lines_of(node), ", ") + " }");
        else
            append_item(nodes, join(lines_of(node), newline_ + indent(column(nodes.begin) + 2)));
    }

    // Where the list is empty, or not there (-1).
    void add_first_nodes(int list, const std::vector<GraphNode>& nodes) {
        if (root_.flow) {
            std::vector<std::string> items;
            for (const GraphNode& node : nodes) items.push_back("{ " + join(lines_of(node), ", ") + " }");
            std::string value = "[" + join(items, ", ") + "]";
            if (list < 0)
                insert_entry(root_, int(root_.keys.size()) - 1, "nodes: " + value);
            else
                replace_value(root_, list, value);
        } else {
            std::size_t margin = column(root_.begin);
            std::string items;
            for (const GraphNode& node : nodes)
                items += newline_ + indent(margin + 2) + "- " +
                         join(lines_of(node), newline_ + indent(margin + 4));
            if (list < 0) {
                insert_entry(root_, int(root_.keys.size()) - 1, "nodes:" + items);
            } else {
                // '[]', '~' or nothing goes, a comment behind it stays.
                const YamlNode& value = root_.items[std::size_t(list)];
                std::size_t colon = behind_colon(root_.keys[std::size_t(list)]);
                patch(colon, value.end - colon, "");
                patch(line_end(value.end), 0, items);
            }
        }
    }

    // The last node is written anew even unchanged: a block text that ends it without a line break
    // would gain one from what is added behind.
    void patch_node(const YamlNode& map, const GraphNode& from, const GraphNode& to, bool last) {
        if (same(from, to) && (surgical_ || !last)) return;
        if (!surgical_) {
            std::vector<std::string> lines = lines_of(to);
            std::string anew = map.flow ? "{ " + join(lines, ", ") + " }"
                                        : join(lines, newline_ + indent(column(map.begin)));
            patch(map.begin, map.end - map.begin, anew);
            return;
        }
        if (from.id != to.id) replace_value(map, map.index_of("id"), scalar(to.id));
        if (from.type != to.type) replace_value(map, map.index_of("type"), scalar(to.type));
        patch_entries(map, "in", entries_of(from.inputs), entries_of(to.inputs));
        patch_entries(map, "set", entries_of(from.params), entries_of(to.params));
        patch_key(map, "use", text_of(from.use), text_of(to.use));
        patch_key(map, "at", text_of(from.at), text_of(to.at));
    }

    // A key whose value is written anew, and left out where it is empty.
    void patch_key(const YamlNode& map, std::string_view key, const std::string& from,
                   const std::string& to) {
        if (from == to) return;
        int at = map.index_of(key);
        if (to.empty())
            remove_entries(map, {at});
        else if (at < 0)
            insert_entry(map, predecessor(map, key), fmt::format("{}: {}", key, to));
        else
            replace_value(map, at, to);
    }

    void patch_entries(const YamlNode& node, std::string_view name, const std::vector<Entry>& from,
                       const std::vector<Entry>& to) {
        if (same(from, to)) return;
        int at = node.index_of(name);
        if (to.empty()) return remove_entries(node, {at});
        if (at < 0)
            return insert_entry(node, predecessor(node, name),
                                std::string(name) + ": " + to_text(to));
        const YamlNode& map = node.items[std::size_t(at)];
        if (map.items.empty()) return replace_value(node, at, to_text(to));
        std::vector<int> removed;
        for (const Entry& entry : from) {
            int i = map.index_of(entry.key);
            if (const Entry* now = find(to, entry.key))
                patch_value(map, i, entry.value, now->value);
            else
                removed.push_back(i);
        }
        if (!removed.empty()) remove_entries(map, removed);
        for (const Entry& entry : to)
            if (!find(from, entry.key)) insert_entry(map, int(map.keys.size()) - 1, to_text(entry));
    }

    // The entry behind which a key of a node goes, so that nodes read id, type, use, in, set, at; other
    // keys go last.
    static int predecessor(const YamlNode& node, std::string_view name) {
        int at = -1;
        for (std::string_view before : {"id", "type", "use", "in", "set", "at"}) {
            if (before == name) return at;
            at = std::max(at, node.index_of(before));
        }
        return int(node.keys.size()) - 1;
    }

    void patch_value(const YamlNode& map, int i, const Yaml& from, const Yaml& to) {
        if (same(from, to)) return;
        const YamlNode& value = map.items[std::size_t(i)];
        if (value.kind != Kind::sequence || to.kind != Yaml::Kind::list || to.items.empty() ||
            !patch_list(value, from, to))
            replace_value(map, i, voxloom::to_text(to));
    }

    // Item by item where the lists are as long as each other or one lacks some of the other's.
    bool patch_list(const YamlNode& list, const Yaml& from, const Yaml& to) {
        if (from.items.size() == to.items.size()) {
            for (std::size_t i = 0; i < to.items.size(); ++i) {
                if (same(from.items[i], to.items[i])) continue;
                const YamlNode& item = list.items[i];
                bool nested = item.kind == Kind::sequence && to.items[i].kind == Yaml::Kind::list &&
                              !to.items[i].items.empty();
                if (nested && patch_list(item, from.items[i], to.items[i])) continue;
                patch(item.begin, item.end - item.begin, voxloom::to_text(to.items[i]));
            }
            return true;
        }
        const Yaml& fewer = from.items.size() < to.items.size() ? from : to;
        const Yaml& more = from.items.size() < to.items.size() ? to : from;
        std::vector<int> extra;
        std::size_t k = 0;
        for (std::size_t i = 0; i < more.items.size(); ++i)
            if (k < fewer.items.size() && same(fewer.items[k], more.items[i]))
                ++k;
            else
                extra.push_back(int(i));
        if (k < fewer.items.size()) return false;
        if (&more == &from) {
            remove_items(list, extra);
            return true;
        }
        if (from.items.empty() || extra.front() != int(from.items.size())) return false;
        for (int i : extra) append_item(list, voxloom::to_text(to.items[std::size_t(i)]));
        return true;
    }

    // --- collections
    // ---------------------------------------------------------------------------------

    void insert_entry(const YamlNode& map, int after, const std::string& entry) {
        assert(after >= 0);
        std::size_t end = map.items[std::size_t(after)].end;
        if (map.flow)
            insert_in_flow(map, end, entry);
        else
            patch(line_end(end), 0, newline_ + indent(column(map.begin)) + entry);
    }

    void append_item(const YamlNode& list, const std::string& item) {
        std::size_t end = list.items.back().end;
        if (list.flow)
            insert_in_flow(list, end, item);
        else
            patch(line_end(end), 0, newline_ + indent(column(list.begin)) + "- " + item);
    }

    void insert_in_flow(const YamlNode& collection, std::size_t end, const std::string& entry) {
        bool fits = line_end(end) - line_start(end) + entry.size() + 2 <= kColumns;
        if (fits) return patch(end, 0, ", " + entry);
        // Below the first entry, unless that stands far out.
        const YamlNode& first =
            collection.kind == Kind::map ? collection.keys[0] : collection.items[0];
        std::size_t margin = column(first.begin);
        if (margin > kColumns / 2) margin = skip_spaces(line_start(end)) - line_start(end) + 4;
        patch(end, 0, "," + newline_ + indent(margin) + entry);
    }

    void remove_entries(const YamlNode& map, const std::vector<int>& removed) {
        std::vector<Span> spans;
        for (std::size_t i = 0; i < map.keys.size(); ++i)
            spans.push_back({map.keys[i].begin, map.items[i].end});
        remove_spans(spans, removed, map.flow);
    }

    void remove_items(const YamlNode& list, const std::vector<int>& removed) {
        std::vector<Span> spans;
        std::size_t end = list.begin;
        for (const YamlNode& item : list.items) {
            spans.push_back({list.flow ? item.begin : skip_blank(text_, end), item.end});
            end = item.end;
        }
        remove_spans(spans, removed, list.flow);
    }

    // At least one span stays.
    void remove_spans(const std::vector<Span>& spans, const std::vector<int>& removed, bool flow) {
        std::vector<bool> gone(spans.size());
        for (int i : removed) gone[std::size_t(i)] = true;
        for (std::size_t i = 0; i < spans.size();) {
            if (!gone[i]) {
                ++i;
                continue;
            }
            std::size_t next = i;
            while (next < spans.size() && gone[next]) ++next;
            if (flow || !begins_line(spans[i].begin)) {
                if (next < spans.size())
                    patch(spans[i].begin, spans[next].begin - spans[i].begin, "");
                else
                    remove_flow_tail(spans[i - 1].end, spans[i].begin, spans[next - 1].end);
            } else {
                // What stands on lines behind each other goes at once: the last may take a line break that is the other's.
                Span lines = spans[i];
                for (std::size_t k = i + 1; k < next; ++k) {
                    if (line_start(spans[k].begin) > next_line(lines.end))
                        remove_lines(std::exchange(lines, spans[k]));
                    else
                        lines.end = spans[k].end;
                }
                remove_lines(lines);
            }
            i = next;
        }
    }

    // On another line than what stays, the comma before it stays, too: a comment may stand between.
    // Then one behind it must go.
    void remove_flow_tail(std::size_t kept_end, std::size_t begin, std::size_t end) {
        if (line_end(kept_end) >= begin) {
            begin = kept_end;
        } else {
            if (std::size_t comma = skip_blank(text_, end); text_[comma] == ',')
                patch(comma, 1, "");
            if (begins_line(begin) && skip_spaces(end) == line_end(end))
                begin = end_of_line_before(begin);
        }
        patch(begin, end - begin, "");
    }

    void remove_lines(Span span) {
        std::size_t begin = line_start(span.begin), end = next_line(span.end);
        // The text's last line takes the line break before it along, so that none is added. Where that changes a
        // block text, it stays, and so that none gets more empty lines, those behind go.
        if (surgical_ && end == text_.size() && text_.back() != '\n') begin = end_of_line_before(begin);
        while (!surgical_ && is_empty_line(end)) end = next_line(end);
        patch(begin, end - begin, "");
    }

    void replace_value(const YamlNode& map, int i, const std::string& value) {
        const YamlNode& old = map.items[std::size_t(i)];
        const YamlNode& key = map.keys[std::size_t(i)];
        if (old.begin == old.end) {  // left out
            bool colon = old.begin > 0 && text_[old.begin - 1] == ':';
            patch(old.begin, 0, (colon ? " " : ": ") + value);
        } else if (!old.flow && (old.kind == Kind::sequence || old.kind == Kind::map)) {
            // Lines of their own below the key: the value goes behind the key, the lines go.
            patch(behind_colon(key), 0, " " + value);
            std::size_t begin = end_of_line_before(old.begin);
            patch(begin, line_end(old.end) - begin, "");
        } else {
            patch(old.begin, old.end - old.begin, value);
        }
    }

    // --- the text
    // ------------------------------------------------------------------------------------

    void patch(std::size_t position, std::size_t length, std::string inserted) {
        patches_.push_back({position, length, std::move(inserted)});
    }

    std::size_t behind_colon(const YamlNode& key) const { return skip_blank(text_, key.end) + 1; }

    std::size_t line_start(std::size_t at) const {
        std::size_t newline = at == 0 ? std::string::npos : text_.rfind('\n', at - 1);
        if (newline != std::string::npos) return newline + 1;
        return text_.starts_with("\xef\xbb\xbf") ? 3 : 0;  // behind the byte order mark
    }
    // Before the line break.
    std::size_t line_end(std::size_t at) const {
        std::size_t end = std::min(text_.find('\n', at), text_.size());
        return end > at && text_[end - 1] == '\r' ? end - 1 : end;
    }
    std::size_t end_of_line_before(std::size_t at) const {
        std::size_t start = line_start(at);
        if (start == 0 || text_[start - 1] != '\n') return start;
        return start > 1 && text_[start - 2] == '\r' ? start - 2 : start - 1;
    }
    std::size_t next_line(std::size_t at) const {
        std::size_t newline = text_.find('\n', at);
        return newline == std::string::npos ? text_.size() : newline + 1;
    }
    bool is_empty_line(std::size_t start) const {
        const std::size_t word = text_.find_first_not_of(" \r", start);
        return word != std::string::npos && text_[word] == '\n';
    }
    std::size_t column(std::size_t at) const { return at - line_start(at); }
    bool begins_line(std::size_t at) const {
        std::size_t start = line_start(at);
        return text_.find_first_not_of(' ', start) >= at;
    }
    std::size_t skip_spaces(std::size_t at) const {
        return std::min(text_.find_first_not_of(' ', at), text_.size());
    }
    static std::string indent(std::size_t columns) { return std::string(columns, ' '); }

    const std::string& text_;
    const YamlNode& root_;
    bool surgical_;
    std::string newline_;
    std::vector<TextPatch> patches_;
};

}  // namespace

Yaml yaml_of(const ParamValue& value) {
    Yaml yaml;
    auto list_of = [](const auto& values) {
        Yaml list;
        list.kind = Yaml::Kind::list;
        for (const auto& v : values) list.items.push_back(yaml_of(ParamValue(v)));
        return list;
    };
    if (auto* numbers = std::get_if<std::vector<double>>(&value)) return list_of(*numbers);
    if (auto* rows = std::get_if<Rows>(&value)) return list_of(*rows);
    if (auto* texts = std::get_if<std::vector<std::string>>(&value)) return list_of(*texts);
    if (auto* text = std::get_if<std::string>(&value)) {
        yaml.kind = scalar(*text).starts_with('"') ? Yaml::Kind::quoted : Yaml::Kind::plain;
        yaml.text = *text;
    } else {
        yaml.text = to_yaml(value);
    }
    return yaml;
}

std::string to_text(const Yaml& yaml) {
    if (yaml.kind == Yaml::Kind::list) {
        std::vector<std::string> items;
        for (const Yaml& item : yaml.items) items.push_back(to_text(item));
        return "[" + join(items, ", ") + "]";
    }
    // A number keeps the digits it was written with. Any other plain text may stand in brackets
    // now, where fewer characters are free, so it gets quotes unless it is as simple as a name.
    double number;
    if (yaml.kind == Yaml::Kind::plain &&
        (parse_number(yaml.text, number) || yaml.text == "true" || yaml.text == "false"))
        return yaml.text;
    return scalar(yaml.text);
}

bool same_node(const GraphNode& a, const GraphNode& b) { return same(a, b); }

bool same_beside_nodes(const Graph& a, const Graph& b) {
    return same_wires(a.outputs, b.outputs) && same(entries_of(a.editor), entries_of(b.editor));
}

bool same_content(const Graph& a, const Graph& b) {
    return same_beside_nodes(a, b) &&
           std::equal(a.nodes.begin(), a.nodes.end(), b.nodes.begin(), b.nodes.end(), same_node);
}

std::vector<TextPatch> patches_between(const std::string& text, const YamlNode& root,
                                       const Graph& from, const Graph& to, bool surgical) {
    return Patcher(text, root, surgical).run(from, to);
}

}  // namespace voxloom
