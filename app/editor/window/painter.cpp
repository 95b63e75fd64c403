#include "app/editor/window/painter.h"

#include <epoxy/gl.h>

#include <cstddef>
#include <string>

#include "core/base/error.h"

namespace voxloom::editor {

namespace {

const char* const kVertex = R"(#version 330 core
layout(location = 0) in vec2 position;
layout(location = 1) in vec2 texel;
layout(location = 2) in vec4 color;
uniform vec2 scale;
out vec2 at;
out vec4 tint;
void main() {
    at = texel;
    tint = color;
    gl_Position = vec4(position * scale + vec2(-1, 1), 0, 1);
}
)";
const char* const kTextured = R"(#version 330 core
in vec2 at;
in vec4 tint;
uniform sampler2D image;
out vec4 pixel;
void main() { pixel = tint * texture(image, at); }
)";
const char* const kPlain = R"(#version 330 core
in vec4 tint;
out vec4 pixel;
void main() { pixel = tint; }
)";

GLuint compiled(GLenum kind, const char* text) {
    const GLuint shader = glCreateShader(kind);
    glShaderSource(shader, 1, &text, nullptr);
    glCompileShader(shader);
    return shader;
}

GLuint linked(const char* fragment) {
    const GLuint program = glCreateProgram();
    for (const GLuint shader : {compiled(GL_VERTEX_SHADER, kVertex), compiled(GL_FRAGMENT_SHADER, fragment)}) {
        glAttachShader(program, shader);
        glDeleteShader(shader);  // with the program
    }
    glLinkProgram(program);
    GLint done = GL_FALSE;
    glGetProgramiv(program, GL_LINK_STATUS, &done);
    if (done) return program;
    std::string log(1000, ' ');
    GLsizei length = 0;
    glGetProgramInfoLog(program, GLsizei(log.size()), &length, log.data());
    glDeleteProgram(program);
    fail("the window cannot be drawn, as OpenGL refuses a shader ({}); another driver may help", log.substr(0, std::size_t(length)));
}

const void* offset(std::size_t bytes) { return reinterpret_cast<const void*>(bytes); }

}  // namespace

Painter::Painter() : textured_(linked(kTextured)), plain_(linked(kPlain)) {
    glGenVertexArrays(1, &array_);
    glGenBuffers(1, &vertices_);
    glGenBuffers(1, &indices_);
    glBindVertexArray(array_);
    glBindBuffer(GL_ARRAY_BUFFER, vertices_);
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, indices_);
    for (GLuint i = 0; i < 3; ++i) glEnableVertexAttribArray(i);
    glVertexAttribPointer(0, 2, GL_FLOAT, GL_FALSE, sizeof(DrawnVertex), offset(offsetof(DrawnVertex, position)));
    glVertexAttribPointer(1, 2, GL_FLOAT, GL_FALSE, sizeof(DrawnVertex), offset(offsetof(DrawnVertex, texel)));
    glVertexAttribPointer(2, 4, GL_UNSIGNED_BYTE, GL_TRUE, sizeof(DrawnVertex), offset(offsetof(DrawnVertex, color)));
    glBindVertexArray(0);
}

Painter::~Painter() {
    glDeleteVertexArrays(1, &array_);
    glDeleteBuffers(1, &vertices_);
    glDeleteBuffers(1, &indices_);
    glDeleteProgram(textured_);
    glDeleteProgram(plain_);
}

void Painter::load(const std::vector<DrawnList>& lists, const Letters& letters, glm::ivec2 size, glm::vec2 scale) {
    size_ = size;
    scale_ = scale;
    batches_ = batches_of(lists, letters);
    vertex_of_.clear(), index_of_.clear();
    std::uint32_t vertices = 0, indices = 0;
    for (const DrawnList& list : lists) {
        vertex_of_.push_back(vertices), index_of_.push_back(indices);
        vertices += std::uint32_t(list.vertices.size()), indices += std::uint32_t(list.indices.size());
    }
    glBindVertexArray(array_);
    glBindBuffer(GL_ARRAY_BUFFER, vertices_);
    glBufferData(GL_ARRAY_BUFFER, GLsizeiptr(vertices * sizeof(DrawnVertex)), nullptr, GL_STREAM_DRAW);
    glBufferData(GL_ELEMENT_ARRAY_BUFFER, GLsizeiptr(indices * sizeof(std::uint16_t)), nullptr, GL_STREAM_DRAW);
    for (std::size_t i = 0; i < lists.size(); ++i) {
        glBufferSubData(GL_ARRAY_BUFFER, GLintptr(vertex_of_[i] * sizeof(DrawnVertex)), GLsizeiptr(lists[i].vertices.size() * sizeof(DrawnVertex)),
                        lists[i].vertices.data());
        glBufferSubData(GL_ELEMENT_ARRAY_BUFFER, GLintptr(index_of_[i] * sizeof(std::uint16_t)),
                        GLsizeiptr(lists[i].indices.size() * sizeof(std::uint16_t)), lists[i].indices.data());
    }
    for (const GLuint program : {textured_, plain_}) {
        glUseProgram(program);
        glUniform2f(glGetUniformLocation(program, "scale"), 2 * scale.x / float(size.x), -2 * scale.y / float(size.y));
    }
    glBindVertexArray(0);
}

void Painter::draw(const Rect& part, glm::vec3 background) const {
    auto cut = [this](const Rect& r) { glScissor(r.lo.x, size_.y - r.hi.y, r.hi.x - r.lo.x, r.hi.y - r.lo.y); };
    glViewport(0, 0, size_.x, size_.y);
    for (const GLenum off : {GL_CULL_FACE, GL_DEPTH_TEST, GL_STENCIL_TEST, GL_BLEND}) glDisable(off);
    glEnable(GL_SCISSOR_TEST);
    cut(part);
    glClearColor(background.r, background.g, background.b, 1);
    glClear(GL_COLOR_BUFFER_BIT);
    glBlendEquation(GL_FUNC_ADD);
    glBlendFuncSeparate(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA, GL_ONE, GL_ONE_MINUS_SRC_ALPHA);
    glActiveTexture(GL_TEXTURE0);
    glBindSampler(0, 0);
    glBindVertexArray(array_);
    for (const Batch& batch : batches_) {
        const glm::ivec2 lo(glm::max(glm::vec2(part.lo), glm::vec2(batch.clip) * scale_));
        const glm::ivec2 hi(glm::min(glm::vec2(part.hi), glm::vec2(batch.clip.z, batch.clip.w) * scale_));
        if (lo.x >= hi.x || lo.y >= hi.y) continue;
        cut({lo, hi});
        glUseProgram(batch.kind == Batch::Kind::textured ? textured_ : plain_);
        batch.kind == Batch::Kind::opaque ? glDisable(GL_BLEND) : glEnable(GL_BLEND);
        if (batch.kind == Batch::Kind::textured) glBindTexture(GL_TEXTURE_2D, GLuint(batch.texture));
        glDrawElementsBaseVertex(GL_TRIANGLES, GLsizei(batch.count), GL_UNSIGNED_SHORT,
                                 offset((index_of_[batch.list] + batch.first_index) * sizeof(std::uint16_t)),
                                 GLint(vertex_of_[batch.list] + batch.first_vertex));
    }
    glBindVertexArray(0);
    glDisable(GL_SCISSOR_TEST);
}

}  // namespace voxloom::editor
