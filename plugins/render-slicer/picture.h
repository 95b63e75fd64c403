// Where pictures are drawn, and how they come back. Used on the OpenGL thread alone.
#pragma once

#include <memory>

#include "core/data/image.h"
#include "core/gpu/objects.h"

namespace voxloom::slicer {

// A picture and, for each of its pixels, one more number.
struct Target {
    explicit Target(glm::ivec2 pixels);
    glm::ivec2 size;
    gpu::Texture color, samples;
    gpu::Object framebuffer, vertices;
};
// A target of the size last asked for is kept.
const Target& target_of(glm::ivec2 size);

std::shared_ptr<Image> read_back(const Target& target);

}  // namespace voxloom::slicer
