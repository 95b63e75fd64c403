#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "app/cli/commands.h"
#include "app/cli/files.h"
#include "app/cli/progress.h"
#include "app/cli/session.h"
#include "core/base/text.h"
#include "core/data/brick_file.h"
#include "core/graph/report.h"

namespace voxloom::cli {

namespace {

bool opens_files(const NodeType& type) {
    const ParamSpec* path = type.find_param("path");
    return path && path->kind == ParamKind::path_in && type.inputs.empty() && !type.outputs.empty();
}

// A graph of one node that opens the file.
Plan plan_to_open(const NodeType& type, const std::filesystem::path& file, const Registry& registry) {
    const std::string path = to_yaml(std::filesystem::absolute(file).string());
    const Document document = Document::parse("voxloom: 1\nnodes:\n  - { id: file, type: " + type.id +
                                              ", set: { path: " + path + " } }\n");
    return voxloom::check(document.graph(), registry);
}

void print_volume(const VolumeDesc& d, const char* indent) {
    const glm::dvec3 s = d.spacing(), o = d.origin(), e = d.extent() * s;
    const std::string unit = d.unit.empty() ? "" : " " + d.unit;
    fmt::print("{}dimensions   {} x {} x {}  ({} voxels)\n", indent, d.dims.x, d.dims.y, d.dims.z,
               d.voxels());
    fmt::print("{}voxels       {}{}{}\n", indent, name_of(d.type),
               d.color ? (d.components == 4 ? ", RGBA" : ", RGB")
               : d.components > 1 ? fmt::format(", {} components", d.components) : "",
               d.significant_bits ? fmt::format(", {} bits in use", d.significant_bits) : "");
    fmt::print("{}spacing      {} x {} x {}{}\n", indent, shortest(s.x), shortest(s.y), shortest(s.z), unit);
    fmt::print("{}extent       {} x {} x {}{}\n", indent, shortest(e.x), shortest(e.y), shortest(e.z), unit);
    fmt::print("{}origin       {}, {}, {}\n", indent, shortest(o.x), shortest(o.y), shortest(o.z));
    const glm::dmat4& m = d.index_to_world;
    for (int a = 0; a < 3; ++a)
        if (s[a] > 0)
            fmt::print("{}{} axis       {:.4g}, {:.4g}, {:.4g}\n", indent, "xyz"[a], m[a].x / s[a],
                       m[a].y / s[a], m[a].z / s[a]);
    if (d.range)
        fmt::print("{}range        {} to {}\n", indent, shortest(d.range->min), shortest(d.range->max));
    if (!d.name.empty()) fmt::print("{}name         {}\n", indent, d.name);
    fmt::print("{}in memory    {}\n", indent, human_bytes(double(d.dense_bytes())));
}

void print_desc(const ValueDesc& desc) {
    if (auto* series = std::get_if<std::shared_ptr<const SeriesDesc>>(&desc.detail)) {
        const auto& times = (*series)->times;
        fmt::print("series of {} steps", times.size());
        if (!times.empty())
            fmt::print(", time {} to {}{}{}", shortest(times.front()), shortest(times.back()),
                       (*series)->time_unit.empty() ? "" : " ", (*series)->time_unit);
        fmt::print("; each step:\n");
    }
    if (auto* bricks = std::get_if<BricksDesc>(&desc.detail)) {
        fmt::print("bricks of {} x {} x {} in {} levels, {}\n", bricks->brick.x, bricks->brick.y,
                   bricks->brick.z, bricks->levels.size(),
                   human_bytes(double(bricks->compressed_bytes)));
    }
    if (const VolumeDesc* volume = desc.volume()) print_volume(*volume, "  ");
}

struct Statistics {
    double min = 0, max = 0, mean = 0, deviation = 0;
    std::uint64_t finite = 0, not_finite = 0, zeros = 0;
};

Statistics statistics_of(const Volume& volume, const std::stop_token& stop) {
    const VolumeDesc& d = volume.desc();
    Statistics s;
    s.min = INFINITY;
    s.max = -INFINITY;
    double m2 = 0;  // Welford's sum of squared deviations
    Buffer slab(Box{{0, 0, 0}, {d.dims.x, d.dims.y, 1}}.voxels() * d.voxel_bytes(), "slab");
    for (std::int64_t z = 0; z < d.dims.z; ++z) {
        check_stop(stop);
        volume.read({{0, 0, z}, {d.dims.x, d.dims.y, z + 1}}, slab.bytes(), stop);
        with_type(d.type, [&](auto t) {
            for (auto value : slab.as<decltype(t)>()) {
                const double v = double(value);
                if (!std::isfinite(v)) {
                    ++s.not_finite;
                    continue;
                }
                ++s.finite;
                s.zeros += v == 0;
                s.min = std::min(s.min, v);
                s.max = std::max(s.max, v);
                const double step = v - s.mean;
                s.mean += step / double(s.finite);
                m2 += step * (v - s.mean);
            }
        });
    }
    if (s.finite == 0) s.min = s.max = 0;
    s.deviation = s.finite ? std::sqrt(m2 / double(s.finite)) : 0;
    return s;
}

void print_values(const Value& value, std::stop_token stop) {
    VolumePtr volume;
    if (auto* v = std::get_if<VolumePtr>(&value)) volume = *v;
    if (auto* s = std::get_if<SeriesPtr>(&value); s && !(*s)->desc().times.empty()) {
        Value first = (*s)->fetch(0, stop);
        if (auto* v = std::get_if<VolumePtr>(&first)) volume = *v;
        fmt::print("values of the first step:\n");
    }
    if (!volume) return;
    const Statistics s = statistics_of(*volume, stop);
    fmt::print("  values       {} to {}, mean {:.6g}, standard deviation {:.6g}\n", shortest(s.min),
               shortest(s.max), s.mean, s.deviation);
    fmt::print("  zeros        {:.2f} %\n", s.finite ? 100.0 * double(s.zeros) / double(s.finite) : 0.0);
    if (s.not_finite) fmt::print("  not finite   {} (NaN or infinite)\n", s.not_finite);
}

}  // namespace

int info(const InfoArguments& arguments, std::stop_token stop) {
    const Registry& registry = load_registry();
    // Every node that opens a file is asked; the one whose check finds no problem knows the file.
    // A volume is told as one, not as a series of one step.
    std::vector<const NodeType*> openers;
    for (const NodeType* type : registry.all())
        if (opens_files(*type)) openers.push_back(type);
    std::ranges::stable_partition(openers, [](const NodeType* type) { return type->outputs[0].types.has(PortType::volume); });
    std::string first_problem;
    for (const NodeType* type : openers) {
        const Plan plan = plan_to_open(*type, arguments.file, registry);
        if (!plan.problems.empty()) {
            // What opens files of that ending, else the reader of single volumes, has the most to say of what is wrong.
            if (first_problem.empty() || type->id == "readers.volume" || names_ending(*type, arguments.file))
                first_problem = plan.problems.front().message;
            continue;
        }
        if (arguments.json) {
            fmt::print("{}", desc_to_json(plan.nodes.front().outputs.front()));
            return 0;
        }
        fmt::print("{} (opened by {})\n", arguments.file.string(), type->id);
        print_desc(plan.nodes.front().outputs.front());
        if (const auto made_by = provenance_of(arguments.file)) fmt::print("  made by      {}\n", *made_by);
        for (const std::string& warning : plan.warnings) fmt::print(stderr, "warning: {}\n", warning);
        if (arguments.values) {
            ResultCache cache;
            ProgressLine progress(false);
            RunOptions options;
            options.stop = stop;
            options.observer = &progress;
            const RunResult result = evaluate(plan, cache, options);
            if (!result.ok) fail("{}", result.nodes.front().error);
            print_values(result.outputs.front(), stop);
        }
        return 0;
    }
    fail("{}", first_problem.empty() ? "no loaded plugin opens files" : first_problem);
}

}  // namespace voxloom::cli
