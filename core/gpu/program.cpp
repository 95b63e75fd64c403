#include "core/gpu/program.h"

#include <cctype>
#include <map>

#include "core/base/error.h"
#include "core/base/hash.h"

namespace voxloom::gpu {

namespace {

Object compile(GLenum stage, const std::vector<Module>& modules) {
    // #line gives every module a string number of its own.
    std::string text = "#version 450 core\n";
    for (std::size_t i = 0; i < modules.size(); ++i)
        text += fmt::format("#line 1 {}\n{}\n", i, modules[i].text);
    const char* pointer = text.c_str();
    Object shader(glCreateShader(stage), [](GLuint n) { glDeleteShader(n); });
    glShaderSource(shader.name(), 1, &pointer, nullptr);
    glCompileShader(shader.name());
    GLint ok = 0;
    glGetShaderiv(shader.name(), GL_COMPILE_STATUS, &ok);
    if (!ok) {
        GLint length = 0;
        glGetShaderiv(shader.name(), GL_INFO_LOG_LENGTH, &length);
        std::string log(std::size_t(length) + 1, '\0');
        glGetShaderInfoLog(shader.name(), length + 1, &length, log.data());
        log.resize(std::size_t(length));
        fail("a shader does not compile: {}", readable_log(log, modules));
    }
    return shader;
}

ProgramPtr link(const std::vector<Module>& vertex, const std::vector<Module>& fragment) {
    Object v = compile(GL_VERTEX_SHADER, vertex), f = compile(GL_FRAGMENT_SHADER, fragment);
    Object program(glCreateProgram(), [](GLuint n) { glDeleteProgram(n); });
    glAttachShader(program.name(), v.name());
    glAttachShader(program.name(), f.name());
    glLinkProgram(program.name());
    GLint ok = 0;
    glGetProgramiv(program.name(), GL_LINK_STATUS, &ok);
    if (!ok) {
        char log[4096] = {};
        glGetProgramInfoLog(program.name(), sizeof log - 1, nullptr, log);
        fail("a shader does not link: {}", readable_log(log, fragment));
    }
    return std::make_shared<Program>(std::move(program));
}

}  // namespace

std::string readable_log(std::string_view log, const std::vector<Module>& modules) {
    std::string out;
    while (!log.empty()) {
        std::string_view line = log.substr(0, log.find('\n'));
        log.remove_prefix(std::min(log.size(), line.size() + 1));
        if (line.empty()) continue;
        if (!out.empty()) out += "; ";
        // The first "N:M" or "N(M)" with N a module's position.
        std::size_t i = 0;
        while (i < line.size() && !std::isdigit(static_cast<unsigned char>(line[i]))) ++i;
        std::size_t index = 0, j = i;
        while (j < line.size() && std::isdigit(static_cast<unsigned char>(line[j])) && index < 10000)
            index = index * 10 + std::size_t(line[j++] - '0');
        if (j > i && j < line.size() && (line[j] == ':' || line[j] == '(') && index < modules.size()) {
            out += line.substr(0, i);
            out += modules[index].name;
            out += line.substr(j);
        } else {
            out += line;
        }
    }
    return out;
}

ProgramPtr program(const std::vector<Module>& vertex, const std::vector<Module>& fragment) {
    // Only ever touched on the OpenGL thread. Never destroyed: the context goes first.
    static auto& programs = *new std::map<Hash, ProgramPtr>;
    Hasher hasher;
    for (const Module& m : vertex) hasher.text(m.text);
    hasher.text("fragment");
    for (const Module& m : fragment) hasher.text(m.text);
    // A session uses a few dozen combinations; more than this is somebody sweeping through them all.
    if (programs.size() > 256) programs.clear();
    ProgramPtr& p = programs[hasher.finish()];
    if (!p) p = link(vertex, fragment);
    return p;
}

namespace {
GLint where(const Program& p, const char* uniform) { return glGetUniformLocation(p.name(), uniform); }
}  // namespace

void Program::set(const char* u, int v) const { glProgramUniform1i(name(), where(*this, u), v); }
void Program::set(const char* u, float v) const { glProgramUniform1f(name(), where(*this, u), v); }
void Program::set(const char* u, glm::vec2 v) const {
    glProgramUniform2fv(name(), where(*this, u), 1, &v[0]);
}
void Program::set(const char* u, glm::vec3 v) const {
    glProgramUniform3fv(name(), where(*this, u), 1, &v[0]);
}
void Program::set(const char* u, glm::vec4 v) const {
    glProgramUniform4fv(name(), where(*this, u), 1, &v[0]);
}
void Program::set(const char* u, glm::ivec3 v) const {
    glProgramUniform3iv(name(), where(*this, u), 1, &v[0]);
}
void Program::set(const char* u, const glm::mat3& v) const {
    glProgramUniformMatrix3fv(name(), where(*this, u), 1, GL_FALSE, &v[0][0]);
}
void Program::bind(const char* sampler, int unit, const Texture& texture) const {
    GLint location = where(*this, sampler);
    if (location < 0) return;
    glBindTextureUnit(GLuint(unit), texture.name());
    glProgramUniform1i(name(), location, unit);
}

}  // namespace voxloom::gpu
