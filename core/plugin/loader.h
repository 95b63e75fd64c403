// Finds and loads plugins.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/plugin/registry.h"

namespace voxloom {

// Folders searched, in order: those of VOXLOOM_PLUGIN_PATH (colon-separated), then
// ../lib/voxloom/plugins from the folder of the program.
std::vector<std::filesystem::path> plugin_search_path();

struct LoadedPlugin {
    std::filesystem::path file;
    std::string name;
};
struct LoadReport {
    std::vector<LoadedPlugin> loaded;
    std::vector<std::string> problems;  // one sentence each: file, found, expected, mend
};

// Loads one file, or throws Error. Nothing is ever unloaded: values made by a plugin may live on.
LoadedPlugin load_plugin(const std::filesystem::path& file, Registry& registry);

// Loads every *.so of the folders in order of name; a file name met before is skipped, so that an
// earlier folder overrides a later one. A plugin that is refused is a problem, not an end.
LoadReport load_plugins(Registry& registry,
                        const std::vector<std::filesystem::path>& folders = plugin_search_path());

}  // namespace voxloom
