#include "core/graph/check.h"

#include <fmt/format.h>

#include <cstdio>

#include "app/cli/commands.h"
#include "app/cli/session.h"
#include "core/graph/report.h"

namespace voxloom::cli {

int check(const CheckArguments& arguments) {
    const Registry& registry = load_registry();
    const Document document = Document::load(arguments.graph);
    const Plan plan = voxloom::check(document.graph(), registry,
                                     {arguments.overrides, std::filesystem::current_path(), 0});
    const int status = plan.problems.empty() ? 0 : 1;
    if (arguments.json) {
        fmt::print("{}", problems_to_json(plan));
        return status;
    }
    for (const Problem& problem : plan.problems)
        fmt::print(stderr, "{}\n", problem.text(plan.file));
    for (const std::string& warning : plan.warnings) fmt::print(stderr, "warning: {}\n", warning);
    for (const Plan::Node& node : plan.nodes) {
        if (!node.ok) continue;
        std::string outputs;
        for (const ValueDesc& desc : node.outputs)
            outputs += (outputs.empty() ? "" : "; ") + summary(desc);
        fmt::print("{} ({}){}{}\n", node.id, node.type->id, outputs.empty() ? "" : ": ", outputs);
    }
    if (status == 0)
        fmt::print("{}: {} nodes, no problem\n", arguments.graph.string(), plan.nodes.size());
    return status;
}

}  // namespace voxloom::cli
