#include "core/graph/document.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <fstream>
#include <set>

#include "core/base/error.h"
#include "core/base/text.h"
#include "core/graph/graph_edit.h"

namespace voxloom {

namespace fs = std::filesystem;

std::string Problem::text(const fs::path& file) const {
    if (mark.line == 0) return message;  // not from the text, but from the command line
    std::string place =
        fmt::format("{}:{}:{}", file.empty() ? "graph" : file.string(), mark.line, mark.column);
    return node.empty() ? fmt::format("{}: {}", place, message)
                        : fmt::format("{}: node '{}': {}", place, node, message);
}

std::string_view name_of(GraphNode::Use use) {
    constexpr std::string_view names[] = {"normal", "bypassed", "disabled"};
    return names[std::size_t(use)];
}

const GraphNode* Graph::find(std::string_view id) const {
    for (const GraphNode& node : nodes)
        if (node.id == id) return &node;
    return nullptr;
}

fs::path Graph::folder() const {
    return file.empty() ? fs::current_path() : fs::absolute(file).lexically_normal().parent_path();
}

// --- reading and writing
// ----------------------------------------------------------------------------

Document::Document() : Document(parse("voxloom: 1\nnodes: []\n")) {}

Document Document::parse(std::string text, fs::path file) {
    Document document{Parsed()};
    document.text_ = std::move(text);
    document.graph_.file = std::move(file);
    document.read();
    return document;
}

// From text_ to tree_ and graph_, which stay as they are when the text is refused.
void Document::read() {
    std::vector<Problem> problems;
    auto tree = std::make_shared<YamlNode>(parse_yaml(text_, problems));
    Graph graph;
    if (problems.empty()) graph = read_graph(*tree, problems);
    if (!problems.empty()) {
        std::stable_sort(problems.begin(), problems.end(), [](const Problem& a, const Problem& b) {
            return std::pair(a.mark.line, a.mark.column) < std::pair(b.mark.line, b.mark.column);
        });
        std::vector<std::string> lines;
        for (const Problem& problem : problems) lines.push_back(problem.text(graph_.file));
        throw Error(join(lines, "\n"));
    }
    graph.file = std::move(graph_.file);
    graph_ = std::move(graph);
    tree_ = std::move(tree);
}

Document Document::load(const fs::path& file) {
    std::error_code error;
    if (fs::is_directory(file, error)) fail("{}: is a folder, not a graph file", file.string());
    std::ifstream stream(file, std::ios::binary);
    if (!stream)
        fail("{}: the graph cannot be opened ({}); check the path", file.string(),
             std::generic_category().message(errno));
    // In pieces and no further than is allowed, whatever size the file claims to have.
    std::string text;
    for (char piece[1 << 16]; stream && text.size() <= kMaximumGraphBytes;) {
        stream.read(piece, sizeof piece);
        text.append(piece, std::size_t(stream.gcount()));
    }
    if (stream.bad()) fail("{}: the graph cannot be read", file.string());
    return parse(std::move(text), file);
}

void Document::save(const fs::path& file) {
    // Through a link, the file behind it is replaced, not the link.
    std::error_code ignored, error;
    fs::path target = fs::is_symlink(file, ignored) ? fs::canonical(file, error) : file;
    if (error) fail("{}: the link leads nowhere; remove it or save elsewhere", file.string());
    fs::path temporary = target;
    temporary += fmt::format(".{}.part", getpid());
    std::ofstream stream(temporary, std::ios::binary);
    stream.write(text_.data(), std::streamsize(text_.size()));
    stream.close();
    if (!stream) {
        fs::remove(temporary, error);
        fail(
            "{}: the graph cannot be written here; check the folder, its rights and the free space",
            file.string());
    }
    fs::rename(temporary, target, error);
    if (error) {
        std::string reason = error.message();
        fs::remove(temporary, error);
        fail("{}: the graph cannot be written: {}", file.string(), reason);
    }
    graph_.file = file;
}

// --- edits
// -------------------------------------------------------------------------------------------
//
// Each edit changes a copy of the graph. The text is then patched where the two differ and read
// again; only when it says what the copy says does it become the document.

namespace {

void require_name(const std::string& name, std::string_view what) {
    if (!is_node_name(name))
        fail("'{}' is no {}: take 1 to 100 lower-case letters, digits, '_' and '-'", name, what);
}

void require_place(const std::string& id, glm::dvec2 at) {
    if (!std::isfinite(at.x) || !std::isfinite(at.y))
        fail("node '{}' cannot be drawn at ({}, {})", id, at.x, at.y);
}

void require_text(const std::string& text, std::string_view what) {
    if (find_invalid_utf8(text) != std::string::npos) fail("{} is not UTF-8", what);
}

void require_text(const ParamValue& value, std::string_view what) {
    if (auto* text = std::get_if<std::string>(&value)) require_text(*text, what);
    if (auto* texts = std::get_if<std::vector<std::string>>(&value))
        for (const std::string& text : *texts) require_text(text, what);
}

void require_text(const GraphParam::Yaml& yaml) {
    require_text(yaml.text, "a text of the editor's own");
    for (const GraphParam::Yaml& item : yaml.items) require_text(item);
}

template <class T, class Name>
auto find_by(std::vector<T>& all, Name T::*name, const std::string& key) {
    return std::find_if(all.begin(), all.end(), [&](const T& one) { return one.*name == key; });
}

}  // namespace

GraphNode& Document::node_of(Graph& graph, const std::string& id) const {
    auto found = find_by(graph.nodes, &GraphNode::id, id);
    if (found != graph.nodes.end()) return *found;
    std::vector<std::string> ids;
    for (const GraphNode& node : graph.nodes) ids.push_back(node.id);
    fail("there is no node '{}'{}", id, did_you_mean(id, ids));
}

// An edit that says what is wanted becomes the document. Where it can, it is read at the nodes that it changes alone.
void Document::apply(const Graph& wanted) {
    if (same_content(graph_, wanted)) return;
    for (bool surgical : {true, false}) {
        auto edit = std::make_shared<GraphEdit>();
        std::size_t at = 0;
        bool all = true;
        for (TextPatch& patch : patches_between(text_, *tree_, graph_, wanted, surgical)) {
            if (all = patch.position >= at; !all) break;  // overlapping patches; the comparison below notices
            at = patch.position + patch.length;
            edit->splices.push_back({patch.position, text_.substr(patch.position, patch.length),
                                     std::move(patch.inserted)});
        }
        std::string text = spliced(text_, edit->splices);
        if (surgical && all && text.size() <= kMaximumGraphBytes)
            if (auto items = items_of_edit(text_, *tree_, graph_, wanted, edit->splices)) {
                edit->items = std::move(*items);
                go(*edit, false);
                return remember(std::move(edit));
            }
        Document next{Parsed()};
        next.text_ = std::move(text);
        next.graph_.file = graph_.file;
        try {
            next.read();
        } catch (const Error&) {
            continue;
        }
        if (!same_content(next.graph_, wanted)) continue;
        edit->before = std::make_shared<const ReadText>(ReadText{std::move(graph_), std::move(tree_)});
        edit->after = std::make_shared<const ReadText>(ReadText{next.graph_, next.tree_});
        text_ = std::move(next.text_);
        graph_ = std::move(next.graph_);
        tree_ = std::move(next.tree_);
        return remember(std::move(edit));
    }
    fail("the change cannot be written into this text; write the node as 'key: value' lines first");
}

void Document::add_node(const std::string& id, const std::string& type,
                        std::optional<glm::dvec2> at) {
    require_name(id, "id for a node");
    require_text(type, "the node type");
    if (type.empty()) fail("node '{}' needs a type", id);
    if (at) require_place(id, *at);
    if (graph_.find(id)) fail("there is a node '{}' already; take another id", id);
    Graph wanted = graph_;
    GraphNode& node = wanted.nodes.emplace_back();
    node.id = id;
    node.type = type;
    node.at = at;
    apply(wanted);
}

void Document::add_nodes(const std::vector<GraphNode>& nodes) {
    Graph wanted = graph_;
    for (const GraphNode& node : nodes) {
        require_name(node.id, "id for a node");
        if (wanted.find(node.id)) fail("there is a node '{}' already; take another id", node.id);
        wanted.nodes.push_back(node);
    }
    apply(wanted);
}

void Document::remove_node(const std::string& id) { remove_nodes({id}); }

void Document::remove_nodes(const std::vector<std::string>& ids) {
    Graph wanted = graph_;
    for (const std::string& id : ids) node_of(wanted, id);
    const std::set<std::string> gone(ids.begin(), ids.end());
    auto of_node = [&](const WireEnd& end) { return gone.count(end.node) > 0; };
    std::erase_if(wanted.nodes, [&](const GraphNode& node) { return gone.count(node.id) > 0; });
    std::erase_if(wanted.outputs, of_node);
    for (GraphNode& node : wanted.nodes)
        std::erase_if(node.inputs, [&](GraphInput& input) {
            return std::erase_if(input.from, of_node) > 0 && input.from.empty();
        });
    apply(wanted);
}

void Document::rename_node(const std::string& id, const std::string& to) {
    require_name(to, "id for a node");
    if (id != to && graph_.find(to)) fail("there is a node '{}' already; take another id", to);
    Graph wanted = graph_;
    node_of(wanted, id).id = to;
    auto follow = [&](std::vector<WireEnd>& ends) {
        for (WireEnd& end : ends)
            if (end.node == id) end.node = to;
    };
    follow(wanted.outputs);
    for (GraphNode& node : wanted.nodes)
        for (GraphInput& input : node.inputs) follow(input.from);
    apply(wanted);
}

void Document::set_param(const std::string& id, const std::string& key, const ParamValue& value) {
    require_name(key, "name of a parameter");
    require_text(value, "the value of parameter '" + key + "'");
    Graph wanted = graph_;
    GraphNode& node = node_of(wanted, id);
    auto found = find_by(node.params, &GraphParam::key, key);
    GraphParam& param = found != node.params.end() ? *found : node.params.emplace_back();
    param.key = key;
    param.yaml = yaml_of(value);
    apply(wanted);
}

void Document::reset_param(const std::string& id, const std::string& key) {
    Graph wanted = graph_;
    std::erase_if(node_of(wanted, id).params,
                  [&](const GraphParam& param) { return param.key == key; });
    apply(wanted);
}

void Document::connect(const std::string& from_node, const std::string& from_port,
                       const std::string& to_node, const std::string& to_port, bool append) {
    require_name(from_port, "name of a port");
    require_name(to_port, "name of a port");
    Graph wanted = graph_;
    node_of(wanted, from_node);
    GraphNode& node = node_of(wanted, to_node);
    auto found = find_by(node.inputs, &GraphInput::port, to_port);
    GraphInput& input = found != node.inputs.end() ? *found : node.inputs.emplace_back();
    input.port = to_port;
    if (!append) input.from.clear();
    input.from.push_back({from_node, from_port, {}});
    input.is_list = append && (input.is_list || input.from.size() > 1);
    apply(wanted);
}

void Document::disconnect(const std::string& to_node, const std::string& to_port) {
    Graph wanted = graph_;
    std::erase_if(node_of(wanted, to_node).inputs,
                  [&](const GraphInput& input) { return input.port == to_port; });
    apply(wanted);
}

void Document::set_use(const std::vector<std::string>& ids, GraphNode::Use use) {
    Graph wanted = graph_;
    for (const std::string& id : ids) node_of(wanted, id).use = use;
    apply(wanted);
}

void Document::move_node(const std::string& id, glm::dvec2 at) { move_nodes({{id, at}}); }

void Document::move_nodes(const std::vector<std::pair<std::string, glm::dvec2>>& places) {
    Graph wanted = graph_;
    for (const auto& [id, at] : places) {
        require_place(id, at);
        node_of(wanted, id).at = at;
    }
    apply(wanted);
}

void Document::set_outputs(const std::vector<std::pair<std::string, std::string>>& outputs) {
    Graph wanted = graph_;
    wanted.outputs.clear();
    for (const auto& [node, port] : outputs) {
        node_of(wanted, node);
        if (!port.empty()) require_name(port, "name of a port");
        wanted.outputs.push_back({node, port, {}});
    }
    apply(wanted);
}

void Document::set_editor(const std::string& key, const GraphParam::Yaml& value) {
    require_name(key, "key of the editor's own");
    require_text(value);
    Graph wanted = graph_;
    auto found = find_by(wanted.editor, &GraphParam::key, key);
    if (value.kind == GraphParam::Yaml::Kind::list && value.items.empty()) {
        if (found != wanted.editor.end()) wanted.editor.erase(found);
    } else {
        GraphParam& entry = found != wanted.editor.end() ? *found : wanted.editor.emplace_back();
        entry.key = key;
        entry.yaml = value;
    }
    apply(wanted);
}

// --- history
// -----------------------------------------------------------------------------------------

namespace {

// Whole graphs are kept for the newest edits, as many as take about so much memory; older ones are read again from
// their text. A graph and its tree take about so many times what the text does.
constexpr std::size_t kWholeBytes = std::size_t(64) << 20, kBytesPerByteOfText = 100, kLeastWhole = 8;

}  // namespace

YamlNode& Document::own_tree() {
    if (tree_.use_count() > 1) tree_ = std::make_shared<YamlNode>(*tree_);
    return *tree_;
}

void Document::remember(EditPtr edit) {
    if (edit->before) {
        whole_.push_back(edit);
        const std::size_t most = std::max(kLeastWhole, kWholeBytes / (kBytesPerByteOfText * (text_.size() + 1)));
        if (whole_.size() > 2 * most) {  // the older half at once, so that each is moved but once
            for (std::size_t i = 0; i < most; ++i)
                if (EditPtr old = whole_[i].lock()) old->before = old->after = nullptr;
            whole_.erase(whole_.begin(), whole_.begin() + std::ptrdiff_t(most));
        }
    }
    history_.resize(done_);
    if (!step_open_) {
        history_.emplace_back();
        ++done_;
        step_open_ = step_depth_ > 0;
    }
    history_.back().push_back(std::move(edit));
}

// To the other side of an edit.
void Document::go(const GraphEdit& edit, bool back) {
    text_ = spliced(text_, edit.splices, back);
    if (!edit.items.empty()) {
        follow(edit, back, own_tree(), graph_);
        assert(same_places(*tree_, Document::parse(text_).own_tree()) && "what was read in part is what the whole says");
    } else if (const auto& whole = back ? edit.before : edit.after) {
        std::filesystem::path file = std::move(graph_.file);
        graph_ = whole->graph;
        graph_.file = std::move(file);
        tree_ = whole->tree;
    } else {
        read();
    }
}

void Document::undo() {
    if (!can_undo()) return;
    step_open_ = false;
    const std::vector<EditPtr>& step = history_[--done_];
    for (auto edit = step.rbegin(); edit != step.rend(); ++edit) go(**edit, true);
}

void Document::redo() {
    if (!can_redo()) return;
    step_open_ = false;
    for (const EditPtr& edit : history_[done_++]) go(*edit, false);
}

Document::Step::Step(Document& document) : document_(document) {
    ++document_.step_depth_;
}

Document::Step::~Step() {
    if (--document_.step_depth_ == 0) document_.step_open_ = false;
}

}  // namespace voxloom
