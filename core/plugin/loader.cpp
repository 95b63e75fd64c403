#include "core/plugin/loader.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <set>

#include "core/plugin/plugin.h"

namespace voxloom {

namespace fs = std::filesystem;

std::vector<fs::path> plugin_search_path() {
    std::vector<fs::path> folders;
    if (const char* path = std::getenv("VOXLOOM_PLUGIN_PATH")) {
        std::string_view rest = path;
        while (!rest.empty()) {
            std::size_t colon = rest.find(':');
            if (colon != 0) folders.emplace_back(rest.substr(0, colon));
            rest = colon == std::string_view::npos ? "" : rest.substr(colon + 1);
        }
    }
    std::error_code ignored;
    fs::path program = fs::read_symlink("/proc/self/exe", ignored);
    // Who names folders may do without the program's own.
    const fs::path own = program.parent_path().parent_path() / "lib/voxloom/plugins";
    if (!ignored && (folders.empty() || fs::is_directory(own, ignored))) folders.push_back(own);
    return folders;
}

LoadedPlugin load_plugin(const fs::path& file, Registry& registry) {
    // RTLD_LOCAL: two plugins may hide symbols of one name.
    void* library = dlopen(fs::absolute(file).c_str(), RTLD_NOW | RTLD_LOCAL);
    if (!library) {
        const char* reason = dlerror();
        fail("{}: cannot be loaded ({}); rebuild it, or install what it needs", file.string(),
             reason ? reason : "no reason given");
    }
    auto entry = reinterpret_cast<const PluginTable* (*)()>(dlsym(library, "voxloom_plugin"));
    if (!entry) {
        dlclose(library);
        fail("{}: is not a voxloom plugin, it has no function voxloom_plugin; remove it from the "
             "plugin folder", file.string());
    }
    const PluginTable* table = entry();
    if (!table) fail("{}: voxloom_plugin() returned nothing; rebuild the plugin", file.string());
    if (table->interface_revision != kInterfaceRevision)
        fail("{}: built for interface revision {}, this program has {}; rebuild the plugin with "
             "this program's headers", file.string(), table->interface_revision, kInterfaceRevision);
    if (std::string_view(table->fingerprint) != VOXLOOM_FINGERPRINT)
        fail("{}: built with '{}', this program with '{}'; rebuild the plugin with the same "
             "toolchain", file.string(), table->fingerprint, VOXLOOM_FINGERPRINT);
    registry.set_origin(file.string());
    table->add_to(registry);
    return {file, table->name};
}

LoadReport load_plugins(Registry& registry, const std::vector<fs::path>& folders) {
    LoadReport report;
    std::set<fs::path> seen;
    for (const fs::path& folder : folders) {
        std::vector<fs::path> files;
        std::error_code error;
        for (const auto& entry : fs::directory_iterator(folder, error))
            if (entry.path().extension() == ".so") files.push_back(entry.path());
        if (error)
            report.problems.push_back(fmt::format("{}: this folder of plugins cannot be read ({}); correct "
                                                  "VOXLOOM_PLUGIN_PATH", folder.string(), error.message()));
        std::sort(files.begin(), files.end());
        for (const fs::path& file : files) {
            if (!seen.insert(file.filename()).second) continue;
            try {
                report.loaded.push_back(load_plugin(file, registry));
            } catch (const std::exception& e) {
                report.problems.emplace_back(e.what());
            }
        }
    }
    return report;
}

}  // namespace voxloom
