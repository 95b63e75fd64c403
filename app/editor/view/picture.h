// Pictures as textures of the window.
#pragma once

#include <string>

#include "app/editor/view/editor.h"

namespace voxloom::editor {

// Uploads where the value is another one. False where there is no picture.
bool update_picture(Picture& picture, const LiveValue* value);
// |a - b| * scale, made anew when one of them is another one. False where they cannot be compared; the
// reason is then in `why`.
bool update_difference(Viewport& view, const LiveValue* a, const LiveValue* b, std::string& why);
void delete_textures(Editor& editor);
// The first image of a node as an item of ImGui, no larger than `most` pixels; nothing where there is none.
void draw_thumbnail(Editor& editor, const std::string& node, const NodePorts& ports, float most);

// "(3, 4)  0.1 0.2 0.3 1": what a pixel is, and where in the world what it shows. Empty outside.
std::string pixel_text(const Image& image, glm::dvec2 at, const Camera* camera);

}  // namespace voxloom::editor
