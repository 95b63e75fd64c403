#include <cstdio>
#include <utility>

#include "app/cli/commands.h"
#include "app/cli/session.h"
#include "core/base/error.h"
#if defined(VOXLOOM_EDITOR)
#include "app/editor/window/window.h"
#endif

namespace voxloom::cli {

#if defined(VOXLOOM_EDITOR)
namespace {

glm::ivec2 window_size(const std::string& text) {
    glm::ivec2 size;
    char end = 0;
    if (std::sscanf(text.c_str(), "%dx%d%c", &size.x, &size.y, &end) != 2 || size.x < 320 || size.y < 240 || size.x > 16384 || size.y > 16384)
        fail("--size {}: write WIDTHxHEIGHT, from 320x240 to 16384x16384", text);
    return size;
}

}  // namespace
#endif

int edit(const EditArguments& arguments, std::stop_token stop) {
#if defined(VOXLOOM_EDITOR)
    editor::EditArguments window;
    if (!arguments.size.empty()) window.size = window_size(arguments.size);
    window.graph = arguments.graph;
    window.out = arguments.out;
    window.stop = std::move(stop);
    window.scale = arguments.scale;
    window.screen = arguments.screen;
    return editor::run_window(window, load_registry());
#else
    (void)arguments, (void)stop;
    fail("this program was built without the editor; install libimgui-dev, libstb-dev and libglfw3-dev, then build again");
#endif
}

}  // namespace voxloom::cli
