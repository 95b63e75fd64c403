// The GLSL modules of glsl/, by file name without its ending; embedded when the plugin is built.
#pragma once

#include "core/gpu/program.h"

namespace voxloom::slicer {

const std::vector<gpu::Module>& modules();

}  // namespace voxloom::slicer
