#include "core/graph/report.h"

#include <cmath>
#include <nlohmann/json.hpp>

namespace voxloom {

namespace {

using Json = nlohmann::ordered_json;

// JSON has no infinities and no NaN: they are written as the words that YAML has for them.
Json number(double v) {
    if (std::isnan(v)) return "nan";
    if (std::isinf(v)) return v > 0 ? "inf" : "-inf";
    return v;
}

Json numbers(const std::vector<double>& values) {
    Json list = Json::array();
    for (double v : values) list.push_back(number(v));
    return list;
}

Json vec(glm::dvec3 v) { return numbers({v.x, v.y, v.z}); }
Json vec(Index3 v) { return {v.x, v.y, v.z}; }

Json param_value(const ParamValue& value) {
    return std::visit(
        [](const auto& v) -> Json {
            using T = std::decay_t<decltype(v)>;
            if constexpr (std::is_same_v<T, double>) {
                return number(v);
            } else if constexpr (std::is_same_v<T, std::vector<double>>) {
                return numbers(v);
            } else if constexpr (std::is_same_v<T, Rows>) {
                Json rows = Json::array();
                for (const auto& row : v) rows.push_back(numbers(row));
                return rows;
            } else {
                return Json(v);
            }
        },
        value);
}

std::string dump(const Json& json) {
    // Text from files may hold any bytes; a report must be readable all the same.
    return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

Json volume_json(const VolumeDesc& d) {
    Json j;
    j["dims"] = vec(d.dims);
    j["type"] = name_of(d.type);
    j["components"] = d.components;
    j["color"] = d.color;
    j["spacing"] = vec(d.spacing());
    j["origin"] = vec(d.origin());
    Json matrix = Json::array();
    for (int row = 0; row < 4; ++row)
        matrix.push_back(numbers({d.index_to_world[0][row], d.index_to_world[1][row],
                                  d.index_to_world[2][row], d.index_to_world[3][row]}));
    j["index_to_world"] = matrix;
    j["unit"] = d.unit;
    j["name"] = d.name;
    j["significant_bits"] = d.significant_bits;
    if (d.range) j["range"] = {number(d.range->min), number(d.range->max)};
    j["has_mask"] = d.has_mask;
    j["dense_bytes"] = d.dense_bytes();
    return j;
}

Json value_desc_json(const ValueDesc& desc) {
    Json j;
    j["port_type"] = name_of(desc.type);
    if (auto* v = std::get_if<VolumeDesc>(&desc.detail)) j["volume"] = volume_json(*v);
    if (auto* i = std::get_if<ImageDesc>(&desc.detail)) j["size"] = {i->size.x, i->size.y};
    if (auto* b = std::get_if<BricksDesc>(&desc.detail)) {
        j["volume"] = volume_json(b->volume);
        j["brick"] = {b->brick.x, b->brick.y, b->brick.z};
        j["compressed_bytes"] = b->compressed_bytes;
        for (const LevelDesc& level : b->levels)
            j["levels"].push_back({{"dims", vec(level.dims)},
                                   {"bricks", {level.bricks.x, level.bricks.y, level.bricks.z}}});
    }
    if (auto* s = std::get_if<std::shared_ptr<const SeriesDesc>>(&desc.detail)) {
        j["times"] = numbers((*s)->times);
        j["time_unit"] = (*s)->time_unit;
        j["step"] = value_desc_json((*s)->step);
    }
    if (auto* l = std::get_if<std::shared_ptr<const LatticeDesc>>(&desc.detail)) {
        j["kind"] = (*l)->kind;
        for (const auto& grid : (*l)->grids)
            j["grids"].push_back({{"offset", vec(grid.offset)},
                                  {"time", number(grid.time)},
                                  {"grid", value_desc_json(grid.grid)}});
    }
    return j;
}

Json problem_json(const Plan& plan, const Problem& p) {
    return {{"file", plan.file.string()}, {"line", p.mark.line}, {"column", p.mark.column},
            {"node", p.node},             {"where", p.where},    {"message", p.message}};
}

Json param_json(const ParamSpec& spec) {
    Json j;
    j["key"] = spec.key;
    j["kind"] = name_of(spec.kind);
    j["default"] = param_value(spec.initial);
    j["doc"] = spec.doc;
    if (std::isfinite(spec.min)) j["min"] = spec.min;
    if (std::isfinite(spec.max)) j["max"] = spec.max;
    if (spec.slider_min < spec.slider_max)
        j["slider"] = {{"min", spec.slider_min},
                       {"max", spec.slider_max},
                       {"scale", spec.scale == Scale::linear ? "linear" : "logarithmic"}};
    if (!spec.unit.empty()) j["unit"] = spec.unit;
    if (!spec.choices.empty()) j["choices"] = spec.choices;
    if (spec.length) j["length"] = spec.length;
    if (!spec.group.empty()) j["group"] = spec.group;
    if (!spec.shown_if_key.empty())
        j["shown_if"] = {{"key", spec.shown_if_key}, {"values", spec.shown_if_values}};
    constexpr const char* affects[] = {"output", "cost", "display"};
    j["affects"] = affects[int(spec.affects)];
    j["expert"] = spec.expert;
    j["quality"] = spec.quality;
    return j;
}

Json port_json(const PortSpec& port, bool input) {
    Json j;
    j["key"] = port.key;
    j["types"] = Json::array();
    for (int i = 0; i < kPortTypes; ++i)
        if (port.types.has(PortType(i))) j["types"].push_back(name_of(PortType(i)));
    j["doc"] = port.doc;
    if (input) {
        j["optional"] = port.optional;
        j["many"] = port.many;
    }
    return j;
}

// Times of every node that ran more than once.
Json repeats_json(const RunResult& last, const std::vector<RunResult>& earlier) {
    Json repeats = Json::object();
    for (std::size_t i = 0; i < last.nodes.size(); ++i) {
        Json wall = Json::array(), draw = Json::array();
        auto add = [&](const RunResult& run) {
            if (run.nodes[i].state != NodeState::done) return;
            wall.push_back(run.nodes[i].wall_seconds);
            draw.push_back(run.nodes[i].draw_seconds);
        };
        for (const RunResult& run : earlier) add(run);
        add(last);
        if (wall.size() > 1)
            repeats[last.nodes[i].id] = {{"wall_seconds", wall}, {"draw_seconds", draw}};
    }
    return repeats;
}

}  // namespace

std::string run_to_json(const Plan& plan, const RunResult& result,
                        const std::vector<RunResult>& earlier) {
    Json j;
    j["graph"] = plan.file.string();
    j["ok"] = result.ok;
    j["cancelled"] = result.cancelled;
    j["wall_seconds"] = result.wall_seconds;
    j["peak_voxel_bytes"] = result.peak_bytes;
    j["peak_resident_bytes"] = result.peak_resident_bytes;
    j["problems"] = Json::array();
    for (const Problem& p : plan.problems) j["problems"].push_back(problem_json(plan, p));
    if (!earlier.empty()) j["repeats"] = repeats_json(result, earlier);
    j["nodes"] = Json::array();
    for (std::size_t i = 0; i < result.nodes.size(); ++i) {
        const NodeReport& r = result.nodes[i];
        Json n;
        n["id"] = r.id;
        n["type"] = r.type;
        n["state"] = name_of(r.state);
        n["cache"] = r.state == NodeState::cached ? "hit" : r.state == NodeState::done ? "miss" : "";
        if (!r.error.empty()) n["error"] = r.error;
        if (!r.warnings.empty()) n["warnings"] = r.warnings;
        n["wall_seconds"] = r.wall_seconds;
        n["cpu_seconds"] = r.cpu_seconds;
        n["draw_seconds"] = r.draw_seconds;
        n["bytes_in"] = r.bytes_in;
        n["bytes_out"] = r.bytes_out;
        n["peak_bytes"] = r.peak_bytes;
        n["counters"] = Json::object();
        for (const auto& [name, value] : r.counters) n["counters"][name] = number(value);
        n["measurements"] = Json::object();
        for (const auto& [name, m] : r.measurements)
            n["measurements"][name] = {{"value", number(m.first)}, {"unit", m.second}};
        j["nodes"].push_back(std::move(n));
    }
    return dump(j);
}

std::string problems_to_json(const Plan& plan) {
    Json j;
    j["graph"] = plan.file.string();
    j["ok"] = plan.problems.empty();
    j["problems"] = Json::array();
    for (const Problem& p : plan.problems) j["problems"].push_back(problem_json(plan, p));
    j["warnings"] = plan.warnings;
    j["nodes"] = Json::array();
    for (const Plan::Node& node : plan.nodes) {
        Json n;
        n["id"] = node.id;
        n["type"] = node.type ? node.type->id : "";
        n["ok"] = node.ok;
        if (!node.off.empty()) n["off"] = node.off;
        n["outputs"] = Json::object();
        if (node.ok)
            for (std::size_t i = 0; i < node.outputs.size(); ++i)
                n["outputs"][node.type->outputs[i].key] = value_desc_json(node.outputs[i]);
        j["nodes"].push_back(std::move(n));
    }
    return dump(j);
}

std::string node_types_to_json(const std::vector<const NodeType*>& types) {
    Json list = Json::array();
    for (const NodeType* type : types) {
        Json j;
        j["id"] = type->id;
        j["version"] = type->version;
        j["title"] = type->title;
        j["doc"] = type->doc;
        j["keywords"] = type->keywords;
        j["draws"] = type->thread == NodeType::Thread::opengl;
        j["writes_files"] = type->writes_files;
        j["inputs"] = Json::array();
        for (const PortSpec& port : type->inputs) j["inputs"].push_back(port_json(port, true));
        j["outputs"] = Json::array();
        for (const PortSpec& port : type->outputs) j["outputs"].push_back(port_json(port, false));
        j["params"] = Json::array();
        for (const ParamSpec& spec : type->params) j["params"].push_back(param_json(spec));
        list.push_back(std::move(j));
    }
    return dump(list);
}

std::string desc_to_json(const ValueDesc& desc) { return dump(value_desc_json(desc)); }

}  // namespace voxloom
