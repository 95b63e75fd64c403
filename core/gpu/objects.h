// OpenGL objects that own what they name.
//
// They are made and used on the OpenGL thread; they may die on any thread, since their release is
// posted to the one that owns the context.
#pragma once

#include <epoxy/gl.h>

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <string>
#include <string_view>

namespace voxloom::gpu {

// A name and how it is given back.
class Object {
  public:
    using Release = void (*)(GLuint);
    Object() = default;
    Object(GLuint name, Release release) : name_(name), release_(release) {}
    Object(Object&& other) noexcept;
    Object& operator=(Object&& other) noexcept;
    ~Object();
    GLuint name() const { return name_; }
    explicit operator bool() const { return name_ != 0; }

  private:
    GLuint name_ = 0;
    Release release_ = nullptr;
};

// An immutable texture. Dims not used by the target are 1.
struct Texture {
    GLenum target = GL_TEXTURE_3D;
    GLenum format = 0;          // sized internal format
    glm::ivec3 dims{0};
    std::uint64_t bytes = 0;
    Object object;
    GLuint name() const { return object.name(); }
};
using TexturePtr = std::shared_ptr<const Texture>;

// Storage for a texture, clamped to its edge, filtered as asked. Throws Error, naming `what`, when
// it exceeds the driver's limits or memory. [OpenGL thread]
Texture make_texture(GLenum target, GLenum format, glm::ivec3 dims, GLenum filter,
                     std::string_view what);
// Replaces texels [lo, lo+dims). Rows are tightly packed. [OpenGL thread]
void upload(const Texture& texture, glm::ivec3 lo, glm::ivec3 dims, GLenum format, GLenum type,
            const void* texels);

Object make_framebuffer();
Object make_vertex_array();

// Throws Error when OpenGL has reported an error since the last call, naming what was being done.
void check_errors(std::string_view doing);

}  // namespace voxloom::gpu
