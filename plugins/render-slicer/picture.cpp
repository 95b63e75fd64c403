#include "plugins/render-slicer/picture.h"

namespace voxloom::slicer {

Target::Target(glm::ivec2 pixels)
    : size(pixels),
      color(gpu::make_texture(GL_TEXTURE_2D, GL_RGBA32F, {pixels, 1}, GL_NEAREST, "the picture")),
      samples(gpu::make_texture(GL_TEXTURE_2D, GL_R32F, {pixels, 1}, GL_NEAREST, "the picture")),
      framebuffer(gpu::make_framebuffer()), vertices(gpu::make_vertex_array()) {
    glNamedFramebufferTexture(framebuffer.name(), GL_COLOR_ATTACHMENT0, color.name(), 0);
    glNamedFramebufferTexture(framebuffer.name(), GL_COLOR_ATTACHMENT1, samples.name(), 0);
    const GLenum buffers[] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
    glNamedFramebufferDrawBuffers(framebuffer.name(), 2, buffers);
}

const Target& target_of(glm::ivec2 size) {
    static Target* last = nullptr;
    if (!last || last->size != size) {
        delete last;
        last = nullptr;
        last = new Target(size);
    }
    return *last;
}

std::shared_ptr<Image> read_back(const Target& target) {
    auto image = std::make_shared<Image>(target.size, Image::Format::rgba32f);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, target.framebuffer.name());
    glReadBuffer(GL_COLOR_ATTACHMENT0);
    glReadPixels(0, 0, target.size.x, target.size.y, GL_RGBA, GL_FLOAT, image->bytes().data());
    return image;
}

}  // namespace voxloom::slicer
