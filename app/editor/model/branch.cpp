#include "app/editor/model/branch.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "app/editor/model/param_values.h"
#include "app/editor/model/ports.h"
#include "app/editor/model/upstream.h"
#include "core/base/error.h"
#include "core/graph/graph_text.h"

namespace voxloom::editor {

namespace {

constexpr std::size_t kMostTried = 500;

bool makes(const NodeType& type, PortType from, PortType to) {
    const bool takes = std::ranges::any_of(type.inputs, [&](const PortSpec& port) { return !port.optional && port.types.has(from); });
    return takes && std::ranges::any_of(type.outputs, [&](const PortSpec& port) { return type_of(port) == to; });
}

// The nearest node upstream of `start`, or itself, for which `fits` holds; empty where there is none.
template <class F>
std::string nearest(const Graph& graph, const Registry& registry, const std::string& start, F&& fits) {
    for (const GraphNode* node : upstream(graph, start)) {
        const NodeType* type = registry.find(node->type);
        if (type && fits(*type)) return node->id;
    }
    return {};
}

// A node with a table whose input `port` gets what one of these nodes gives.
std::string measuring(const Graph& graph, const Registry& registry, std::string_view port, const std::set<std::string>& sources) {
    for (const GraphNode& node : graph.nodes) {
        const NodeType* type = registry.find(node.type);
        if (!type || !std::ranges::any_of(type->outputs, [](const PortSpec& p) { return type_of(p) == PortType::table; })) continue;
        for (const GraphInput& input : node.inputs)
            if (input.port == port)
                for (const WireEnd& end : input.from)
                    if (sources.count(end.node)) return node.id;
    }
    return {};
}

const NodeStatus* finished(const Evaluator::State& state, const std::string& node) {
    auto found = state.nodes.find(node);
    if (found == state.nodes.end()) return nullptr;
    const NodeState now = found->second.state;
    return now == NodeState::done || now == NodeState::cached ? &found->second : nullptr;
}

std::optional<double> measured(const Evaluator::State& state, const std::string& node, const std::string& name) {
    const NodeStatus* status = finished(state, node);
    if (!status) return {};
    auto found = status->measurements.find(name);
    return found == status->measurements.end() ? std::nullopt : std::optional(found->second.first);
}

std::optional<double> wall(const Evaluator::State& state, const std::string& node) {
    const NodeStatus* status = finished(state, node);
    return status && status->wall_seconds > 0 ? std::optional(status->wall_seconds) : std::nullopt;
}

// From the first row of a node's table.
std::optional<double> tabled(const Evaluator::State& state, const std::string& node, std::string_view column) {
    if (!finished(state, node)) return {};
    for (auto value = state.values.lower_bound(node + "."); value != state.values.end() && value->first.starts_with(node + "."); ++value) {
        const auto* table = std::get_if<TablePtr>(&value->second.value);
        if (!table || !value->second.fresh || (*table)->rows.empty()) continue;
        for (std::size_t c = 0; c < (*table)->columns.size(); ++c)
            if ((*table)->columns[c].name == column) {
                const Table::Cell& cell = (*table)->rows[0][c];
                if (auto* d = std::get_if<double>(&cell)) return *d;
                if (auto* i = std::get_if<std::int64_t>(&cell)) return double(*i);
            }
    }
    return {};
}

std::optional<double> first_of(std::optional<double> a, std::optional<double> b) { return a ? a : b; }

}  // namespace

Branch branch_of(const Graph& graph, const Registry& registry, const WireEnd& picture) {
    Branch b;
    b.picture = picture;
    b.codec = nearest(graph, registry, picture.node, [](const NodeType& type) { return makes(type, PortType::volume, PortType::bricks); });
    if (!b.codec.empty()) {
        b.decoder = nearest(graph, registry, picture.node, [](const NodeType& type) { return makes(type, PortType::bricks, PortType::volume); });
        b.volume_error = measuring(graph, registry, "volume", {b.codec, b.decoder});
    }
    b.image_error = measuring(graph, registry, "image", {picture.node});
    return b;
}

BranchNumbers numbers_of(const Branch& b, const Evaluator::State& state) {
    BranchNumbers n;
    n.ratio = measured(state, b.codec, "ratio");
    n.bits_per_voxel = measured(state, b.codec, "bits per voxel");
    n.psnr = first_of(tabled(state, b.volume_error, "psnr"), measured(state, b.codec, "psnr"));
    n.max_error = first_of(tabled(state, b.volume_error, "max_error"), measured(state, b.codec, "max error"));
    n.image_rmse = tabled(state, b.image_error, "rmse");
    n.encode = first_of(measured(state, b.codec, "codec time"), wall(state, b.codec));
    n.decode = wall(state, b.decoder);
    n.frame = wall(state, b.picture.node);
    return n;
}

void collect_tried(std::vector<Tried>& tried, const std::vector<Branch>& branches, const Evaluator::State& state) {
    for (const Branch& branch : branches) {
        const NodeStatus* status = finished(state, branch.codec);
        const GraphNode* node = state.graph ? state.graph->find(branch.codec) : nullptr;
        if (!status || !node) continue;
        const bool known = std::ranges::any_of(tried, [&](const Tried& t) { return t.codec == branch.codec && t.key == status->key; });
        const BranchNumbers numbers = numbers_of(branch, state);
        if (known || !numbers.encode || !numbers.psnr || std::isnan(*numbers.psnr)) continue;
        if (tried.size() >= kMostTried) tried.erase(tried.begin());
        tried.push_back({branch.codec, status->key, node->params, *numbers.encode, *numbers.psnr});
    }
}

void bring_back(Document& document, const Tried& tried, const Registry& registry) {
    const GraphNode* node = document.graph().find(tried.codec);
    const NodeType* type = node ? registry.find(node->type) : nullptr;
    if (!type) fail("there is no node '{}' any more", tried.codec);
    const std::vector<GraphParam> now = node->params;
    auto has = [](const std::vector<GraphParam>& params, const std::string& key) {
        return std::ranges::any_of(params, [&](const GraphParam& param) { return param.key == key; });
    };
    Document::Step step(document);
    for (const GraphParam& param : now)
        if (!has(tried.params, param.key)) document.reset_param(tried.codec, param.key);
    for (const GraphParam& param : tried.params) {
        const ParamSpec* spec = type->find_param(param.key);
        std::string reason;
        if (auto value = spec ? parse_param(*spec, param.yaml, reason) : std::nullopt) document.set_param(tried.codec, param.key, *value);
    }
}

std::optional<Sweep> sweep_of(const Graph& graph, const Registry& registry, const std::string& id, int steps) {
    const GraphNode* node = graph.find(id);
    const NodeType* type = node ? registry.find(node->type) : nullptr;
    if (!type) return {};
    for (const ParamSpec& spec : type->params) {
        const bool number = spec.kind == ParamKind::real || spec.kind == ParamKind::integer;
        if (!spec.quality || !number || spec.slider_min >= spec.slider_max || !is_in_use(*node, *type, spec)) continue;
        const bool logarithmic = spec.scale == Scale::logarithmic && spec.slider_min > 0;
        Sweep sweep{id, spec.key, {}};
        std::vector<double> numbers;
        for (int i = 0; i < steps; ++i) {
            const double t = double(i) / (steps - 1);
            double v = logarithmic ? spec.slider_min * std::pow(spec.slider_max / spec.slider_min, t)
                                   : spec.slider_min + (spec.slider_max - spec.slider_min) * t;
            v = std::clamp(spec.kind == ParamKind::integer ? std::round(v) : short_number(v), spec.min, spec.max);
            if (numbers.empty() || numbers.back() != v) numbers.push_back(v);
        }
        for (double v : numbers) {
            if (spec.kind == ParamKind::integer)
                sweep.values.emplace_back(std::int64_t(v));
            else
                sweep.values.emplace_back(v);
        }
        return sweep;
    }
    return {};
}

Graph graph_with(const Graph& graph, const Sweep& sweep, std::size_t value) {
    Graph changed = graph;
    for (GraphNode& node : changed.nodes) {
        if (node.id != sweep.node) continue;
        auto param = std::ranges::find_if(node.params, [&](const GraphParam& p) { return p.key == sweep.param; });
        GraphParam& set = param != node.params.end() ? *param : node.params.emplace_back();
        set.key = sweep.param;
        set.yaml = yaml_of(sweep.values.at(value));
    }
    return changed;
}

}  // namespace voxloom::editor
