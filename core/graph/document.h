// A graph as a YAML text. The text is the model: it keeps its comments and its order, edits patch
// it at the places that changed, and every message can name line and column.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/graph/params.h"

namespace voxloom {

struct Mark {
    int line = 0, column = 0;  // from 1; 0: not from a text
};

// A problem with a graph: where, and one sentence with the mend.
struct Problem {
    Mark mark;
    std::string node;     // id, empty for the document
    std::string where;    // port or parameter, empty for the node
    std::string message;
    // "graph.yaml:14:7: node 'enc': message"
    std::string text(const std::filesystem::path& file) const;
};

struct YamlNode;   // core/graph/yaml_tree.h
struct GraphEdit;  // core/graph/graph_edit.h

// --- what the text says, before anything is known of node types -------------------------------

struct WireEnd {
    std::string node, port;
    Mark mark;
};
struct GraphParam {
    std::string key;
    // As YAML: a plain scalar keeps its text ("12"), since only the node's description says what
    // it is. Lists keep their nesting. Quoted scalars are never numbers.
    struct Yaml {
        enum class Kind { plain, quoted, list } kind = Kind::plain;
        std::string text;
        std::vector<Yaml> items;
        Mark mark;
    } yaml;
    Mark mark;
};
struct GraphInput {
    std::string port;
    std::vector<WireEnd> from;  // one, or several where the port takes many ([a.volume, b.volume])
    bool is_list = false;
    Mark mark;
};
struct GraphNode {
    std::string id, type;
    std::vector<GraphInput> inputs;
    std::vector<GraphParam> params;
    // As `use: bypassed` or `use: disabled`; what that means is said in check.h.
    enum class Use { normal, bypassed, disabled } use = Use::normal;
    std::optional<glm::dvec2> at;  // where the editor draws it
    Mark mark, type_mark;
};
std::string_view name_of(GraphNode::Use use);  // "normal", "bypassed", "disabled"

struct Graph {
    std::filesystem::path file;    // for messages; its folder is the base of relative paths
    std::vector<GraphNode> nodes;
    std::vector<WireEnd> outputs;  // port may be empty: the node itself (a writer)
    std::vector<GraphParam> editor;  // what an editor keeps for itself; it means nothing to a run
    const GraphNode* find(std::string_view id) const;  // linear; check() builds an index

    std::filesystem::path folder() const;
};

// Whether both say the same, wherever it stands in their texts.
bool same_content(const Graph& a, const Graph& b);

// Converts what the text says to a value for the parameter, or gives the reason why not.
std::optional<ParamValue> parse_param(const ParamSpec& spec, const GraphParam::Yaml& yaml,
                                      std::string& reason);

// --- the document -------------------------------------------------------------------------------

class Document {
  public:
    // A new, empty graph.
    Document();
    // Parses; throws Error with every problem of syntax and structure, one a line
    // ("file:line:column: ..."): unknown and duplicate keys, missing ids, two nodes with one id.
    static Document parse(std::string text, std::filesystem::path file = {});
    static Document load(const std::filesystem::path& file);
    // Written to a temporary name, then renamed.
    void save(const std::filesystem::path& file);

    const std::string& text() const { return text_; }
    const Graph& graph() const { return graph_; }

    // Edits. Each throws Error, leaving the document as it was, when it does not apply (unknown
    // node, id taken). Each is one step of undo; a Step scope makes one step of several. What is so
    // already (a parameter that has the value, a port that has no wire) is no step at all.
    void add_node(const std::string& id, const std::string& type,
                  std::optional<glm::dvec2> at = std::nullopt);
    // Nodes as they are, with parameters and wires; their ids must be free (what is pasted).
    void add_nodes(const std::vector<GraphNode>& nodes);
    void remove_node(const std::string& id);                       // with its wires and outputs
    void remove_nodes(const std::vector<std::string>& ids);
    void rename_node(const std::string& id, const std::string& to);  // wires and outputs follow
    void set_param(const std::string& id, const std::string& key, const ParamValue& value);
    void reset_param(const std::string& id, const std::string& key);
    // Replaces what was wired to the port; `append` adds a wire to a port that takes many.
    void connect(const std::string& from_node, const std::string& from_port,
                 const std::string& to_node, const std::string& to_port, bool append = false);
    void disconnect(const std::string& to_node, const std::string& to_port);
    void set_use(const std::vector<std::string>& ids, GraphNode::Use use);
    void move_node(const std::string& id, glm::dvec2 at);
    void move_nodes(const std::vector<std::pair<std::string, glm::dvec2>>& places);
    // Of node and port (empty: the node itself); an empty list removes the key.
    void set_outputs(const std::vector<std::pair<std::string, std::string>>& outputs);
    // One key of Graph::editor; an empty list removes it.
    void set_editor(const std::string& key, const GraphParam::Yaml& value);

    bool can_undo() const { return done_ > 0; }
    bool can_redo() const { return done_ < history_.size(); }
    void undo();
    void redo();

    class Step {
      public:
        explicit Step(Document& document);
        ~Step();
        Step(const Step&) = delete;
        Step& operator=(const Step&) = delete;

      private:
        Document& document_;
    };

  private:
    using EditPtr = std::shared_ptr<GraphEdit>;
    struct Parsed {};
    explicit Document(Parsed) {}

    void read();
    void apply(const Graph& wanted);
    void remember(EditPtr edit);
    void go(const GraphEdit& edit, bool back);
    YamlNode& own_tree();
    GraphNode& node_of(Graph& graph, const std::string& id) const;

    std::string text_;
    Graph graph_;
    std::shared_ptr<YamlNode> tree_;  // of text_; copies share it until they change it
    std::vector<std::vector<EditPtr>> history_;  // undone steps stand behind done_
    std::vector<std::weak_ptr<GraphEdit>> whole_;  // edits that keep whole graphs, oldest first
    std::size_t done_ = 0;
    int step_depth_ = 0;
    bool step_open_ = false;  // the last step of the history takes further edits
};

}  // namespace voxloom
