// Colours, sizes and fonts: one scale for everything, dark or light.
#pragma once

#include <imgui.h>

#include <glm/glm.hpp>

#include "core/data/value.h"
#include "core/graph/evaluate.h"

namespace voxloom::editor {

struct Theme {
    bool dark = true;
    float scale = 1;  // pixels a unit: the screen's scale times the user's
    ImU32 canvas = 0, grid = 0, panel = 0, node = 0, header = 0, border = 0;
    ImU32 text = 0, muted = 0, accent = 0, good = 0, warn = 0, bad = 0;
    ImFont* body = nullptr;
    ImFont* title = nullptr;
    ImFont* mono = nullptr;
};
const Theme& theme();

// Sets colours and spacing of everything, and loads the fonts where the scale has changed. Between
// frames only; true when the font texture must be made anew.
bool apply_theme(bool dark, float scale);

ImU32 color_of(PortType type);
ImU32 color_of(NodeState state);
ImU32 faded(ImU32 color, float alpha);  // times its own alpha
inline float ui(double length) { return float(length) * theme().scale; }

inline ImVec2 im(glm::dvec2 v) { return {float(v.x), float(v.y)}; }
inline glm::dvec2 vec(ImVec2 v) { return {v.x, v.y}; }

// As ImGui's, for our colours and std::string.
void text_in(ImU32 color, const char* text);
void wrapped_in(ImU32 color, const std::string& text);
void tooltip(const std::string& text);  // for the last item, when hovered, wrapped

// The text cut to `width` pixels, with an ellipsis where something is missing.
std::string shortened(const std::string& text, float width, ImFont* font, float size);
// With line breaks at spaces and behind slashes, so that lines are at most so wide where their words are.
std::string wrapped(const std::string& text, float width, ImFont* font, float size);

}  // namespace voxloom::editor
