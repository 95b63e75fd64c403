// The GLSL modules of glsl/, by file name without its ending; embedded when the plugin is built.
#pragma once

#include <string>
#include <string_view>

#include "core/gpu/program.h"

namespace voxloom::slicer {

const std::vector<gpu::Module>& modules();
gpu::Module module(std::string_view name);
// The same functions over another texture: fetch_voxel becomes PREFIX_fetch_voxel.
gpu::Module over(const gpu::Module& module, const std::string& prefix);
// A module with one word in place of another.
gpu::Module with(const gpu::Module& module, std::string_view word, const std::string& text);

}  // namespace voxloom::slicer
