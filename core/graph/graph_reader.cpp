// From the YAML tree to a Graph: structure only, nothing is known of node types here. Every problem
// is collected, so that one look at the messages mends the whole file.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "core/base/text.h"
#include "core/graph/graph_text.h"

namespace voxloom {

namespace {

using Kind = YamlNode::Kind;

std::string_view kind_name(const YamlNode& node) {
    switch (node.kind) {
        case Kind::null:
            return "nothing";
        case Kind::plain:
        case Kind::quoted:
            return "a single value";
        case Kind::sequence:
            return "a list";
        case Kind::map:
            return "a map";
    }
    return "";
}

class GraphReader {
  public:
    explicit GraphReader(std::vector<Problem>& problems) : problems_(problems) {}

    Graph read(const YamlNode& root) {
        if (root.kind != Kind::map) {
            problem(root,
                    root.kind == Kind::null
                        ? "the text is empty; a graph begins with 'voxloom: 1'"
                        : fmt::format("a graph is a map that begins with 'voxloom: 1', this is {}",
                                      kind_name(root)));
            return {};
        }
        // A file of another version may differ in everything else, so only that is said.
        if (!read_version(root)) return {};
        check_keys(root, kGraphKeys, "a graph");
        if (const YamlNode* outputs = root.find("outputs")) read_outputs(*outputs);
        if (const YamlNode* nodes = root.find("nodes")) read_nodes(*nodes);
        if (const YamlNode* editor = root.find("editor"))
            read_entries(*editor, "editor", "{ comments: [[a text, 0, 0]] }", graph_.editor);
        return std::move(graph_);
    }

    GraphNode read_one(const YamlNode& item) {
        read_node(item);
        return graph_.nodes.empty() ? GraphNode() : std::move(graph_.nodes.front());
    }

    bool read_value(const YamlNode& value, GraphParam::Yaml& yaml, const std::string& key) {
        yaml.mark = value.mark;
        switch (value.kind) {
            case Kind::null:
                problem(value,
                        fmt::format("parameter '{}' has no value; give it one or remove the key (a "
                                    "text '~' or 'null' needs quotes)",
                                    key),
                        key);
                return false;
            case Kind::map:
                problem(
                    value,
                    fmt::format("parameter '{}' is a map; a parameter is a value or a list", key),
                    key);
                return false;
            case Kind::plain:
                yaml.kind = GraphParam::Yaml::Kind::plain;
                break;
            case Kind::quoted:
                yaml.kind = GraphParam::Yaml::Kind::quoted;
                break;
            case Kind::sequence:
                yaml.kind = GraphParam::Yaml::Kind::list;
                break;
        }
        yaml.text = value.text;
        bool fine = true;
        yaml.items.resize(value.items.size());
        for (std::size_t i = 0; i < value.items.size(); ++i)
            fine = read_value(value.items[i], yaml.items[i], key) && fine;
        return fine;
    }

  private:
    static inline const std::vector<std::string> kGraphKeys{"voxloom", "outputs", "nodes", "editor"};

    void problem(const YamlNode& at, std::string message, std::string where = {}) {
        problems_.push_back({at.mark, id_, std::move(where), std::move(message)});
    }

    void check_keys(const YamlNode& map, const std::vector<std::string>& known,
                    std::string_view what) {
        for (const YamlNode& key : map.keys)
            if (std::find(known.begin(), known.end(), key.text) == known.end())
                problem(key, fmt::format("unknown key '{}'{}; {} has: {}", key.text,
                                         did_you_mean(key.text, known), what, join(known, ", ")));
    }

    bool read_version(const YamlNode& root) {
        const YamlNode* version = root.find("voxloom");
        if (!version) {
            // Perhaps misspelt; then that is the better message.
            std::size_t before = problems_.size();
            check_keys(root, kGraphKeys, "a graph");
            problem(
                root,
                "there is no 'voxloom: 1', which says that this is a graph and of which version");
            return before + 1 < problems_.size();  // go on where only this key is wrong
        }
        if (version->kind == Kind::plain && version->text == "1") return true;
        problem(*version,
                version->is_scalar()
                    ? fmt::format("'voxloom: {}' is a version that this program does not "
                                  "know, it reads 1; use a newer program, or write 'voxloom: 1'",
                                  version->text)
                    : fmt::format("'voxloom' is {}; write 'voxloom: 1'", kind_name(*version)));
        return false;
    }

    void read_outputs(const YamlNode& list) {
        if (list.kind != Kind::sequence) {
            problem(list, fmt::format("'outputs' is {}; it must be a list, such as [view.image]",
                                      kind_name(list)));
            return;
        }
        for (const YamlNode& item : list.items)
            if (auto end = read_wire_end(item)) graph_.outputs.push_back(std::move(*end));
    }

    void read_nodes(const YamlNode& list) {
        if (list.kind == Kind::null) return;
        if (list.kind != Kind::sequence) {
            problem(list,
                    fmt::format("'nodes' is {}; it must be a list, each item begins with '- id:'",
                                kind_name(list)));
            return;
        }
        graph_.nodes.reserve(list.items.size());
        std::unordered_map<std::string, int> line_of;
        for (const YamlNode& item : list.items) {
            id_.clear();
            read_node(item);
            id_.clear();
            if (graph_.nodes.size() == 0 || item.kind != Kind::map) continue;
            const YamlNode* id = item.find("id");
            if (!id || id->text.empty()) continue;
            auto [first, fresh] = line_of.emplace(id->text, id->mark.line);
            if (!fresh)
                problem(*id, fmt::format(
                                 "there are two nodes '{}', here and in line {}; give each an id "
                                 "of its own",
                                 id->text, first->second));
        }
    }

    void read_node(const YamlNode& map) {
        if (map.kind != Kind::map) {
            problem(map, fmt::format("a node must be a map with 'id' and 'type', this is {}",
                                     kind_name(map)));
            return;
        }
        GraphNode node;
        node.mark = map.mark;
        if (const YamlNode* id = map.find("id")) {
            node.mark = id->mark;
            if (id->is_scalar() && is_node_name(id->text))
                id_ = node.id = id->text;
            else
                problem(*id,
                        fmt::format("the id {} is not a name of at most 100 lower-case letters, "
                                    "digits, '_' and '-'",
                                    id->is_scalar() ? "'" + id->text + "'" : "is missing or"));
        } else {
            problem(map, "this node has no 'id'; give it a name");
        }
        check_keys(map, {"id", "type", "use", "in", "set", "at"}, "a node");
        if (const YamlNode* type = map.find("type");
            type && type->is_scalar() && !type->text.empty()) {
            node.type = type->text;
            node.type_mark = type->mark;
        } else {
            problem(type ? *type : map,
                    "this node has no 'type'; 'voxloom nodes' lists what there is");
        }
        if (const YamlNode* use = map.find("use")) read_use(*use, node);
        if (const YamlNode* in = map.find("in")) read_inputs(*in, node);
        if (const YamlNode* set = map.find("set"))
            read_entries(*set, "set", "{ size: [512, 512] }", node.params);
        if (const YamlNode* at = map.find("at")) read_at(*at, node);
        graph_.nodes.push_back(std::move(node));
    }

    void read_use(const YamlNode& value, GraphNode& node) {
        for (auto use : {GraphNode::Use::normal, GraphNode::Use::bypassed, GraphNode::Use::disabled}) {
            if (!value.is_scalar() || value.text != name_of(use)) continue;
            node.use = use;
            return;
        }
        problem(value, fmt::format("'use' is {}; write bypassed or disabled, or remove the key",
                                   value.is_scalar() ? "'" + value.text + "'" : std::string(kind_name(value))));
    }

    void read_inputs(const YamlNode& map, GraphNode& node) {
        if (map.kind == Kind::null) return;
        if (map.kind != Kind::map) {
            problem(map,
                    fmt::format("'in' is {}; it must be a map, such as {{ source: ct.volume }}",
                                kind_name(map)));
            return;
        }
        for (std::size_t i = 0; i < map.keys.size(); ++i) {
            GraphInput input;
            input.port = map.keys[i].text;
            input.mark = map.keys[i].mark;
            const YamlNode& value = map.items[i];
            input.is_list = value.kind == Kind::sequence;
            if (!input.is_list) {
                if (auto end = read_wire_end(value, input.port))
                    input.from.push_back(std::move(*end));
            } else {
                for (const YamlNode& item : value.items)
                    if (auto end = read_wire_end(item, input.port))
                        input.from.push_back(std::move(*end));
            }
            node.inputs.push_back(std::move(input));
        }
    }

    // "node.port". A node alone is let pass: the check knows its ports and can name them.
    std::optional<WireEnd> read_wire_end(const YamlNode& value, const std::string& port = {}) {
        std::string where = port.empty() ? "an output" : fmt::format("input '{}'", port);
        if (!value.is_scalar()) {
            problem(value, fmt::format("{} is {}; write node.port", where, kind_name(value)), port);
            return {};
        }
        std::size_t dot = value.text.find('.');
        WireEnd end{value.text.substr(0, dot),
                    dot == std::string::npos ? "" : value.text.substr(dot + 1), value.mark};
        if (!is_node_name(end.node) || (dot != std::string::npos && !is_node_name(end.port))) {
            problem(value, fmt::format("{} is '{}'; write node.port", where, value.text), port);
            return {};
        }
        return end;
    }

    void read_entries(const YamlNode& map, std::string_view name, std::string_view example,
                      std::vector<GraphParam>& entries) {
        if (map.kind == Kind::null) return;
        if (map.kind != Kind::map) {
            problem(map, fmt::format("'{}' is {}; it must be a map, such as {}", name,
                                     kind_name(map), example));
            return;
        }
        for (std::size_t i = 0; i < map.keys.size(); ++i) {
            GraphParam param;
            param.key = map.keys[i].text;
            param.mark = map.keys[i].mark;
            if (read_value(map.items[i], param.yaml, param.key))
                entries.push_back(std::move(param));
        }
    }

    void read_at(const YamlNode& list, GraphNode& node) {
        glm::dvec2 at(0.0);
        bool fine = list.kind == Kind::sequence && list.items.size() == 2;
        for (int i = 0; fine && i < 2; ++i) {
            const YamlNode& item = list.items[std::size_t(i)];
            fine =
                item.kind == Kind::plain && parse_number(item.text, at[i]) && std::isfinite(at[i]);
        }
        if (fine)
            node.at = at;
        else
            problem(list, "'at' must be two numbers, such as [640, 120]");
    }

    std::vector<Problem>& problems_;
    Graph graph_;
    std::string id_;  // of the node being read
};

// --- parameter values ----------------------------------------------------------------------------

using Yaml = GraphParam::Yaml;

std::string described(const Yaml& yaml) {
    switch (yaml.kind) {
        case Yaml::Kind::plain:
            return fmt::format("'{}'", yaml.text);
        case Yaml::Kind::quoted:
            return fmt::format("the text \"{}\"", yaml.text);
        case Yaml::Kind::list:
            return "a list";
    }
    return "";
}

bool parse_numbers(const Yaml& yaml, std::vector<double>& numbers, std::string& reason) {
    if (yaml.kind != Yaml::Kind::list) {
        reason = fmt::format("must be a list of numbers such as [1, 2], not {}", described(yaml));
        return false;
    }
    numbers.resize(yaml.items.size());
    for (std::size_t i = 0; i < numbers.size(); ++i)
        if (yaml.items[i].kind != Yaml::Kind::plain ||
            !parse_number(yaml.items[i].text, numbers[i])) {
            reason = fmt::format("must be a list of numbers, but item {} is {}", i + 1,
                                 described(yaml.items[i]));
            return false;
        }
    return true;
}

std::optional<ParamValue> convert(const ParamSpec& spec, const Yaml& yaml, std::string& reason) {
    switch (spec.kind) {
        case ParamKind::boolean:
            if (yaml.kind == Yaml::Kind::plain && (yaml.text == "true" || yaml.text == "false"))
                return yaml.text == "true";
            reason = fmt::format("must be true or false, not {}", described(yaml));
            return {};
        case ParamKind::integer:
        case ParamKind::real: {
            std::int64_t whole = 0;
            double number = 0;
            if (yaml.kind == Yaml::Kind::plain && parse_integer(yaml.text, whole)) return whole;
            if (yaml.kind == Yaml::Kind::plain && parse_number(yaml.text, number)) return number;
            reason = fmt::format("must be a {}number, not {}",
                                 spec.kind == ParamKind::integer ? "whole " : "", described(yaml));
            if (yaml.kind == Yaml::Kind::quoted && parse_number(yaml.text, number))
                reason += "; remove the quotes";
            return {};
        }
        case ParamKind::text:
        case ParamKind::choice:
        case ParamKind::path_in:
        case ParamKind::path_out:
            if (yaml.kind != Yaml::Kind::list) return yaml.text;
            reason = "must be a text, not a list";
            return {};
        case ParamKind::vector:
        case ParamKind::color:
        case ParamKind::list: {
            std::vector<double> numbers;
            if (!parse_numbers(yaml, numbers, reason)) return {};
            return numbers;
        }
        case ParamKind::rows: {
            if (yaml.kind != Yaml::Kind::list) {
                reason = fmt::format(
                    "must be a list of lists of numbers such as [[0, 1], [2, 3]], not {}",
                    described(yaml));
                return {};
            }
            Rows rows(yaml.items.size());
            for (std::size_t i = 0; i < rows.size(); ++i)
                if (!parse_numbers(yaml.items[i], rows[i], reason)) {
                    reason = fmt::format("row {} {}", i + 1, reason);
                    return {};
                }
            return rows;
        }
        case ParamKind::texts: {
            std::vector<std::string> texts;
            for (const Yaml& item : yaml.items) {
                if (item.kind == Yaml::Kind::list) {
                    reason = "must be a list of texts, not a list of lists";
                    return {};
                }
                texts.push_back(item.text);
            }
            if (yaml.kind == Yaml::Kind::list) return texts;
            reason = fmt::format("must be a list of texts such as [a, b], not {}", described(yaml));
            return {};
        }
    }
    return {};
}

}  // namespace

bool is_node_name(std::string_view name) {
    return !name.empty() && name.size() <= 100 &&
           name.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_-") ==
               std::string_view::npos;
}

Graph read_graph(const YamlNode& root, std::vector<Problem>& problems) {
    return GraphReader(problems).read(root);
}

GraphNode read_graph_node(const YamlNode& item, std::vector<Problem>& problems) {
    return GraphReader(problems).read_one(item);
}

bool parse_yaml_value(const std::string& text, GraphParam::Yaml& yaml) {
    std::vector<Problem> problems;
    YamlNode root = parse_yaml(text, problems);
    return problems.empty() && GraphReader(problems).read_value(root, yaml, {});
}

std::optional<ParamValue> parse_param(const ParamSpec& spec, const GraphParam::Yaml& yaml,
                                      std::string& reason) {
    std::optional<ParamValue> value = convert(spec, yaml, reason);
    if (!value) return {};
    reason = problem_with(spec, *value);
    if (!reason.empty()) return {};
    return value;
}

}  // namespace voxloom
