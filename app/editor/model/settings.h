// What the editor remembers between two sessions: recent files, the theme, the size of its text.
// A text file of "key value" lines in $XDG_CONFIG_HOME/voxloom, else ~/.config/voxloom. What cannot be
// read is as if it were not there; what cannot be written is forgotten.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace voxloom::editor {

struct Settings {
    std::vector<std::filesystem::path> recent;  // absolute, newest first
    bool dark = true;
    double text_scale = 1;                      // 0.5 to 3, beside the screen's own scale
};

std::filesystem::path settings_file();
Settings load_settings(const std::filesystem::path& file);
void save_settings(const Settings& settings, const std::filesystem::path& file);
void remember(Settings& settings, const std::filesystem::path& graph);
void forget(Settings& settings, const std::filesystem::path& graph);

struct Example {
    std::filesystem::path file;
    std::string about;  // the comment at the file's beginning
};
// The graphs that came with the program: of the source folder, of an installation, or of where we are.
std::vector<Example> find_examples();

}  // namespace voxloom::editor
