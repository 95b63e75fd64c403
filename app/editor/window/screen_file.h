// What is on the screen, for programs: tests, and tools that help people who cannot see it.
#pragma once

#include <filesystem>
#include <string>

#include "app/editor/view/editor.h"

namespace voxloom::editor {

// JSON: `items` has name and rectangle [left, top, right, bottom], in window coordinates, of everything
// that can be clicked or read; further the file, whether it has changes, whether something runs, the
// message, the selected nodes, the ports that are looked at, the states of all nodes, and how long frames and pictures took.
// `resting` says that no other frame follows before something happens.
std::string screen_to_json(const Editor& editor, bool resting);

// Rows go down. Throws Error.
void save_png(const std::filesystem::path& file, glm::ivec2 size, const std::vector<glm::u8vec4>& pixels);
// The window's pixels as a PNG file. Called when a frame has been drawn. Throws Error.
void save_screenshot(const std::filesystem::path& file, int width, int height);

}  // namespace voxloom::editor
