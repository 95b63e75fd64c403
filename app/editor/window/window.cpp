#include "app/editor/window/window.h"

#define GLFW_INCLUDE_NONE
#include <GL/gl.h>
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <ctime>
#include <memory>
#include <utility>

#include "app/editor/view/picture.h"
#include "app/editor/window/input.h"
#include "app/editor/window/kept_frame.h"
#include "app/editor/window/screen_file.h"
#include "core/base/error.h"
#include "core/base/output_file.h"

namespace voxloom::editor {

namespace fs = std::filesystem;

namespace {

// After an event a few frames more are drawn: what it changed may change what the next one shows. Where a question comes up or
// goes, what is behind it fades.
constexpr int kFramesAfterEvent = 3, kFramesOfFading = 15;
constexpr double kFrameSeconds = 1.0 / 60;

std::string last_glfw_error() {
    const char* text = nullptr;
    glfwGetError(&text);
    return text ? text : "unknown reason";
}

glm::ivec2 fitting_size() {
    glm::ivec2 at, room(0);
    if (GLFWmonitor* monitor = glfwGetPrimaryMonitor()) glfwGetMonitorWorkarea(monitor, &at.x, &at.y, &room.x, &room.y);
    const glm::ivec2 wanted(1600, 960);
    return room.x > 0 && room.y > 0 ? glm::min(wanted, room) : wanted;
}

// The window with everything that must be undone with it, in order.
class Window {
  public:
    explicit Window(const EditArguments& arguments) {
        if (!glfwInit()) fail("no window can be opened ({}); is there a display? 'voxloom run' needs none", last_glfw_error());
        glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
        glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
        glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
        const glm::ivec2 size = arguments.size.x > 0 ? arguments.size : fitting_size();
        window_ = glfwCreateWindow(size.x, size.y, "voxloom", nullptr, nullptr);
        if (!window_) {
            const std::string reason = last_glfw_error();
            glfwTerminate();
            fail("no window with OpenGL 3.3 can be opened ({}); install a driver, such as libgl1-mesa-dri", reason);
        }
        glfwMakeContextCurrent(window_);
        glfwSwapInterval(1);
        IMGUI_CHECKVERSION();
        ImGui::CreateContext();
        ImGui::GetIO().IniFilename = nullptr;
        ImGui_ImplGlfw_InitForOpenGL(window_, false);
        ImGui_ImplOpenGL3_Init("#version 330");
    }
    ~Window() {
        ImGui_ImplOpenGL3_Shutdown();
        ImGui_ImplGlfw_Shutdown();
        ImGui::DestroyContext();
        glfwDestroyWindow(window_);
        glfwTerminate();
    }
    Window(const Window&) = delete;
    Window& operator=(const Window&) = delete;
    GLFWwindow* get() const { return window_; }

  private:
    GLFWwindow* window_ = nullptr;
};

void set_theme(Editor& editor, float screen_scale) {
    editor.theme_changed = false;
    if (apply_theme(editor.settings.dark, screen_scale * float(editor.settings.text_scale))) {
        ImGui_ImplOpenGL3_DestroyFontsTexture();
        ImGui_ImplOpenGL3_CreateFontsTexture();
    }
    save_settings(editor.settings, editor.settings_file);
}

// "out/NAME-20261128-201500.png", a file that is not there yet.
fs::path fresh_file(const Editor& editor, const std::string& name) {
    const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
    std::tm local{};
    localtime_r(&now, &local);
    char time[64];
    std::strftime(time, sizeof time, "%Y%m%d-%H%M%S", &local);
    fs::path file = editor.output_folder / fmt::format("{}-{}.png", name, time);
    for (int i = 2; fs::exists(file); ++i) file = editor.output_folder / fmt::format("{}-{}-{}.png", name, time, i);
    return file;
}

// The shown picture as it was computed, not as it is magnified.
void save_picture(const Editor& editor, const fs::path& file) {
    for (const WireEnd& port : editor.watched)
        if (auto value = editor.live.values.find(port.node + "." + port.port); value != editor.live.values.end())
            if (const auto* image = std::get_if<ImagePtr>(&value->second.value)) return save_png(file, (*image)->size(), pixels_of(**image));
    fail("there is no picture to save");
}

template <class Save>
void take_picture(Editor& editor, const char* name, Save save) {
    const fs::path file = fresh_file(editor, name);
    try {
        save(file);
        say(editor, "Saved " + fs::absolute(file).lexically_normal().string());
    } catch (const std::exception& e) {
        say(editor, e.what(), true);
    }
}

void take_wanted_pictures(Editor& editor, glm::ivec2 size) {
    if (std::exchange(editor.picture_wanted, false))
        take_picture(editor, "picture", [&](const fs::path& file) { save_picture(editor, file); });
    if (std::exchange(editor.screenshot_wanted, false))
        take_picture(editor, "screenshot", [&](const fs::path& file) { save_screenshot(file, size.x, size.y); });
}

void write_screen(const Editor& editor, bool resting, const fs::path& file) {
    OutputFile out(file);
    out.write(screen_to_json(editor, resting));
    out.commit();
}

void remember_frame(Editor& editor, double seconds, double cpu_seconds) {
    constexpr std::size_t kMostFrames = 600;
    if (editor.frame_seconds.size() < kMostFrames) {
        editor.frame_seconds.push_back(0);
        editor.frame_cpu_seconds.push_back(0);
    }
    const std::size_t at = editor.frames_drawn++ % kMostFrames;
    editor.frame_seconds[at] = seconds;
    editor.frame_cpu_seconds[at] = cpu_seconds;
}

double thread_cpu_seconds() {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return double(now.tv_sec) + double(now.tv_nsec) * 1e-9;
}

// From now until the window changes without an event, where its last frame was begun at `begun`; at most a while.
double seconds_to_change(const Editor& editor, double begun) {
    constexpr double kLongestRest = 5, kBehind = 0.002;
    return std::min(editor.next_change + kBehind - ImGui::GetTime() - (glfwGetTime() - begun), kLongestRest);
}

// False where it is the picture that is on the screen already.
bool draw_frame(Editor& editor, GLFWwindow* window, Input& input, KeptFrame& kept) {
    ImGui_ImplOpenGL3_NewFrame();
    ImGui_ImplGlfw_NewFrame();
    input.give_to_frame();
    ImGui::NewFrame();
    draw(editor);
    ImGui::Render();
    glm::ivec2 size;
    glfwGetFramebufferSize(window, &size.x, &size.y);
    if (editor.screenshot_wanted && !kept.keeps()) kept.forget();
    // The canvas has the colour of what is behind it, and is not drawn again.
    const bool changed = kept.draw(*ImGui::GetDrawData(), size, ImGui::ColorConvertU32ToFloat4(theme().canvas));
    delete_replaced_textures(editor);
    take_wanted_pictures(editor, size);
    if (changed) kept.show();
    return changed;
}

}  // namespace

int run_window(const EditArguments& arguments, const Registry& registry) {
    Window window(arguments);
    Input input(window.get());
    KeptFrame kept(window.get());
    std::atomic<bool> woken{false};
    // Editors hold textures of the window's context, so they end before it.
    Editor editor(registry, settings_file(), [&woken] { woken = true, glfwPostEmptyEvent(); });
    editor.output_folder = arguments.out;
    editor.marks_wanted = !arguments.screen.empty();
    float screen_scale = 1, ignored = 1;
    glfwGetWindowContentScale(window.get(), &screen_scale, &ignored);
    if (arguments.scale > 0) screen_scale = float(arguments.scale);
    set_theme(editor, screen_scale);
    // A file that cannot be read is said before there is anything to lose.
    if (!arguments.graph.empty()) {
        begin_document(editor, open_workspace(arguments.graph));
        remember(editor.settings, arguments.graph);
        save_settings(editor.settings, editor.settings_file);
    }

    const std::stop_callback wake_to_stop(arguments.stop, [] { glfwPostEmptyEvent(); });
    double begun = glfwGetTime();
    bool held = false;  // what is under the hand, or moves by itself, is drawn again and again
    for (int frames = kFramesAfterEvent; !editor.quit && !arguments.stop.stop_requested();) {
        // Software renderers do not wait for the screen.
        const bool sleeps = frames == 0 && !held && !input.waits();
        const double rest = sleeps ? seconds_to_change(editor, begun) : input.waits() ? 0 : begun + kFrameSeconds - glfwGetTime();
        rest > 0 ? glfwWaitEventsTimeout(rest) : glfwPollEvents();
        const bool happened = input.take_happened() || woken.exchange(false) || input.waits();
        frames = sleeps || held || happened ? std::max(frames, kFramesAfterEvent) : frames - 1;
        if (glfwWindowShouldClose(window.get())) {
            glfwSetWindowShouldClose(window.get(), GLFW_FALSE);
            unless_changed(editor, [&editor] { editor.quit = true; });
        }
        begun = glfwGetTime();
        const double cpu_begun = thread_cpu_seconds();
        if (input.take_exposed()) kept.forget();
        if (editor.theme_changed) {
            set_theme(editor, screen_scale);
            kept.forget();
        }
        if (draw_frame(editor, window.get(), input, kept)) remember_frame(editor, glfwGetTime() - begun, thread_cpu_seconds() - cpu_begun);
        if (input.look_for_popups()) frames = kFramesOfFading;
        held = ImGui::IsAnyMouseDown() || editor.moving;
        const bool resting = frames == 0 && !held && !input.waits() && std::isinf(editor.next_change);
        if (!arguments.screen.empty()) write_screen(editor, resting, arguments.screen);
    }
    delete_textures(editor);
    check_stop(arguments.stop);
    return 0;
}

}  // namespace voxloom::editor
