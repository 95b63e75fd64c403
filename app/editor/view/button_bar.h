// Buttons side by side, as many as there is room for; the others are in a menu at the end.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "app/editor/view/editor.h"

namespace voxloom::editor {

struct BarButton {
    std::string title, key, doc;  // the key as it is written, or none
    std::string name;             // of its mark
    bool possible = true;
    std::function<void()> run;
    bool apart = false;           // from the one before
};

void draw_button(Editor& editor, const BarButton& button);
// From where the next item would stand, in this line, to `right` on the screen. `name` is that of the menu's button.
void button_bar(Editor& editor, const char* name, const std::vector<BarButton>& buttons, float right);

}  // namespace voxloom::editor
