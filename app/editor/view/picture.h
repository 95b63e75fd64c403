// Pictures as textures of the window.
#pragma once

#include <string>

#include "app/editor/view/editor.h"

namespace voxloom::editor {

// Uploads where the value is another one. False where there is no picture.
bool update_picture(Editor& editor, Picture& picture, const LiveValue* value);
void upload(Editor& editor, Picture& picture, glm::ivec2 size, const std::vector<glm::u8vec4>& pixels);
// |a - b| * scale, made on another thread when one of them is another one; until then the last one stays.
// False where there is none; the reason is then in `why`.
bool update_difference(Editor& editor, const LiveValue* a, const LiveValue* b, std::string& why);
// After a frame was drawn: no frame to come draws what was replaced before.
void delete_replaced_textures(Editor& editor);
void delete_textures(Editor& editor);
// The small picture of what a node gives, where there is one: of its first image, volume or bricks.
SmallPicture* small_picture(Editor& editor, const std::string& node, const NodePorts& ports);
inline ImTextureID texture_of(const Picture& picture) { return reinterpret_cast<ImTextureID>(std::uintptr_t(picture.texture)); }

// The handles of the cutting plane that a picture (lo..hi of the screen) shows, where it shows one. True
// while one is in the hand.
bool draw_plane_gizmo(Editor& editor, const WireEnd& port, const Camera* camera, glm::dvec2 lo, glm::dvec2 hi, bool hovered);

// Opaque, over black where the picture is transparent. Not a number is black.
std::vector<glm::u8vec4> pixels_of(const Image& image);
// "(3, 4)", "0.1 0.2 0.3 1", "at 1 2 3": what a pixel is, and where in the world what it shows. Empty outside.
std::vector<std::string> pixel_texts(const Image& image, glm::dvec2 at, const Camera* camera);

}  // namespace voxloom::editor
