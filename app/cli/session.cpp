#include "app/cli/session.h"

#include <fmt/format.h>

#include <cstdio>

#include "core/base/text.h"

namespace voxloom::cli {

const Registry& load_registry() {
    // Never destroyed: values made by plugins may outlive main().
    static Registry& registry = *new Registry;
    if (!registry.ids().empty()) return registry;
    LoadReport report = load_plugins(registry);
    for (const std::string& problem : report.problems)
        fmt::print(stderr, "voxloom: plugin not loaded: {}\n", problem);
    if (registry.ids().empty()) {
        std::vector<std::string> folders;
        for (const auto& folder : plugin_search_path()) folders.push_back(folder.string());
        fail("no plugin was found in {}; set VOXLOOM_PLUGIN_PATH to the folder that holds them",
             join(folders, " or "));
    }
    return registry;
}

}  // namespace voxloom::cli
