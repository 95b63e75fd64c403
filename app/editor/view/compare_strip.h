// What stands below compared pictures: a table of numbers, and a plot of what was tried.
#pragma once

#include "app/editor/view/editor.h"

namespace voxloom::editor {

inline constexpr double kStripText = 12, kStripLine = 13;  // before scaling
inline constexpr double kNumberRows = 9;                   // of the table, with its header

ImU32 color_of_branch(std::size_t k);
void say_at(ImVec2 at, ImU32 color, const std::string& text, double width);

// Its width before scaling, for so many branches.
double numbers_width(std::size_t branches);
void draw_numbers(Editor& editor, ImVec2 lo);
// A button with the choice of what pictures are measured against.
void draw_against(Editor& editor);

}  // namespace voxloom::editor
