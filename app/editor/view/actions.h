// Everything that can be done with a key: one table for keys, buttons, tooltips and the help page.
#pragma once

#include <string>
#include <vector>

#include "app/editor/view/button_bar.h"

namespace voxloom::editor {

struct Action {
    const char* id;
    const char* group;
    const char* title;
    const char* doc;   // one sentence
    int key = 0;       // GLFW_KEY_*
    bool ctrl = false, shift = false;
    void (*run)(Editor&) = nullptr;
    bool (*possible)(const Editor&) = nullptr;  // null: always
};

const std::vector<Action>& actions();
const Action& action(std::string_view id);
std::string key_text(const Action& action);  // "Ctrl+Shift+S"

// Runs what the keyboard asks for, unless a text is being typed.
void handle_keys(Editor& editor);
// A button with the action's title and tooltip.
BarButton button_of(Editor& editor, std::string_view id, bool apart = false);
void action_button(Editor& editor, std::string_view id);

}  // namespace voxloom::editor
