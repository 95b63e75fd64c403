// `voxloom edit`: the window and its loop.
#pragma once

#include <filesystem>
#include <glm/glm.hpp>
#include <stop_token>

#include "core/plugin/registry.h"

namespace voxloom::editor {

struct EditArguments {
    std::filesystem::path graph;              // empty: the start page
    std::filesystem::path out = "out";        // where screenshots and written files go
    glm::ivec2 size{0};                       // of the window, in its screen's coordinates; 0: as it fits there
    double scale = 0;                         // pixels a unit; 0: the screen's own
    std::stop_token stop;                     // of the program: what is not saved is found by the next session
    std::filesystem::path screen;             // where to write what is on the screen; empty: nowhere
};

// Returns when the window is closed. Throws Error where there is no display or no OpenGL.
int run_window(const EditArguments& arguments, const Registry& registry);

}  // namespace voxloom::editor
