// Shader programs put together from small GLSL modules.
//
// A module is a piece of GLSL with a name. A shader is a list of modules, one behind the other, so a
// module may call what stands before it. Messages of the compiler name the module and its line.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/gpu/objects.h"

namespace voxloom::gpu {

struct Module {
    std::string name;  // "compositing-over"
    std::string text;
};

class Program {
  public:
    explicit Program(Object object) : object_(std::move(object)) {}
    GLuint name() const { return object_.name(); }
    // Setting what the shader does not use is no error: modules take what they need.
    void set(const char* uniform, int v) const;
    void set(const char* uniform, float v) const;
    void set(const char* uniform, glm::vec2 v) const;
    void set(const char* uniform, glm::vec3 v) const;
    void set(const char* uniform, glm::vec4 v) const;
    void set(const char* uniform, glm::ivec3 v) const;
    void set(const char* uniform, const glm::mat3& v) const;
    // Puts a texture on a unit and names the unit to the sampler.
    void bind(const char* sampler, int unit, const Texture& texture) const;

  private:
    Object object_;
};
using ProgramPtr = std::shared_ptr<const Program>;

// Compiles, links and keeps programs: the same modules give the same program again.
// Throws Error with module, line and the compiler's words. [OpenGL thread]
ProgramPtr program(const std::vector<Module>& vertex, const std::vector<Module>& fragment);

// A compiler's log with module and line in place of the line of the whole text, in which the modules
// stand one behind the other after #version. (Drivers differ in what they make of #line.)
std::string readable_log(std::string_view log, const std::vector<Module>& modules);

}  // namespace voxloom::gpu
