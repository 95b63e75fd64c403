#include "app/editor/view/picture.h"

#include <GL/gl.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/measure/image_error.h"

namespace voxloom::editor {

namespace {

#ifndef GL_CLAMP_TO_EDGE
#define GL_CLAMP_TO_EDGE 0x812F
#endif

// Opaque, over black where the picture is transparent. Not a number is black.
std::vector<glm::u8vec4> pixels_of(const Image& image) {
    std::vector<glm::u8vec4> pixels(std::size_t(image.size().x) * std::size_t(image.size().y));
    if (image.format() == Image::Format::rgba8) {
        std::ranges::copy(image.rgba8(), pixels.begin());
        for (glm::u8vec4& p : pixels) p.a = 255;
        return pixels;
    }
    auto byte = [](float v) { return std::uint8_t(v > 0 ? std::min(v, 1.f) * 255 + 0.5f : 0.f); };
    std::ranges::transform(image.rgba32f(), pixels.begin(), [&](const glm::vec4& p) {
        return glm::u8vec4(byte(p.r), byte(p.g), byte(p.b), 255);
    });
    return pixels;
}

void upload(Picture& picture, const Image& image) {
    if (!picture.texture) glGenTextures(1, &picture.texture);
    const std::vector<glm::u8vec4> pixels = pixels_of(image);
    GLint before = 0;
    glGetIntegerv(GL_TEXTURE_BINDING_2D, &before);
    glBindTexture(GL_TEXTURE_2D, picture.texture);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA, image.size().x, image.size().y, 0, GL_RGBA, GL_UNSIGNED_BYTE, pixels.data());
    glBindTexture(GL_TEXTURE_2D, GLuint(before));
    picture.size = image.size();
}

const Image* image_in(const LiveValue* value) {
    const ImagePtr* image = value ? std::get_if<ImagePtr>(&value->value) : nullptr;
    return image && *image && (*image)->size().x > 0 && (*image)->size().y > 0 ? image->get() : nullptr;
}

}  // namespace

bool update_picture(Picture& picture, const LiveValue* value) {
    const Image* image = image_in(value);
    if (!image) return false;
    if (picture.serial != value->serial) upload(picture, *image);
    picture.serial = value->serial;
    return true;
}

bool update_difference(Viewport& view, const LiveValue* a, const LiveValue* b, std::string& why) {
    const Image* first = image_in(a);
    const Image* second = image_in(b);
    why = "There are no two pictures yet.";
    if (!first || !second) return false;
    why = problem_with_comparison(first->size(), second->size());
    if (!why.empty()) return false;
    Difference& d = view.difference;
    if (d.serials != std::pair(a->serial, b->serial) || d.made_with != d.scale)
        upload(d.picture, *difference_image(*first, *second, d.scale));
    d.serials = {a->serial, b->serial};
    d.made_with = d.scale;
    return true;
}

void delete_textures(Editor& editor) {
    auto release = [](Picture& picture) {
        if (picture.texture) glDeleteTextures(1, &picture.texture);
        picture = {};
    };
    std::ranges::for_each(editor.viewport.pictures, release);
    for (auto& [port, picture] : editor.thumbnails) release(picture);
    release(editor.viewport.difference.picture);
}

void draw_thumbnail(Editor& editor, const std::string& node, const NodePorts& ports, float most) {
    for (const PortSpec& port : ports.outputs) {
        const std::string name = node + "." + port.key;
        auto value = editor.live.values.find(name);
        if (value == editor.live.values.end()) continue;
        Picture& picture = editor.thumbnails[name];
        if (!update_picture(picture, &value->second)) continue;
        const float scale = most / float(std::max(picture.size.x, picture.size.y));
        ImGui::Image(reinterpret_cast<ImTextureID>(std::uintptr_t(picture.texture)), {float(picture.size.x) * scale, float(picture.size.y) * scale});
        return;
    }
}

std::string pixel_text(const Image& image, glm::dvec2 at, const Camera* camera) {
    const glm::ivec2 p(glm::floor(at));
    if (p.x < 0 || p.y < 0 || p.x >= image.size().x || p.y >= image.size().y) return {};
    const glm::vec4 c = image.at(p.x, p.y);
    std::string text = fmt::format("({}, {})  {:.3f} {:.3f} {:.3f} {:.3f}", p.x, p.y, c.r, c.g, c.b, c.a);
    if (image.depth.empty() || !camera) return text;
    const float depth = image.depth[std::size_t(p.y) * std::size_t(image.size().x) + std::size_t(p.x)];
    if (!std::isfinite(depth) || depth <= 0) return text;
    const Ray ray = camera->ray(p.x + 0.5, p.y + 0.5, image.size().x, image.size().y);
    const glm::dvec3 world = ray.origin + ray.direction * (depth / glm::dot(ray.direction, camera->forward()));
    return text + fmt::format("  at {:.4g} {:.4g} {:.4g}", world.x, world.y, world.z);
}

}  // namespace voxloom::editor
