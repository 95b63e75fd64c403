#include "core/gpu/program.h"

#include <algorithm>
#include <cctype>
#include <map>

#include "core/base/error.h"
#include "core/base/hash.h"

namespace voxloom::gpu {

namespace {

Object compile(GLenum stage, const std::vector<Module>& modules) {
    std::string text = "#version 450 core\n";
    for (const Module& m : modules) text += m.text + "\n";
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
        // The first "S:L" or "S(L)": string and line.
        auto number = [&](std::size_t& i) {
            std::size_t n = 0;
            while (i < line.size() && std::isdigit(static_cast<unsigned char>(line[i])) && n < 1000000)
                n = n * 10 + std::size_t(line[i++] - '0');
            return n;
        };
        const std::size_t begin = std::min(line.find_first_of("0123456789"), line.size());
        std::size_t at = begin;
        number(at);
        std::size_t in_text = 0;
        if (at < line.size() && (line[at] == ':' || line[at] == '(')) in_text = number(++at);
        // Lines count from 1; the first one is #version.
        const Module* module = nullptr;
        std::size_t start = 2;
        for (const Module& m : modules) {
            const std::size_t lines = std::size_t(std::ranges::count(m.text, '\n')) + 1;
            if (in_text >= start && in_text < start + lines) {
                module = &m;
                break;
            }
            start += lines;
        }
        if (module)
            out += fmt::format("{}{}:{}{}", line.substr(0, begin), module->name, in_text - start + 1,
                               line.substr(at));
        else
            out += line;
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
