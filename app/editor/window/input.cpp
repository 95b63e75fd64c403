#include "app/editor/window/input.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <imgui.h>

#include <utility>

namespace voxloom::editor {

using Kind = InputEvent::Kind;

Input& Input::of(GLFWwindow* window) {
    Input& input = *static_cast<Input*>(glfwGetWindowUserPointer(window));
    input.happened_ = true;
    return input;
}

Input::Input(GLFWwindow* window) : window_(window) {
    glfwSetWindowUserPointer(window, this);
    glfwSetCursorPosCallback(window, [](GLFWwindow* w, double x, double y) { of(w).queue_.add({.kind = Kind::pointer, .at = {x, y}}); });
    glfwSetScrollCallback(window, [](GLFWwindow* w, double x, double y) { of(w).queue_.add({.kind = Kind::wheel, .at = {x, y}}); });
    glfwSetMouseButtonCallback(window, [](GLFWwindow* w, int button, int action, int) {
        of(w).queue_.add({.kind = Kind::button, .code = button, .down = action != GLFW_RELEASE});
    });
    // A key's text comes right behind it, and again whenever the key repeats.
    glfwSetKeyCallback(window, [](GLFWwindow* w, int key, int, int action, int) {
        Input& input = of(w);
        input.key_ = action == GLFW_RELEASE ? -1 : key;
        input.repeated_ = action == GLFW_REPEAT;
        if (action != GLFW_REPEAT) input.queue_.add({.kind = Kind::key, .code = key, .down = action == GLFW_PRESS});
    });
    glfwSetCharCallback(window, [](GLFWwindow* w, unsigned character) {
        Input& input = of(w);
        input.queue_.add({.kind = Kind::text, .code = int(character), .typed_by = input.key_, .repeated = input.repeated_});
    });
    glfwSetWindowRefreshCallback(window, [](GLFWwindow* w) { of(w).exposed_ = true; });
    glfwSetWindowFocusCallback(window, [](GLFWwindow* w, int focused) { of(w), ImGui_ImplGlfw_WindowFocusCallback(w, focused); });
    glfwSetCursorEnterCallback(window, [](GLFWwindow* w, int entered) { of(w), ImGui_ImplGlfw_CursorEnterCallback(w, entered); });
    glfwSetFramebufferSizeCallback(window, [](GLFWwindow* w, int, int) { of(w); });
    glfwSetWindowCloseCallback(window, [](GLFWwindow* w) { of(w); });
}

void Input::give_to_frame() {
    for (const InputEvent& event : queue_.next_frame()) switch (event.kind) {
            case Kind::pointer: pointer_ = event.at; break;
            case Kind::wheel: ImGui_ImplGlfw_ScrollCallback(window_, event.at.x, event.at.y); break;
            case Kind::button: event.down ? void(buttons_.insert(event.code)) : void(buttons_.erase(event.code)); break;
            case Kind::key: ImGui_ImplGlfw_KeyCallback(window_, event.code, 0, event.down ? GLFW_PRESS : GLFW_RELEASE, 0); break;
            case Kind::text: ImGui_ImplGlfw_CharCallback(window_, unsigned(event.code)); break;
        }
    ImGuiIO& io = ImGui::GetIO();
    for (int button = 0; button < IM_ARRAYSIZE(io.MouseDown); ++button) io.MouseDown[button] = buttons_.contains(button);
    if (pointer_ && ImGui::IsMousePosValid(&io.MousePos)) io.MousePos = {float(pointer_->x), float(pointer_->y)};
}

bool Input::look_for_popups() {
    const bool there = ImGui::IsPopupOpen("", ImGuiPopupFlags_AnyPopupId | ImGuiPopupFlags_AnyPopupLevel);
    const bool changed = std::exchange(popup_, there) != there;
    if (changed && there) queue_.wait_for_texts();
    return changed;
}

}  // namespace voxloom::editor
