#include "core/graph/graph_edit.h"

#include <algorithm>
#include <set>
#include <tuple>

namespace voxloom {

namespace {

// By how much what stands behind some splices has moved.
struct Shift {
    std::ptrdiff_t bytes = 0;
    int lines = 0;
};

int count_lines(std::string_view text) { return int(std::ranges::count(text, '\n')); }

// Where things are after the splices (or before them, going back), from where they were.
class Shifts {
  public:
    Shifts(const std::vector<Splice>& splices, bool back) {
        Shift sum;
        for (const Splice& s : splices) {
            const std::string& gone = back ? s.inserted : s.removed;
            const std::string& come = back ? s.removed : s.inserted;
            const auto begin = std::size_t(std::ptrdiff_t(s.position) - (back ? sum.bytes : 0));
            sum.bytes += std::ptrdiff_t(come.size()) - std::ptrdiff_t(gone.size());
            sum.lines += count_lines(come) - count_lines(gone);
            ends_.push_back(begin + gone.size());
            sums_.push_back(sum);
        }
    }
    // Of what begins at `position`, outside of what is replaced.
    Shift at(std::size_t position) const {
        const auto behind = std::ranges::upper_bound(ends_, position) - ends_.begin();
        return behind == 0 ? Shift() : sums_[std::size_t(behind - 1)];
    }

  private:
    std::vector<std::size_t> ends_;
    std::vector<Shift> sums_;
};

void move_by(Mark& mark, Shift by) {
    if (mark.line > 0) mark.line += by.lines;
}
void move_by(YamlNode& node, Shift by) {
    move_by(node.mark, by);
    node.begin = std::size_t(std::ptrdiff_t(node.begin) + by.bytes);
    node.end = std::size_t(std::ptrdiff_t(node.end) + by.bytes);
    for (YamlNode& item : node.items) move_by(item, by);
    for (YamlNode& key : node.keys) move_by(key, by);
}
void move_by(GraphParam::Yaml& yaml, Shift by) {
    move_by(yaml.mark, by);
    for (GraphParam::Yaml& item : yaml.items) move_by(item, by);
}
void move_by(GraphParam& param, Shift by) {
    move_by(param.mark, by);
    move_by(param.yaml, by);
}
void move_by(GraphNode& node, Shift by) {
    move_by(node.mark, by);
    move_by(node.type_mark, by);
    for (GraphInput& input : node.inputs) {
        move_by(input.mark, by);
        for (WireEnd& end : input.from) move_by(end.mark, by);
    }
    for (GraphParam& param : node.params) move_by(param, by);
}

// --- reading single nodes -------------------------------------------------------------------------

std::size_t next_line(const std::string& text, std::size_t at) { return std::min(text.find('\n', at), text.size() - 1) + 1; }
std::size_t column_of(const std::string& text, std::size_t at) {
    const std::size_t newline = at == 0 ? std::string::npos : text.rfind('\n', at - 1);
    return newline == std::string::npos ? at : at - newline - 1;
}

// A part of the text that holds one node and nothing of any other, to the end of its last line.
struct Lines {
    std::string text;
    std::size_t column = 0;   // in which it begins
    std::size_t position = 0; // at which it begins, and its line, from 1
    int line = 0;
};

// Block texts depend on what stands behind them.
bool can_be_alone(std::string_view text) { return text.find_first_of("|>") == std::string_view::npos; }

std::optional<GraphEdit::Side> read_alone(const Lines& lines, int index, const GraphNode& wanted) {
    if (!can_be_alone(lines.text) || lines.position < lines.column) return {};
    std::vector<Problem> problems;
    auto tree = std::make_shared<YamlNode>(parse_yaml(std::string(lines.column, ' ') + lines.text, problems));
    if (!problems.empty() || tree->kind != YamlNode::Kind::map || tree->begin != lines.column) return {};
    move_by(*tree, {std::ptrdiff_t(lines.position - lines.column), lines.line - 1});
    GraphNode node = read_graph_node(*tree, problems);
    if (!problems.empty() || !same_node(node, wanted)) return {};
    return GraphEdit::Side{index, std::move(tree), std::move(node)};
}

// --- which nodes an edit changes -------------------------------------------------------------------

class Edited {
  public:
    Edited(const std::string& text, const YamlNode& list, const Graph& from, const Graph& to, const std::vector<Splice>& splices)
        : text_(text), list_(list), from_(from), to_(to), splices_(splices), shifts_(splices, false) {}

    std::optional<std::vector<GraphEdit::Item>> items() {
        const bool fine = to_.nodes.size() > from_.nodes.size() ? read_added() : read_changed();
        return fine && !items_.empty() ? std::optional(std::move(items_)) : std::nullopt;
    }

  private:
    const YamlNode& item(std::size_t i) const { return list_.items[i]; }

    GraphEdit::Side side_before(std::size_t i) const {
        return {int(i), std::make_shared<const YamlNode>(item(i)), from_.nodes[i]};
    }

    // Nodes behind the last one, and nothing else. Each is a splice: a line break, "- " and its lines.
    bool read_added() {
        const std::size_t old = from_.nodes.size();
        if (splices_.size() != to_.nodes.size() - old || !can_be_alone(std::string_view(text_).substr(item(old - 1).begin))) return false;
        for (std::size_t i = 0; i < old; ++i)
            if (!same_node(from_.nodes[i], to_.nodes[i])) return false;
        int line = 1 + count_lines(std::string_view(text_).substr(0, splices_.front().position));
        std::size_t before = 0;  // bytes of the ones inserted before
        for (std::size_t k = 0; k < splices_.size(); ++k) {
            const Splice& s = splices_[k];
            const std::size_t dash = s.inserted.find("- "), newline = s.inserted.find('\n');
            if (!s.removed.empty() || s.position < item(old - 1).end || dash == std::string::npos || newline > dash) return false;
            const Lines lines{s.inserted.substr(dash + 2), dash + 1 - newline, s.position + before + dash + 2, line + 1};
            auto after = read_alone(lines, int(old + k), to_.nodes[old + k]);
            if (!after) return false;
            items_.push_back({{}, std::move(*after)});
            line += count_lines(s.inserted);
            before += s.inserted.size();
        }
        return true;
    }

    // Nodes that hold something else, or are gone.
    bool read_changed() {
        std::size_t taken = 0, k = 0;  // splices that belong to a node that stays; the index after
        std::vector<std::size_t> gone;
        for (std::size_t i = 0; i < from_.nodes.size(); ++i) {
            const bool missing = from_.nodes.size() > to_.nodes.size() && (k == to_.nodes.size() || to_.nodes[k].id != from_.nodes[i].id);
            if (missing) {
                gone.push_back(i);
                items_.push_back({side_before(i), {}});
                continue;
            }
            const std::size_t count = splices_in(i);
            if (count == 0 && !same_node(from_.nodes[i], to_.nodes[k])) return false;
            if (count > 0 && !read_again(i, k)) return false;
            taken += count;
            ++k;
        }
        if (k != to_.nodes.size() || (!gone.empty() && gone.front() == 0)) return false;
        return stand_alone_before(gone) && are_taken_whole(gone) && taken + removals_beside(gone) == splices_.size();
    }

    // What stands before a node that goes stays what it is, whatever follows it.
    bool stand_alone_before(const std::vector<std::size_t>& gone) const {
        return std::ranges::all_of(gone, [&](std::size_t i) {
            return can_be_alone(std::string_view(text_).substr(item(i - 1).begin, item(i).begin - item(i - 1).begin));
        });
    }
    bool are_taken_whole(const std::vector<std::size_t>& gone) const {
        return std::ranges::all_of(gone, [&](std::size_t i) {
            return std::ranges::any_of(splices_, [&](const Splice& s) {
                return s.inserted.empty() && s.position <= item(i).begin && item(i).end <= s.position + s.removed.size();
            });
        });
    }

    std::size_t region_end(std::size_t i) const { return next_line(text_, item(i).end); }
    bool is_in(const Splice& s, std::size_t i) const { return s.position >= item(i).begin && s.position + s.removed.size() <= region_end(i); }
    std::size_t splices_in(std::size_t i) const {
        return std::size_t(std::ranges::count_if(splices_, [&](const Splice& s) { return is_in(s, i); }));
    }

    bool read_again(std::size_t i, std::size_t k) {
        const std::size_t begin = item(i).begin, column = column_of(text_, begin);
        if (item(i).mark.column != int(column) + 1) return false;
        const std::string before = text_.substr(begin, region_end(i) - begin);
        std::vector<Splice> mine;
        for (const Splice& s : splices_)
            if (is_in(s, i)) mine.push_back({s.position - begin, s.removed, s.inserted});
        const Shift shift = shifts_.at(begin);
        const Lines lines{spliced(before, mine), column, std::size_t(std::ptrdiff_t(begin) + shift.bytes), item(i).mark.line + shift.lines};
        if (!can_be_alone(before)) return false;
        auto after = read_alone(lines, int(k), to_.nodes[k]);
        if (after) items_.push_back({side_before(i), std::move(*after)});
        return after.has_value();
    }

    // Splices that take whole nodes away, and nothing of those that stay.
    std::size_t removals_beside(const std::vector<std::size_t>& gone) const {
        const std::set<std::size_t> is_gone(gone.begin(), gone.end());
        return std::size_t(std::ranges::count_if(splices_, [&](const Splice& s) {
            if (!s.inserted.empty()) return false;
            bool takes_one = false;
            for (std::size_t i = 0; i < from_.nodes.size(); ++i) {
                const bool meets = s.position < item(i).end && item(i).begin < s.position + s.removed.size();
                if (meets && !is_gone.count(i)) return false;
                takes_one = takes_one || meets;
            }
            return takes_one;
        }));
    }

    const std::string& text_;
    const YamlNode& list_;
    const Graph &from_, &to_;
    const std::vector<Splice>& splices_;
    const Shifts shifts_;
    std::vector<GraphEdit::Item> items_;
};

}  // namespace

std::string spliced(const std::string& text, const std::vector<Splice>& splices, bool back) {
    std::string result;
    std::size_t at = 0;        // in the text
    std::ptrdiff_t shift = 0;  // of the text from the one before
    for (const Splice& s : splices) {
        const std::string& gone = back ? s.inserted : s.removed;
        const std::size_t position = std::size_t(std::ptrdiff_t(s.position) + shift);
        result.append(text, at, position - at).append(back ? s.removed : s.inserted);
        at = position + gone.size();
        if (back) shift += std::ptrdiff_t(s.inserted.size()) - std::ptrdiff_t(s.removed.size());
    }
    return result.append(text, at);
}

std::optional<std::vector<GraphEdit::Item>> items_of_edit(const std::string& text, const YamlNode& tree, const Graph& from, const Graph& to,
                                                          const std::vector<Splice>& splices) {
    const int at = tree.index_of("nodes");
    if (at < 0 || !same_beside_nodes(from, to)) return {};
    const YamlNode& list = tree.items[std::size_t(at)];
    if (list.kind != YamlNode::Kind::sequence || list.flow || from.nodes.empty() || to.nodes.empty() || splices.empty()) return {};
    return Edited(text, list, from, to, splices).items();
}

void follow(const GraphEdit& edit, bool back, YamlNode& tree, Graph& graph) {
    const Shifts shifts(edit.splices, back);
    const auto at = std::size_t(tree.index_of("nodes"));
    YamlNode& list = tree.items[at];
    const bool last_key = tree.end == tree.items.back().end;

    // What only moves fills the places that are left, in the same order.
    const std::size_t count = std::size_t(std::ptrdiff_t(list.items.size()) + std::ranges::count_if(edit.items, [&](const GraphEdit::Item& i) { return (back ? i.before : i.after).tree != nullptr; }) -
                              std::ranges::count_if(edit.items, [&](const GraphEdit::Item& i) { return (back ? i.after : i.before).tree != nullptr; }));
    std::vector<YamlNode> items(count);
    std::vector<GraphNode> nodes(count);
    std::vector<bool> gone(list.items.size()), filled(count);
    for (const GraphEdit::Item& item : edit.items) {
        const auto& [from, to] = back ? std::tie(item.after, item.before) : std::tie(item.before, item.after);
        if (from.tree) gone[std::size_t(from.index)] = true;
        if (!to.tree) continue;
        items[std::size_t(to.index)] = *to.tree;
        nodes[std::size_t(to.index)] = to.node;
        filled[std::size_t(to.index)] = true;
    }
    std::size_t k = 0;
    for (std::size_t i = 0; i < list.items.size(); ++i) {
        if (gone[i]) continue;
        while (filled[k]) ++k;
        const Shift shift = shifts.at(list.items[i].begin);
        move_by(list.items[i], shift);
        move_by(graph.nodes[i], shift);
        items[k] = std::move(list.items[i]);
        nodes[k] = std::move(graph.nodes[i]);
        ++k;
    }
    list.items = std::move(items);
    graph.nodes = std::move(nodes);
    list.end = list.items.back().end;

    for (std::size_t e = at + 1; e < tree.items.size(); ++e) {
        const Shift shift = shifts.at(tree.keys[e].begin);
        move_by(tree.keys[e], shift);
        move_by(tree.items[e], shift);
        if (tree.keys[e].text == "outputs")
            for (WireEnd& end : graph.outputs) move_by(end.mark, shift);
        if (tree.keys[e].text == "editor")
            for (GraphParam& entry : graph.editor) move_by(entry, shift);
    }
    tree.end = last_key ? tree.items.back().end : std::size_t(std::ptrdiff_t(tree.end) + shifts.at(tree.end).bytes);
}

bool same_places(const YamlNode& a, const YamlNode& b) {
    return a.kind == b.kind && a.flow == b.flow && a.mark.line == b.mark.line && a.mark.column == b.mark.column && a.begin == b.begin &&
           a.end == b.end && a.text == b.text && std::ranges::equal(a.items, b.items, same_places) && std::ranges::equal(a.keys, b.keys, same_places);
}

}  // namespace voxloom
