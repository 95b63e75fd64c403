#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "app/cli/commands.h"
#include "app/cli/files.h"
#include "app/cli/progress.h"
#include "app/cli/session.h"
#include "core/base/text.h"
#include "core/graph/report.h"

namespace voxloom::cli {

namespace {

struct Saver {
    int node;  // of the plan
    std::filesystem::path file;
};

// What is written for a wanted output of this type, or null when the type is not a file's.
struct FileKind {
    const char* writer;
    const char* port;
    const char* extension;
};
const FileKind* file_kind(PortType type) {
    static constexpr FileKind image{"writers.image", "image", "png"};
    static constexpr FileKind table{"writers.table", "table", "csv"};
    static constexpr FileKind volume{"writers.volume", "volume", "nrrd"};
    switch (type) {
        case PortType::image: return &image;
        case PortType::table: return &table;
        case PortType::volume: return &volume;
        default: return nullptr;
    }
}

PortType output_type(const Plan& plan, const Plan::Source& source) {
    const PortSpec& port =
        plan.nodes[std::size_t(source.node)].type->outputs[std::size_t(source.output)];
    int type = 0;
    while (!port.types.has(PortType(type))) ++type;
    return PortType(type);
}

// Every wanted image, table and volume gets a writer behind it, as if the graph had one.
std::vector<Saver> add_savers(Plan& plan, const Registry& registry) {
    std::vector<Saver> savers;
    const std::vector<Plan::Source> wanted = plan.wanted;
    for (const Plan::Source& source : wanted) {
        if (source.output < 0) continue;
        const Plan::Node& from = plan.nodes[std::size_t(source.node)];
        if (!from.ok) continue;
        const FileKind* kind = file_kind(output_type(plan, source));
        const NodeType* writer = kind ? registry.find(kind->writer) : nullptr;
        if (!writer) continue;
        Plan::Node node;
        const std::string name =
            from.id + "." + from.type->outputs[std::size_t(source.output)].key;
        node.id = "write " + name;
        node.type = writer;
        node.params = Params(writer->params, plan.folder);
        node.params.set("path", name + "." + kind->extension);
        node.inputs.resize(writer->inputs.size());
        node.inputs[std::size_t(writer->find_input(kind->port) - writer->inputs.data())] = {source};
        node.outputs.resize(writer->outputs.size());
        node.ok = true;
        savers.push_back({int(plan.nodes.size()), name + "." + kind->extension});
        plan.wanted.push_back({int(plan.nodes.size()), -1});
        plan.nodes.push_back(std::move(node));
    }
    return savers;
}

int node_named(const Plan& plan, std::string_view id, std::string_view option) {
    const int node = plan.find(id);
    if (node >= 0) return node;
    std::vector<std::string> ids;
    for (const Plan::Node& n : plan.nodes) ids.push_back(n.id);
    fail("{}: the graph has no node '{}'{}", option, id, did_you_mean(id, ids));
}

// What --repeat computes anew: the nodes named by --again, else all that draw.
std::vector<int> nodes_to_repeat(const Plan& plan, const std::vector<std::string>& again) {
    std::vector<int> nodes;
    for (const std::string& id : again) nodes.push_back(node_named(plan, id, "--again"));
    if (again.empty())
        for (std::size_t i = 0; i < plan.nodes.size(); ++i)
            if (plan.nodes[i].ok && plan.nodes[i].type->thread == NodeType::Thread::opengl)
                nodes.push_back(int(i));
    return nodes;
}

void select_outputs(Plan& plan, const std::vector<std::string>& outputs) {
    if (outputs.empty()) return;
    plan.wanted.clear();
    for (const std::string& name : outputs) {
        const std::size_t dot = name.find('.');
        const int node = node_named(plan, std::string_view(name).substr(0, dot), "--output " + name);
        int output = -1;
        if (const NodeType* type = plan.nodes[std::size_t(node)].type;
            type && dot != std::string::npos) {
            std::vector<std::string> ports;
            for (const PortSpec& port : type->outputs) ports.push_back(port.key);
            auto it = std::find(ports.begin(), ports.end(), name.substr(dot + 1));
            if (it == ports.end())
                fail("--output {}: node '{}' ({}) has no output '{}'; it has {}", name,
                     plan.nodes[std::size_t(node)].id, type->id, name.substr(dot + 1),
                     join(ports, ", "));
            output = int(it - ports.begin());
        }
        plan.wanted.push_back({node, output});
    }
}

std::string measurements_text(const NodeReport& report) {
    std::string text;
    for (const auto& [name, m] : report.measurements)
        text += fmt::format("{}{} {:.4g}{}{}", text.empty() ? "" : ", ", name, m.first,
                            m.second.empty() ? "" : " ", m.second);
    return text;
}

void print_summary(const RunResult& result) {
    std::size_t width = 4;
    for (const NodeReport& r : result.nodes)
        if (r.state != NodeState::not_asked) width = std::max(width, r.id.size());
    fmt::print("{:<{}}  {:<9}  {:>9}  {:>10}\n", "node", width, "state", "time", "out");
    for (const NodeReport& r : result.nodes) {
        if (r.state == NodeState::not_asked) continue;
        std::string line = fmt::format("{:<{}}  {:<9}  {:>9}  {:>10}", r.id, width, name_of(r.state),
                                       human_seconds(r.wall_seconds), human_bytes(double(r.bytes_out)));
        if (r.draw_seconds > 0) line += "  drawn in " + human_seconds(r.draw_seconds);
        if (std::string text = measurements_text(r); !text.empty()) line += "  " + text;
        fmt::print("{}\n", line);
    }
}

// Errors and warnings, as sentences, on standard error.
void print_messages(const Plan& plan, const RunResult& result) {
    for (std::size_t i = 0; i < result.nodes.size(); ++i) {
        const NodeReport& r = result.nodes[i];
        auto say = [&](const std::string& sentence) {
            fmt::print(stderr, "{}\n", Problem{plan.nodes[i].mark, r.id, "", sentence}.text(plan.file));
        };
        for (const std::string& warning : r.warnings) say("warning: " + warning);
        if (r.state == NodeState::failed) say(r.error);
        // What the check found was said before; the writers behind outputs are nobody's nodes.
        if (r.state == NodeState::not_run && plan.nodes[i].ok && plan.nodes[i].mark.line > 0)
            say("not run: " + r.error);
    }
}

}  // namespace

int run(const RunArguments& arguments, std::stop_token stop) {
    load_registry();  // what is wrong with plugins is said first
    return run(Document::load(arguments.graph), arguments, stop);
}

int run(const Document& document, const RunArguments& arguments, std::stop_token stop) {
    const Registry& registry = load_registry();
    Plan plan = voxloom::check(document.graph(), registry,
                               {arguments.overrides, std::filesystem::current_path(), 0});
    for (const Problem& problem : plan.problems)
        fmt::print(stderr, "{}\n", problem.text(plan.file));
    for (const std::string& warning : plan.warnings) fmt::print(stderr, "warning: {}\n", warning);
    select_outputs(plan, arguments.outputs);
    const std::vector<Saver> savers = add_savers(plan, registry);
    const bool writes = std::ranges::any_of(plan.wanted, [&](const Plan::Source& wanted) {
        const NodeType* type = plan.nodes[std::size_t(wanted.node)].type;
        return type && type->writes_files;
    });
    if (writes) require_writable(arguments.out, "--out");
    if (!arguments.report.empty()) require_writable(arguments.report.parent_path(), "--report");

    ResultCache cache(std::uint64_t(arguments.cache_gib * double(1 << 30)));
    RunOptions options;
    options.stop = stop;
    options.output_folder = arguments.out;
    options.threads = arguments.threads;
    RunResult result;
    std::vector<RunResult> earlier;
    for (int i = 0; i < arguments.repeat; ++i) {
        if (i == 1) options.again = nodes_to_repeat(plan, arguments.again);
        if (i > 0) earlier.push_back(std::move(result));
        ProgressLine progress(arguments.quiet);
        options.observer = &progress;
        result = evaluate(plan, cache, options);
        if (!result.ok) break;
    }
    print_messages(plan, result);
    const std::string report = run_to_json(plan, result, earlier);
    if (!arguments.report.empty()) write_text_file(arguments.report, report);
    if (arguments.json) {
        fmt::print("{}", report);
    } else {
        print_summary(result);
        for (const Saver& saver : savers)
            if (result.nodes[std::size_t(saver.node)].state == NodeState::done)
                fmt::print("{}\n", (arguments.out / saver.file).string());
    }
    if (result.cancelled) {
        fmt::print(stderr, "voxloom: cancelled\n");
        return 130;
    }
    return result.ok && plan.problems.empty() ? 0 : 1;
}

}  // namespace voxloom::cli
