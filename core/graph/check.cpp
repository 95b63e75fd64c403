// The check pass, in five steps over one plan: what each node says of itself (type, parameters),
// the wires, the order (and cycles), the descriptions along that order, and what is asked for.
// Nothing stops at the first problem; a node with a problem only silences what depends on it.
#include "core/graph/check.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <queue>
#include <unordered_map>

#include "core/base/text.h"
#include "core/graph/graph_text.h"

namespace voxloom {

namespace fs = std::filesystem;

int Plan::find(std::string_view id) const {
    auto it = index.find(id);
    return it == index.end() ? -1 : it->second;
}

namespace {

template <class Spec>
std::vector<std::string> keys_of(const std::vector<Spec>& specs) {
    std::vector<std::string> keys;
    for (const Spec& spec : specs) keys.push_back(spec.key);
    return keys;
}

// "; did you mean 'x'?" or, where nothing is near, what there is.
std::string suggestion(std::string_view wrong, const std::vector<std::string>& known) {
    std::string near = did_you_mean(wrong, known);
    if (!near.empty()) return near;
    if (known.empty()) return "; it has none";
    constexpr std::size_t most = 24;
    if (known.size() <= most) return "; it has: " + join(known, ", ");
    return fmt::format("; it has: {} and {} more", join(std::span(known).first(most), ", "),
                       known.size() - most);
}

// "parameter 'x' must be ...", "parameter 'x': 'red' is not one of ..."
std::string about_parameter(std::string_view key, std::string_view reason) {
    return fmt::format("parameter '{}'{} {}", key, reason.starts_with('\'') ? ":" : "", reason);
}

// Suggestions among the ids of a whole graph or registry: the comparisons are limited, so that a
// file with ten thousand wrong names does not take a hundred million of them.
class LimitedSuggestions {
  public:
    explicit LimitedSuggestions(std::vector<std::string> known) : known_(std::move(known)) {}
    const std::string& operator()(const std::string& wrong) {
        auto [it, fresh] = memo_.try_emplace(wrong);
        if (fresh && spent_ < 200'000) {
            spent_ += known_.size();
            it->second = did_you_mean(wrong, known_);
        }
        return it->second;
    }

  private:
    std::vector<std::string> known_;
    std::unordered_map<std::string, std::string> memo_;
    std::size_t spent_ = 0;
};

// What a describe function sees of its node.
class NodeDescription final : public Description {
  public:
    NodeDescription(Plan& plan, Plan::Node& node, std::vector<Problem>& problems,
                    const GraphNode& source)
        : node_(node), problems_(problems), source_(source), inputs_(node.inputs.size()) {
        for (std::size_t i = 0; i < inputs_.size(); ++i)
            for (const Plan::Source& from : node.inputs[i])
                inputs_[i].push_back(
                    plan.nodes[std::size_t(from.node)].outputs[std::size_t(from.output)]);
    }

    const Params& params() const override { return node_.params; }
    const ValueDesc* input(std::string_view port) const override {
        const auto& all = inputs(port);
        return all.empty() ? nullptr : &all.front();
    }
    const std::vector<ValueDesc>& inputs(std::string_view port) const override {
        return inputs_[index_of(node_.type->inputs, port)];
    }
    void output(std::string_view port, ValueDesc desc) override {
        std::size_t i = index_of(node_.type->outputs, port);
        if (!node_.type->outputs[i].types.has(desc.type))
            fail("the node type describes its output '{}' as {}, but declares {}; mend the plugin",
                 port, name_of(desc.type), node_.type->outputs[i].types.text());
        node_.outputs[i] = std::move(desc);
    }
    void problem(std::string message, std::string_view where) override {
        Mark mark = node_.mark;
        for (const GraphParam& param : source_.params)
            if (param.key == where) mark = param.yaml.mark;
        for (const GraphInput& input : source_.inputs)
            if (input.port == where) mark = input.mark;
        problems_.push_back({mark, node_.id, std::string(where), std::move(message)});
        failed = true;
    }
    void working_memory(std::uint64_t bytes) override { node_.working_bytes = bytes; }

    bool failed = false;

  private:
    std::size_t index_of(const std::vector<PortSpec>& ports, std::string_view key) const {
        for (std::size_t i = 0; i < ports.size(); ++i)
            if (ports[i].key == key) return i;
        fail("the node type asks for a port '{}' that it does not declare; mend the plugin", key);
    }

    Plan::Node& node_;
    std::vector<Problem>& problems_;
    const GraphNode& source_;
    std::vector<std::vector<ValueDesc>> inputs_;
};

class Checker {
    using Use = GraphNode::Use;

  public:
    Checker(const Graph& graph, const Registry& registry, const CheckOptions& options)
        : graph_(graph),
          registry_(registry),
          options_(options),
          near_type_(registry.ids()),
          near_node_(ids_of(graph)) {}

    Plan run() {
        plan_.file = graph_.file;
        plan_.folder = graph_.folder();
        if (graph_.nodes.empty())
            problem({1, 1}, {}, {}, "there is nothing to run: the graph has no nodes");
        read_nodes();
        apply_overrides();
        read_wires();
        sort_and_find_cycles();
        describe_nodes();
        find_wanted();
        estimate_memory();
        std::stable_sort(plan_.problems.begin(), plan_.problems.end(),
                         [](const Problem& a, const Problem& b) {
                             return std::pair(a.mark.line, a.mark.column) <
                                    std::pair(b.mark.line, b.mark.column);
                         });
        return std::move(plan_);
    }

  private:
    static std::vector<std::string> ids_of(const Graph& graph) {
        std::vector<std::string> ids;
        ids.reserve(graph.nodes.size());
        for (const GraphNode& node : graph.nodes) ids.push_back(node.id);
        return ids;
    }

    void problem(Mark mark, std::string_view node, std::string_view where, std::string message) {
        plan_.problems.push_back({mark, std::string(node), std::string(where), std::move(message)});
    }

    // A problem of node i, which is then not ok.
    void node_problem(int i, Mark mark, std::string_view where, std::string message) {
        node(i).ok = false;
        problem(mark, node(i).id, where, std::move(message));
    }

    Plan::Node& node(int i) { return plan_.nodes[std::size_t(i)]; }
    const GraphNode& text_of(int i) const {
        return graph_.nodes[std::size_t(order_.empty() ? i : order_[std::size_t(i)])];
    }
    int count() const { return int(plan_.nodes.size()); }

    // --- 1: types and parameters. Until they are sorted, nodes stand in the order of the text. ---

    void read_nodes() {
        plan_.nodes.resize(graph_.nodes.size());
        index_.reserve(graph_.nodes.size());
        for (int i = 0; i < count(); ++i) {
            const GraphNode& text = text_of(i);
            Plan::Node& n = node(i);
            n.id = text.id;
            n.mark = text.mark;
            n.ok = true;
            n.use = text.use;
            index_.emplace(text.id, i);
            n.type = registry_.find(text.type);
            if (n.use != Use::normal) {
                n.ok = false;
                n.off = fmt::format("it is {}", name_of(n.use));
            }
            if (!n.type && n.use != Use::disabled) {
                node_problem(
                    i, text.type_mark, {},
                    fmt::format("unknown node type '{}'{}{}", text.type, near_type_(text.type),
                                near_type_(text.type).empty()
                                    ? "; 'voxloom nodes' lists what there is"
                                    : ""));
                n.off.clear();
            }
            if (!n.type) continue;
            n.params = Params(n.type->params, plan_.folder);
            n.inputs.resize(n.type->inputs.size());
            for (const PortSpec& port : n.type->outputs) n.outputs.emplace_back(type_of(port));
            if (n.use != Use::normal) continue;
            for (const GraphParam& param : text.params) set_param(i, param);
        }
    }

    static PortType type_of(const PortSpec& output) {
        for (int t = 0; t < kPortTypes; ++t)
            if (output.types.has(PortType(t))) return PortType(t);
        return PortType::volume;  // the registry refuses outputs without a type
    }

    void set_param(int i, const GraphParam& param) {
        const NodeType& type = *node(i).type;
        const ParamSpec* spec = type.find_param(param.key);
        if (!spec) {
            node_problem(i, param.mark, param.key,
                         fmt::format("{} has no parameter '{}'{}", type.id, param.key,
                                     suggestion(param.key, keys_of(type.params))));
            return;
        }
        std::string reason;
        if (auto value = parse_param(*spec, param.yaml, reason))
            node(i).params.set(spec->key, std::move(*value));
        else
            node_problem(i, param.yaml.mark, param.key, about_parameter(param.key, reason));
    }

    // --- overrides of the command line
    // ---------------------------------------------------------------

    void apply_overrides() {
        for (const std::string& text : options_.overrides) apply_override(text);
    }

    void apply_override(const std::string& text) {
        auto refuse = [&](int i, std::string_view where, const std::string& reason) {
            if (i >= 0) node(i).ok = false;
            problem({}, i >= 0 ? node(i).id : "", where, fmt::format("--set {}: {}", text, reason));
        };
        std::size_t equals = text.find('=');
        std::size_t dot = text.find('.');
        if (equals == std::string::npos || dot == std::string::npos || dot > equals)
            return refuse(-1, {}, "write NODE.PARAM=VALUE");
        std::string id = text.substr(0, dot), key = text.substr(dot + 1, equals - dot - 1);
        auto found = index_.find(id);
        if (found == index_.end())
            return refuse(-1, {}, fmt::format("there is no node '{}'{}", id, near_node_(id)));
        int i = found->second;
        if (!node(i).type) return;  // said already
        const NodeType& type = *node(i).type;
        const ParamSpec* spec = type.find_param(key);
        if (!spec)
            return refuse(i, key,
                          fmt::format("node '{}' ({}) has no parameter '{}'{}", id, type.id, key,
                                      suggestion(key, keys_of(type.params))));
        std::string reason;
        auto value = parse_override(*spec, text.substr(equals + 1), reason);
        if (!value) return refuse(i, key, about_parameter(key, reason));
        if (auto* path = std::get_if<std::string>(&*value);
            spec->kind == ParamKind::path_in && path && !path->empty())
            *path = fs::absolute(options_.overrides_base / *path).lexically_normal().string();
        node(i).params.set(spec->key, std::move(*value));
    }

    // Texts are taken as they are, a shell's user would not think of YAML's quotes; everything else
    // is a YAML value.
    static std::optional<ParamValue> parse_override(const ParamSpec& spec, const std::string& text,
                                                    std::string& reason) {
        GraphParam::Yaml yaml;
        switch (spec.kind) {
            case ParamKind::boolean:
            case ParamKind::integer:
            case ParamKind::real:
            case ParamKind::choice:
            case ParamKind::text:
            case ParamKind::path_in:
            case ParamKind::path_out:
                yaml.text = text;
                break;
            case ParamKind::vector:
            case ParamKind::color:
            case ParamKind::list:
            case ParamKind::rows:
            case ParamKind::texts:
                if (!parse_yaml_value(text, yaml)) {
                    reason = fmt::format("must be a list such as [1, 2], not '{}'", text);
                    return {};
                }
        }
        return parse_param(spec, yaml, reason);
    }

    // --- 2: wires
    // ------------------------------------------------------------------------------------

    void read_wires() {
        sources_.resize(graph_.nodes.size());
        for (int i = 0; i < count(); ++i) {
            if (node(i).use == Use::disabled) continue;
            for (const GraphInput& input : text_of(i).inputs) read_input(i, input);
            if (!node(i).type || node(i).use != Use::normal) continue;
            for (const PortSpec& port : node(i).type->inputs)
                if (!port.optional && !is_mentioned(i, port.key))
                    node_problem(i, node(i).mark, port.key,
                                 fmt::format("input '{}' is not wired; it needs a {}{}", port.key,
                                             port.types.text(), example_for(i, port.types)));
        }
    }

    bool is_mentioned(int i, std::string_view port) const {
        for (const GraphInput& input : text_of(i).inputs)
            if (input.port == port) return true;
        return false;
    }

    void read_input(int i, const GraphInput& input) {
        const NodeType* type = node(i).type;
        const PortSpec* port = type ? type->find_input(input.port) : nullptr;
        if (type && !port)
            node_problem(i, input.mark, input.port,
                         fmt::format("{} has no input '{}'{}", type->id, input.port,
                                     suggestion(input.port, keys_of(type->inputs))));
        if (port && input.is_list && !port->many && input.from.size() != 1)
            node_problem(
                i, input.mark, input.port,
                fmt::format("input '{}' takes one wire, not {}", input.port, input.from.size()));
        if (port && port->many && !port->optional && input.from.empty())
            node_problem(i, input.mark, input.port,
                         fmt::format("input '{}' has no wire; it needs at least one {}", input.port,
                                     port->types.text()));
        for (const WireEnd& end : input.from) {
            std::optional<Plan::Source> source = find_source(i, end, input.port);
            if (!source || !port || node(i).use != Use::normal) continue;
            if (node(source->node).use == Use::bypassed) {
                source = passed(*source, port->types, fmt::format("'{}'", node(i).id));
                node(i).ok = node(i).ok && source;
                if (!source) continue;
                sources_[std::size_t(i)].push_back(source->node);
            }
            // What an unknown node gives is not known; it is disabled, or there would be no source.
            if (source->output >= 0 && !accepts(i, *port, *source, end)) continue;
            node(i).inputs[std::size_t(port - type->inputs.data())].push_back(*source);
        }
    }

    // Where a bypassed node's output comes from, through all the bypassed nodes there are. Nothing
    // where there is nothing to pass on, which is a problem where somebody (`consumer`) asks for it.
    std::optional<Plan::Source> passed(Plan::Source source, PortTypes accepted,
                                       const std::string& consumer) {
        for (int steps = 0; node(source.node).use == Use::bypassed; ++steps) {
            const int i = source.node;
            const NodeType* type = node(i).type;
            if (!type || source.output < 0 || node(i).off.empty()) return {};  // said already
            const PortSpec& output = type->outputs[std::size_t(source.output)];
            std::optional<Plan::Source> next;
            if (steps < count()) next = first_input(i, output.types);
            if (!next && steps < count()) next = first_input(i, accepted);
            if (!next) {
                if (consumer.empty()) return {};
                node_problem(i, node(i).mark, output.key,
                             fmt::format("it cannot be bypassed: nothing that is wired to it could stand "
                                         "for its output '{}' ({}), asked for by {}; disable it instead",
                                         output.key, output.types.text(), consumer));
                node(i).off.clear();
                return {};
            }
            source = *next;
        }
        return source;
    }

    // What is wired to a node's first input that gets one of these types, as far as that is right.
    std::optional<Plan::Source> first_input(int i, PortTypes types) {
        for (const PortSpec& port : node(i).type->inputs)
            for (const GraphInput& input : text_of(i).inputs) {
                if (input.port != port.key || input.from.empty()) continue;
                auto found = index_.find(input.from.front().node);
                const NodeType* from = found == index_.end() ? nullptr : node(found->second).type;
                const PortSpec* output = from ? from->find_output(input.from.front().port) : nullptr;
                if (output && types.has(type_of(*output)))
                    return Plan::Source{found->second, int(output - from->outputs.data())};
            }
        return {};
    }

    // Which output a wire or the graph's outputs name; consumer is -1 for the latter. The output is
    // -1 for a node without a port, nothing is returned where the end is wrong or not known.
    std::optional<Plan::Source> find_source(int consumer, const WireEnd& end,
                                            std::string_view where) {
        auto report = [&](std::string message) {
            if (consumer >= 0)
                node_problem(consumer, end.mark, where, std::move(message));
            else
                problem(end.mark, {}, where, std::move(message));
        };
        auto found = index_.find(end.node);
        if (found == index_.end()) {
            report(fmt::format("there is no node '{}'{}", end.node, near_node_(end.node)));
            return {};
        }
        int i = found->second;
        // Even where the port is wrong: for the order. What does not run waits for nothing.
        if (consumer >= 0 && node(consumer).use == Use::normal)
            sources_[std::size_t(consumer)].push_back(i);
        const NodeType* type = node(i).type;
        if (!type && node(i).use == Use::disabled) return Plan::Source{i, -1};
        if (!type) return {};
        if (end.port.empty()) {
            bool writer = type->writes_files || type->outputs.empty();
            if (consumer < 0 && writer) return Plan::Source{i, -1};
            report(type->outputs.empty()
                       ? fmt::format("node '{}' ({}) has no outputs", end.node, type->id)
                       : fmt::format("'{}' names no output; write {}", end.node,
                                     output_choices(end.node, *type)));
            return {};
        }
        for (std::size_t o = 0; o < type->outputs.size(); ++o)
            if (type->outputs[o].key == end.port) return Plan::Source{i, int(o)};
        report(fmt::format("node '{}' ({}) has no output '{}'{}", end.node, type->id, end.port,
                           suggestion(end.port, keys_of(type->outputs))));
        return {};
    }

    static std::string output_choices(const std::string& id, const NodeType& type) {
        std::vector<std::string> choices;
        for (const PortSpec& port : type.outputs) choices.push_back(id + "." + port.key);
        return join(choices, " or ");
    }

    bool accepts(int i, const PortSpec& port, Plan::Source source, const WireEnd& end) {
        const NodeType& from = *node(source.node).type;
        const PortSpec& output = from.outputs[std::size_t(source.output)];
        PortType type = type_of(output);
        if (port.types.has(type)) return true;
        std::vector<std::string> fitting, others;
        for (const PortSpec& o : from.outputs)
            if (port.types.has(type_of(o))) fitting.push_back(end.node + "." + o.key);
        for (const PortSpec& p : node(i).type->inputs)
            if (p.types.has(type)) others.push_back("'" + p.key + "'");
        std::string mend = !fitting.empty()  ? "; " + join(fitting, " or ") + " would fit"
                           : !others.empty() ? "; it fits input " + join(others, " or ")
                                             : example_for(i, port.types);
        node_problem(i, end.mark, port.key,
                     fmt::format("input '{}' takes {}, but {}.{} is {}{}", port.key,
                                 port.types.text(), end.node, end.port, name_of(type), mend));
        return false;
    }

    // An output of the graph that would fit, else node types that have one. Only nodes without
    // inputs are offered, so that following the advice never makes a cycle.
    std::string example_for(int consumer, PortTypes types) {
        for (int i = 0; i < std::min(count(), 100); ++i) {
            const NodeType* type = node(i).type;
            if (i == consumer || !type || !text_of(i).inputs.empty()) continue;
            for (const PortSpec& port : type->outputs)
                if (types.has(type_of(port)))
                    return fmt::format("; {}.{} would fit", node(i).id, port.key);
        }
        if (examples_.empty()) {
            examples_.resize(kPortTypes);
            for (const NodeType* type : registry_.all())
                for (const PortSpec& port : type->outputs)
                    examples_[std::size_t(type_of(port))].push_back(type->id);
        }
        for (int t = 0; t < kPortTypes; ++t)
            if (types.has(PortType(t)) && !examples_[std::size_t(t)].empty())
                return fmt::format("; add for example a node of type {}",
                                   examples_[std::size_t(t)].front());
        return {};
    }

    // --- 3: order
    // ------------------------------------------------------------------------------------

    // Tarjan's strongly connected components, without recursion. Components come out sources first,
    // which is the order of evaluation; one of several nodes, or of a node that feeds itself, is a
    // cycle.
    void sort_and_find_cycles() {
        std::size_t n_nodes = graph_.nodes.size();
        std::vector<int> order, component, number(n_nodes, -1), low(n_nodes);
        std::vector<bool> open(n_nodes);
        struct Visit {
            int node;
            std::size_t next;
        };
        std::vector<Visit> path;
        int visited = 0;
        for (int root = 0; root < count(); ++root) {
            if (number[std::size_t(root)] >= 0) continue;
            path.push_back({root, 0});
            while (!path.empty()) {
                int n = path.back().node;
                auto at = std::size_t(n);
                if (path.back().next == 0 && number[at] < 0) {
                    number[at] = low[at] = visited++;
                    component.push_back(n);
                    open[at] = true;
                }
                if (path.back().next < sources_[at].size()) {
                    int from = sources_[at][path.back().next++];
                    if (number[std::size_t(from)] < 0)
                        path.push_back({from, 0});
                    else if (open[std::size_t(from)])
                        low[at] = std::min(low[at], number[std::size_t(from)]);
                    continue;
                }
                path.pop_back();
                if (!path.empty()) {
                    int& above = low[std::size_t(path.back().node)];
                    above = std::min(above, low[at]);
                }
                if (low[at] != number[at]) continue;
                std::vector<int> members;
                do {
                    members.push_back(component.back());
                    component.pop_back();
                    open[std::size_t(members.back())] = false;
                } while (members.back() != n);
                bool feeds_itself =
                    std::find(sources_[at].begin(), sources_[at].end(), n) != sources_[at].end();
                if (members.size() > 1 || feeds_itself) report_cycle(members);
                order.insert(order.end(), members.rbegin(), members.rend());
            }
        }
        reorder(order);
    }

    // The shortest cycle through the component's first node, along the wires.
    void report_cycle(std::vector<int> members) {
        std::sort(members.begin(), members.end());
        int first = members.front();
        std::unordered_map<int, int> consumer;  // on the shortest way from a node to `first`
        for (int m : members) {
            consumer[m] = -1;
            node(m).ok = false;
        }
        std::queue<int> front;
        front.push(first);
        std::vector<std::string> cycle{node(first).id};
        while (!front.empty() && cycle.size() == 1) {
            int n = front.front();
            front.pop();
            for (int from : sources_[std::size_t(n)]) {
                auto it = consumer.find(from);
                if (it == consumer.end()) continue;
                if (from == first) {
                    for (int on = n; on != first; on = consumer[on]) cycle.push_back(node(on).id);
                    cycle.push_back(node(first).id);
                    break;
                }
                if (it->second >= 0) continue;
                it->second = n;
                front.push(from);
            }
        }
        constexpr std::size_t most = 10;
        if (cycle.size() > most + 1) {
            std::string left_out = fmt::format("... {} more ...", cycle.size() - most);
            cycle.erase(cycle.begin() + most / 2, cycle.end() - most / 2);
            cycle.insert(cycle.begin() + most / 2, left_out);
        }
        problem(
            node(first).mark, node(first).id, {},
            fmt::format("the wires run in a cycle: {}; remove one of them", join(cycle, " -> ")));
    }

    // From the text's order to the order of evaluation.
    void reorder(const std::vector<int>& order) {
        std::vector<int> position(order.size());
        for (std::size_t k = 0; k < order.size(); ++k) position[std::size_t(order[k])] = int(k);
        std::vector<Plan::Node> sorted;
        sorted.reserve(order.size());
        for (int i : order) {
            Plan::Node& n = node(i);
            for (auto& port : n.inputs)
                for (Plan::Source& source : port) source.node = position[std::size_t(source.node)];
            plan_.index.emplace(n.id, int(sorted.size()));
            sorted.push_back(std::move(n));
        }
        plan_.nodes = std::move(sorted);
        for (auto& [id, i] : index_) i = position[std::size_t(i)];
        std::vector<std::vector<int>> sources(order.size());
        for (std::size_t k = 0; k < order.size(); ++k) {
            sources[k] = std::move(sources_[std::size_t(order[k])]);
            for (int& from : sources[k]) from = position[std::size_t(from)];
        }
        sources_ = std::move(sources);
        order_ = order;
    }

    // --- 4: descriptions
    // -------------------------------------------------------------------------------

    void describe_nodes() {
        for (int i = 0; i < count(); ++i) {
            Plan::Node& n = node(i);
            take_off(i);
            for (int from : sources_[std::size_t(i)])
                n.ok = n.ok && (node(from).ok || !node(from).off.empty());
            if (!n.ok || !n.type->describe) continue;
            const GraphNode& text = text_of(i);
            NodeDescription description(plan_, n, plan_.problems, text);
            try {
                n.type->describe(description);
            } catch (const Error& e) {
                description.problem(e.what(), {});
            } catch (const std::exception& e) {
                description.problem(
                    fmt::format("{} cannot describe its result: {}", n.type->id, e.what()), {});
            }
            n.ok = !description.failed;
        }
    }

    // Takes wires from what is off away; where that cannot be, the node is off, too.
    void take_off(int i) {
        Plan::Node& n = node(i);
        for (std::size_t k = 0; k < n.inputs.size() && n.use == Use::normal; ++k) {
            auto is_off = [&](const Plan::Source& source) { return !node(source.node).off.empty(); };
            auto off = std::find_if(n.inputs[k].begin(), n.inputs[k].end(), is_off);
            if (off == n.inputs[k].end()) continue;
            const Plan::Node& source = node(off->node);
            const PortSpec& port = n.type->inputs[k];
            const std::string why = source.use == Use::normal
                                        ? source.off
                                        : fmt::format("it needs '{}', which is disabled", source.id);
            std::erase_if(n.inputs[k], is_off);
            if (port.optional || (port.many && !n.inputs[k].empty())) {
                plan_.warnings.push_back(fmt::format("node '{}' runs without '{}' at its input '{}', "
                                                     "which is off: {}",
                                                     n.id, source.id, port.key, source.off));
            } else {
                n.off = why;
                n.ok = false;
            }
        }
    }

    // --- 5: what is asked for
    // --------------------------------------------------------------------------

    void find_wanted() {
        for (const WireEnd& end : graph_.outputs)
            if (auto source = find_source(-1, end, {})) want(*source, "the graph's outputs");
        if (graph_.outputs.empty()) want_what_nobody_takes();
        if (plan_.wanted.empty() && left_out_ && plan_.problems.empty())
            problem({1, 1}, {}, {},
                    "there is nothing to run: what is asked for is disabled, or needs what is");
    }

    // A wire counts as taken where its node does not run, too: what was of no interest before a node
    // was disabled is of none afterwards.
    void want_what_nobody_takes() {
        std::vector<bool> consumed(plan_.nodes.size());
        for (const GraphNode& text : graph_.nodes)
            for (const GraphInput& input : text.inputs)
                for (const WireEnd& end : input.from)
                    if (auto found = index_.find(end.node); found != index_.end())
                        consumed[std::size_t(found->second)] = true;
        for (int i = 0; i < count(); ++i) {
            const NodeType* type = node(i).type;
            if (consumed[std::size_t(i)] || !type) continue;
            if (type->writes_files || type->outputs.empty())
                want({i, -1}, {});
            else
                for (int o = 0; o < int(type->outputs.size()); ++o) want({i, o}, {});
        }
    }

    void want(Plan::Source source, const std::string& who) {
        const int asked = source.node;
        if (node(asked).use == Use::bypassed && source.output >= 0) {
            const PortTypes types = node(asked).type->outputs[std::size_t(source.output)].types;
            auto through = passed(source, types, who);
            if (!through) return void(left_out_ = true);
            source = *through;
        }
        const Plan::Node& n = node(source.node);
        if (n.off.empty()) return plan_.wanted.push_back(source);
        left_out_ = true;
        if (n.use == Use::normal || !who.empty())
            plan_.warnings.push_back(fmt::format("'{}' is left out: {}", node(asked).id, n.off));
    }

    // What everything asked for takes when it is all in memory at once: an upper bound, since
    // results are dropped when nobody needs them any more.
    void estimate_memory() {
        std::vector<bool> needed(plan_.nodes.size());
        for (const Plan::Source& w : plan_.wanted) needed[std::size_t(w.node)] = true;
        double total = 0, largest = 0;
        std::string largest_name;
        for (int i = count() - 1; i >= 0; --i) {
            if (!needed[std::size_t(i)] || !node(i).ok) continue;
            for (int from : sources_[std::size_t(i)]) needed[std::size_t(from)] = true;
            double own = memory_of(node(i));
            total += own;
            if (own > largest) {
                largest = own;
                largest_name = node(i).id;
            }
        }
        double limit = double(options_.memory_limit);
        if (limit == 0) limit = double(sysconf(_SC_PHYS_PAGES)) * double(sysconf(_SC_PAGESIZE));
        if (total > limit)
            plan_.warnings.push_back(fmt::format(
                "this graph may need {} of memory at once, {} of it for node '{}', and there are "
                "{}; "
                "take a smaller region or coarser level, or ask for fewer outputs",
                human_bytes(total), human_bytes(largest), largest_name, human_bytes(limit)));
    }

    static double memory_of(const Plan::Node& node) {
        double bytes = double(node.working_bytes);
        if (!node.type->writes_files)
            for (const ValueDesc& output : node.outputs) bytes += memory_of(output);
        return bytes;
    }

    // In double: sizes that overflow 64 bits are just as much too large.
    static double memory_of(const ValueDesc& desc) {
        if (desc.by_region) return 0;
        if (auto* image = std::get_if<ImageDesc>(&desc.detail))
            return double(image->size.x) * double(image->size.y) * 16;
        if (auto* bricks = std::get_if<BricksDesc>(&desc.detail))
            return double(bricks->compressed_bytes);
        if (auto* lattice = std::get_if<std::shared_ptr<const LatticeDesc>>(&desc.detail)) {
            double bytes = 0;
            for (const LatticeDesc::Grid& grid : (*lattice)->grids) bytes += memory_of(grid.grid);
            return bytes;
        }
        if (auto* series = std::get_if<std::shared_ptr<const SeriesDesc>>(&desc.detail))
            return memory_of((*series)->step);  // steps are fetched one at a time
        if (auto* volume = std::get_if<VolumeDesc>(&desc.detail))
            return double(volume->dims.x) * double(volume->dims.y) * double(volume->dims.z) *
                   double(volume->voxel_bytes());
        return 0;
    }

    const Graph& graph_;
    const Registry& registry_;
    const CheckOptions& options_;
    LimitedSuggestions near_type_, near_node_;
    Plan plan_;
    std::unordered_map<std::string_view, int> index_;
    std::vector<std::vector<int>>
        sources_;             // nodes that feed each node, of every wire that names one
    std::vector<int> order_;  // of evaluation, as indices into graph_.nodes; empty until sorted
    bool left_out_ = false;   // something that was asked for is off
    std::vector<std::vector<std::string>> examples_;  // node types by the PortType they make
};

}  // namespace

Plan check(const Graph& graph, const Registry& registry, const CheckOptions& options) {
    return Checker(graph, registry, options).run();
}

}  // namespace voxloom
