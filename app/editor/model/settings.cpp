#include "app/editor/model/settings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>

#include "core/base/error.h"
#include "core/base/output_file.h"
#include "core/base/text.h"

namespace voxloom::editor {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kMostRecent = 12;

// The comment lines that a graph begins with, in one line.
std::string comment_of(const fs::path& file) {
    std::ifstream in(file);
    std::string about;
    for (std::string line; std::getline(in, line) && line.starts_with("#");) {
        line.erase(0, line.find_first_not_of("# "));
        about += (about.empty() ? "" : " ") + line;
    }
    return about;
}

}  // namespace

fs::path settings_file() {
    if (const char* config = std::getenv("XDG_CONFIG_HOME"); config && *config) return fs::path(config) / "voxloom/editor";
    const char* home = std::getenv("HOME");
    return fs::path(home ? home : ".") / ".config/voxloom/editor";
}

Settings load_settings(const fs::path& file) {
    Settings settings;
    std::ifstream in(file);
    for (std::string line; std::getline(in, line);) {
        const std::size_t space = line.find(' ');
        if (space == std::string::npos) continue;
        const std::string key = line.substr(0, space), value = line.substr(space + 1);
        double number;
        if (key == "recent" && settings.recent.size() < kMostRecent) settings.recent.emplace_back(value);
        if (key == "theme") settings.dark = value != "light";
        if (key == "text-scale" && parse_number(value, number)) settings.text_scale = std::clamp(number, 0.5, 3.0);
    }
    return settings;
}

void save_settings(const Settings& settings, const fs::path& file) {
    std::string text = fmt::format("theme {}\ntext-scale {}\n", settings.dark ? "dark" : "light",
                                   shortest(settings.text_scale));
    for (const fs::path& recent : settings.recent) text += "recent " + recent.string() + "\n";
    try {
        fs::create_directories(file.parent_path());
        OutputFile out(file);
        out.write(text);
        out.commit();
    } catch (const std::exception&) {
        // Nothing that is worth stopping anybody for.
    }
}

void remember(Settings& settings, const fs::path& graph) {
    forget(settings, graph);
    settings.recent.insert(settings.recent.begin(), fs::absolute(graph).lexically_normal());
    if (settings.recent.size() > kMostRecent) settings.recent.resize(kMostRecent);
}

void forget(Settings& settings, const fs::path& graph) {
    std::erase(settings.recent, fs::absolute(graph).lexically_normal());
}

std::vector<Example> find_examples() {
    std::error_code error;
    const fs::path program = fs::read_symlink("/proc/self/exe", error).parent_path();
    std::vector<Example> examples;
    for (const fs::path& folder : {program / "../share/voxloom/graphs", program / "../../../graphs", fs::path("graphs")}) {
        for (const auto& entry : fs::directory_iterator(folder, error))
            if (entry.path().extension() == ".yaml")
                examples.push_back({fs::absolute(entry.path()).lexically_normal(), comment_of(entry.path())});
        if (!examples.empty()) break;
    }
    std::sort(examples.begin(), examples.end(), [](const Example& a, const Example& b) { return a.file < b.file; });
    return examples;
}

}  // namespace voxloom::editor
