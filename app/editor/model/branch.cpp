#include "app/editor/model/branch.h"

#include <algorithm>
#include <cmath>
#include <limits>
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

std::string output_of(const NodeType& type, PortType wanted) {
    for (const PortSpec& port : type.outputs)
        if (type_of(port) == wanted) return port.key;
    return {};
}

// What is wired to the node's first input that takes a volume and cannot do without it.
WireEnd source_of(const GraphNode& node, const NodeType& type) {
    for (const PortSpec& port : type.inputs)
        if (!port.optional && port.types.has(PortType::volume))
            for (const GraphInput& input : node.inputs)
                if (input.port == port.key && !input.from.empty()) return input.from.front();
    return {};
}

std::string name_of_port(const WireEnd& end) { return end.node + "." + end.port; }

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
        b.original = source_of(*graph.find(b.codec), *registry.find(graph.find(b.codec)->type));
    }
    const std::string coded = !b.codec.empty() ? b.codec : nearest(graph, registry, picture.node, [](const NodeType& type) {
        return !output_of(type, PortType::bricks).empty();
    });
    if (!coded.empty()) b.bricks = {coded, output_of(*registry.find(graph.find(coded)->type), PortType::bricks), {}};
    b.image_error = measuring(graph, registry, "image", {picture.node});
    return b;
}

BranchNumbers numbers_of(const Branch& b, const Evaluator::State& state, const OwnMeasures& own) {
    BranchNumbers n;
    const Decoded* decoded = own.decoded && own.decoded->problem.empty() ? own.decoded.get() : nullptr;
    auto known = [](double v) { return v > 0 ? std::optional(v) : std::nullopt; };
    n.ratio = first_of(measured(state, b.codec, "ratio"), decoded ? known(decoded->ratio) : std::nullopt);
    n.bits_per_voxel = first_of(measured(state, b.codec, "bits per voxel"), decoded ? known(decoded->bits_per_voxel) : std::nullopt);
    n.psnr = first_of(first_of(tabled(state, b.volume_error, "psnr"), decoded ? decoded->psnr : std::nullopt), measured(state, b.codec, "psnr"));
    n.max_error = first_of(first_of(tabled(state, b.volume_error, "max_error"), decoded ? decoded->max_error : std::nullopt), measured(state, b.codec, "max error"));
    n.image_rmse = tabled(state, b.image_error, "rmse");
    n.image_max = tabled(state, b.image_error, "max_error");
    if (own.image_first) n.image_rmse = n.image_max = {};  // they may be against another picture
    n.image_is_own = own.image && !n.image_rmse;
    if (n.image_is_own) n.image_rmse = own.image->rmse, n.image_max = own.image->max_error;
    n.encode = first_of(measured(state, b.codec, "codec time"), wall(state, b.codec));
    n.decode = decoded ? std::optional(decoded->cpu_seconds) : wall(state, b.decoder);
    if (decoded) n.decoded_bytes_per_second = decoded->bytes_per_second;
    n.frame = wall(state, b.picture.node);
    return n;
}

Compared compared_of(const Branch& b, const Evaluator::State& state) {
    Compared compared;
    if (!finished(state, b.bricks.node)) return compared;
    auto bricks_at = [&](const WireEnd& end) {
        auto found = state.bricks.find(name_of_port(end));
        return found == state.bricks.end() ? BricksPtr() : found->second.lock();
    };
    compared.bricks = bricks_at(b.bricks);
    if (!finished(state, b.original.node)) return compared;
    auto volume = state.volumes.find(name_of_port(b.original));
    if (VolumePtr original = volume == state.volumes.end() ? nullptr : volume->second.lock()) compared.original = original;
    else if (BricksPtr others = bricks_at(b.original)) compared.original = others;
    return compared;
}

bool needs_decoding(const Branch& branch, const Evaluator::State& state) {
    return finished(state, branch.codec) && !numbers_of(branch, state).psnr;
}

std::string id_without_codec(const std::string& id) { return id + "~"; }
bool is_without_codec(std::string_view id) { return id.ends_with('~'); }

std::vector<GraphNode> nodes_without_codec(const Graph& graph, const Registry& registry, const Branch& branch) {
    std::vector<GraphNode> nodes;
    if (branch.codec.empty()) return nodes;
    std::set<std::string> copied;
    for (const GraphNode* node : upstream(graph, branch.picture.node)) {
        const std::vector<const GraphNode*> before = upstream(graph, node->id);
        if (std::ranges::any_of(before, [&](const GraphNode* n) { return n->id == branch.codec; })) copied.insert(node->id);
    }
    for (const std::string& id : copied) {
        GraphNode& node = nodes.emplace_back(*graph.find(id));
        const NodeType* type = registry.find(node.type);
        const bool decodes = type && makes(*type, PortType::bricks, PortType::volume);
        if (id == branch.codec || decodes) node.use = GraphNode::Use::bypassed;
        node.id = id_without_codec(id);
        for (GraphInput& input : node.inputs)
            for (WireEnd& end : input.from)
                if (copied.count(end.node)) end.node = id_without_codec(end.node);
    }
    return nodes;
}

void collect_tried(std::vector<Tried>& tried, const std::vector<Branch>& branches, const std::vector<OwnMeasures>& own, const Evaluator::State& state) {
    for (std::size_t i = 0; i < branches.size(); ++i) {
        const Branch& branch = branches[i];
        const NodeStatus* status = finished(state, branch.codec);
        const GraphNode* node = state.graph ? state.graph->find(branch.codec) : nullptr;
        if (!status || !node) continue;
        const bool known = std::ranges::any_of(tried, [&](const Tried& t) { return t.codec == branch.codec && t.key == status->key; });
        const BranchNumbers numbers = numbers_of(branch, state, i < own.size() ? own[i] : OwnMeasures{});
        if (known || !numbers.encode || !numbers.psnr || !(*numbers.psnr > -std::numeric_limits<double>::infinity())) continue;
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
