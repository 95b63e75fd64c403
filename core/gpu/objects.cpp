#include "core/gpu/objects.h"

#include "core/base/error.h"
#include "core/base/text.h"
#include "core/base/types.h"
#include "core/gpu/thread.h"

namespace voxloom::gpu {

namespace {

int texel_bytes(GLenum format) {
    switch (format) {
        case GL_R8: case GL_R8I: case GL_R8UI: return 1;
        case GL_R16: case GL_RG8: case GL_R16F: return 2;
        case GL_RGBA8: case GL_RG16: case GL_R32F: case GL_RGBA8_SNORM: return 4;
        case GL_RGBA16: case GL_RGBA16F: case GL_RGBA16_SNORM: case GL_RG32F: return 8;
        default: return 16;
    }
}

}  // namespace

Object::Object(Object&& other) noexcept : name_(other.name_), release_(other.release_) {
    other.name_ = 0;
}

Object& Object::operator=(Object&& other) noexcept {
    std::swap(name_, other.name_);
    std::swap(release_, other.release_);
    return *this;
}

Object::~Object() {
    if (name_ == 0) return;
    if (on_thread())
        release_(name_);
    else
        post([release = release_, name = name_] { release(name); });
}

Texture make_texture(GLenum target, GLenum format, glm::ivec3 dims, GLenum filter,
                     std::string_view what) {
    GLint limit = 0;
    glGetIntegerv(target == GL_TEXTURE_3D ? GL_MAX_3D_TEXTURE_SIZE : GL_MAX_TEXTURE_SIZE, &limit);
    if (dims.x > limit || dims.y > limit || dims.z > limit)
        fail("{} needs a texture of {} x {} x {}, but this OpenGL driver ends at {} a side; use a "
             "smaller or subsampled volume", what, dims.x, dims.y, dims.z, limit);
    Texture t;
    t.target = target;
    t.format = format;
    t.dims = dims;
    t.bytes = checked_product(Index3(dims), std::uint64_t(texel_bytes(format)), what);
    GLuint name = 0;
    glCreateTextures(target, 1, &name);
    t.object = Object(name, [](GLuint n) { glDeleteTextures(1, &n); });
    while (glGetError() != GL_NO_ERROR) {}
    if (target == GL_TEXTURE_3D)
        glTextureStorage3D(name, 1, format, dims.x, dims.y, dims.z);
    else if (target == GL_TEXTURE_2D)
        glTextureStorage2D(name, 1, format, dims.x, dims.y);
    else
        glTextureStorage1D(name, 1, format, dims.x);
    if (glGetError() != GL_NO_ERROR)
        fail("{}: the OpenGL driver has no memory for a texture of {} ({} x {} x {}); use a smaller "
             "or subsampled volume", what, human_bytes(double(t.bytes)), dims.x, dims.y, dims.z);
    glTextureParameteri(name, GL_TEXTURE_MIN_FILTER, GLint(filter));
    glTextureParameteri(name, GL_TEXTURE_MAG_FILTER, GLint(filter));
    for (GLenum wrap : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T, GL_TEXTURE_WRAP_R})
        glTextureParameteri(name, wrap, GL_CLAMP_TO_EDGE);
    return t;
}

void upload(const Texture& t, glm::ivec3 lo, glm::ivec3 dims, GLenum format, GLenum type,
            const void* texels) {
    if (t.target == GL_TEXTURE_3D)
        glTextureSubImage3D(t.name(), 0, lo.x, lo.y, lo.z, dims.x, dims.y, dims.z, format, type, texels);
    else if (t.target == GL_TEXTURE_2D)
        glTextureSubImage2D(t.name(), 0, lo.x, lo.y, dims.x, dims.y, format, type, texels);
    else
        glTextureSubImage1D(t.name(), 0, lo.x, dims.x, format, type, texels);
}

Object make_framebuffer() {
    GLuint name = 0;
    glCreateFramebuffers(1, &name);
    return {name, [](GLuint n) { glDeleteFramebuffers(1, &n); }};
}

Object make_vertex_array() {
    GLuint name = 0;
    glCreateVertexArrays(1, &name);
    return {name, [](GLuint n) { glDeleteVertexArrays(1, &n); }};
}

void check_errors(std::string_view doing) {
    GLenum error = glGetError();
    if (error == GL_NO_ERROR) return;
    while (glGetError() != GL_NO_ERROR) {}
    if (error == GL_OUT_OF_MEMORY)
        fail("OpenGL ran out of memory while {}; use a smaller volume or picture", doing);
    fail("OpenGL reported error 0x{:04x} while {} on {}; this is a fault of voxloom or of the driver",
         unsigned(error), doing, context_info().renderer);
}

}  // namespace voxloom::gpu
