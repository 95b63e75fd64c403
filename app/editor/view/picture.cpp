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

void upload(Editor& editor, Picture& picture, const Image& image) { upload(editor, picture, image.size(), pixels_of(image)); }

const Image* image_in(const LiveValue* value) {
    const ImagePtr* image = value ? std::get_if<ImagePtr>(&value->value) : nullptr;
    return image && *image && (*image)->size().x > 0 && (*image)->size().y > 0 ? image->get() : nullptr;
}

}  // namespace

void upload(Editor& editor, Picture& picture, glm::ivec2 size, const std::vector<glm::u8vec4>& pixels) {
    // Under another name than before, and than that of any that the last frame drew: what draws it is told from
    // what drew the one before.
    if (picture.texture) editor.replaced_textures.push_back(picture.texture);
    glGenTextures(1, &picture.texture);
    GLint before = 0;
    glGetIntegerv(GL_TEXTURE_BINDING_2D, &before);
    glBindTexture(GL_TEXTURE_2D, picture.texture);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA, size.x, size.y, 0, GL_RGBA, GL_UNSIGNED_BYTE, pixels.data());
    glBindTexture(GL_TEXTURE_2D, GLuint(before));
    picture.size = size;
}

std::vector<glm::u8vec4> pixels_of(const Image& image) {
    std::vector<glm::u8vec4> pixels(std::size_t(image.size().x) * std::size_t(image.size().y));
    if (image.format() == Image::Format::rgba8) {
        std::ranges::copy(image.rgba8(), pixels.begin());
        for (glm::u8vec4& p : pixels) p.a = 255;
        return pixels;
    }
    std::ranges::transform(image.rgba32f(), pixels.begin(), screen_pixel);
    return pixels;
}

bool update_picture(Editor& editor, Picture& picture, const LiveValue* value) {
    const Image* image = image_in(value);
    if (!image) return false;
    if (picture.serial != value->serial) upload(editor, picture, *image);
    picture.serial = value->serial;
    return true;
}

bool update_difference(Editor& editor, const LiveValue* a, const LiveValue* b, std::string& why) {
    const Image* first = image_in(a);
    const Image* second = image_in(b);
    why = "There are no two pictures yet.";
    if (!first || !second) return false;
    why = problem_with_comparison(first->size(), second->size());
    if (!why.empty()) return false;
    Difference& d = editor.viewport.difference;
    const ImagePtr x = std::get<ImagePtr>(a->value), y = std::get<ImagePtr>(b->value);
    const double scale = d.scale;
    const auto found = editor.differences.find({x, y, scale}, [x, y, scale](const std::stop_token& stop) -> ImagePtr {
        return difference_image(*x, *y, scale, stop);
    });
    if (found.made && found.made != d.shown) {
        upload(editor, d.picture, *found.made);
        d.shown = found.made;
    }
    why = found.pending() ? "Computing…" : found.problem;
    return d.shown != nullptr && (found.made || found.pending());
}

void delete_replaced_textures(Editor& editor) {
    glDeleteTextures(GLsizei(editor.replaced_textures.size()), editor.replaced_textures.data());
    editor.replaced_textures.clear();
}

void delete_textures(Editor& editor) {
    delete_replaced_textures(editor);
    auto release = [](Picture& picture) {
        if (picture.texture) glDeleteTextures(1, &picture.texture);
        picture = {};
    };
    std::ranges::for_each(editor.viewport.pictures, release);
    for (auto& [port, small] : editor.thumbnails) release(small.picture);
    release(editor.viewport.difference.picture);
    release(editor.transfer.picture);
}

SmallPicture* small_picture(Editor& editor, const std::string& node, const NodePorts& ports) {
    for (const PortSpec& port : ports.outputs) {
        const std::string name = node + "." + port.key;
        Background<Thumbnail>::Found found;
        if (auto value = editor.live.values.find(name); value != editor.live.values.end()) {
            const ImagePtr* image = std::get_if<ImagePtr>(&value->second.value);
            if (!image) continue;
            // While something moves the last whole picture stays.
            if (value->second.fresh)
                found = editor.small_pictures.find({*image}, [image = *image](const std::stop_token&) { return thumbnail_of(*image); });
        } else if (auto dense = editor.live.volumes.find(name); dense != editor.live.volumes.end()) {
            if (const VolumePtr volume = dense->second.lock())
                found = editor.small_pictures.find({volume}, [volume](const std::stop_token& stop) { return thumbnail_of(*volume, stop); });
        } else if (auto compressed = editor.live.bricks.find(name); compressed != editor.live.bricks.end()) {
            if (const BricksPtr bricks = compressed->second.lock())
                found = editor.small_pictures.find({bricks}, [bricks](const std::stop_token& stop) { return thumbnail_of(bricks, BrickCache::global(), stop); });
        } else {
            continue;
        }
        SmallPicture& small = editor.thumbnails[name];
        if (found.made && found.made != small.thumbnail && found.made->size.x > 0) {
            upload(editor, small.picture, found.made->size, found.made->pixels);
            small.thumbnail = found.made;
        }
        if (!found.pending()) small.problem = found.problem;
        return small.thumbnail || !small.problem.empty() ? &small : nullptr;
    }
    return nullptr;
}

std::vector<std::string> pixel_texts(const Image& image, glm::dvec2 at, const Camera* camera) {
    const glm::ivec2 p(glm::floor(at));
    if (p.x < 0 || p.y < 0 || p.x >= image.size().x || p.y >= image.size().y) return {};
    const glm::vec4 c = image.at(p.x, p.y);
    std::vector<std::string> texts{fmt::format("({}, {})", p.x, p.y), fmt::format("{:.3f} {:.3f} {:.3f} {:.3f}", c.r, c.g, c.b, c.a)};
    if (image.depth.empty() || !camera) return texts;
    const float depth = image.depth[std::size_t(p.y) * std::size_t(image.size().x) + std::size_t(p.x)];
    if (!std::isfinite(depth) || depth <= 0) return texts;
    const Ray ray = camera->ray(p.x + 0.5, p.y + 0.5, image.size().x, image.size().y);
    const glm::dvec3 world = ray.origin + ray.direction * (depth / glm::dot(ray.direction, camera->forward()));
    texts.push_back(fmt::format("at {:.4g} {:.4g} {:.4g}", world.x, world.y, world.z));
    return texts;
}

}  // namespace voxloom::editor
