#include <fmt/format.h>

#include <cstdio>

#include "app/cli/commands.h"
#include "app/cli/files.h"
#include "app/cli/node_page.h"
#include "app/cli/session.h"
#include "core/base/text.h"
#include "core/graph/report.h"

namespace voxloom::cli {

namespace {

void print_list(const Registry& registry) {
    std::string plugin;
    for (const NodeType* type : registry.all()) {
        const std::string prefix = type->id.substr(0, type->id.find('.'));
        if (prefix != plugin) fmt::print("{}{}\n", plugin.empty() ? "" : "\n", prefix);
        plugin = prefix;
        fmt::print("  {:<22} {}\n", type->id, type->doc);
    }
    fmt::print("\n'voxloom nodes TYPE' tells how to use one.\n");
}

}  // namespace

int nodes(const NodesArguments& arguments) {
    const Registry& registry = load_registry();
    std::vector<const NodeType*> types = registry.all();
    if (!arguments.type.empty()) {
        const NodeType* type = registry.find(arguments.type);
        if (!type)
            fail("there is no node type '{}'{} 'voxloom nodes' lists them all", arguments.type,
                 did_you_mean(arguments.type, registry.ids()).empty()
                     ? std::string(";")
                     : did_you_mean(arguments.type, registry.ids()));
        types = {type};
    }
    if (!arguments.markdown.empty()) {
        for (const NodeType* type : types)
            write_text_file(arguments.markdown / (type->id + ".md"), node_page(*type));
        write_text_file(arguments.markdown / "README.md", node_index(registry));
        fmt::print("{} pages written to {}\n", types.size() + 1, arguments.markdown.string());
    } else if (arguments.json) {
        fmt::print("{}", node_types_to_json(types));
    } else if (arguments.type.empty()) {
        print_list(registry);
    } else {
        fmt::print("{}", node_page(*types.front()));
    }
    return 0;
}

}  // namespace voxloom::cli
