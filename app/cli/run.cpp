#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "app/cli/commands.h"
#include "app/cli/files.h"
#include "app/cli/progress.h"
#include "app/cli/run_plan.h"
#include "app/cli/session.h"
#include "core/base/text.h"
#include "core/graph/report.h"

namespace voxloom::cli {

namespace {

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

}  // namespace

int run(const RunArguments& arguments, std::stop_token stop) {
    load_registry();  // what is wrong with plugins is said first
    return run(Document::load(arguments.graph), arguments, stop);
}

int run(const Document& document, const RunArguments& arguments, std::stop_token stop) {
    if (!arguments.sweep.empty()) return sweep(document, arguments, stop);
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
