#include <cstdio>
#include <utility>

#include "app/cli/commands.h"
#include "app/cli/session.h"
#include "core/base/error.h"
#if defined(VOXLOOM_EDITOR)
#include "app/editor/window/window.h"
#endif

namespace voxloom::cli {

int edit(const EditArguments& arguments, std::stop_token stop) {
#if defined(VOXLOOM_EDITOR)
    editor::EditArguments window;
    char end = 0;
    if (std::sscanf(arguments.size.c_str(), "%dx%d%c", &window.size.x, &window.size.y, &end) != 2 ||
        window.size.x < 320 || window.size.y < 240 || window.size.x > 16384 || window.size.y > 16384)
        fail("--size {}: write WIDTHxHEIGHT, from 320x240 to 16384x16384", arguments.size);
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
