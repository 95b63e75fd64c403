#include "core/base/error.h"
#include "plugins/render-slicer/modules.h"

namespace voxloom::slicer {

gpu::Module module(std::string_view name) {
    for (const gpu::Module& m : modules())
        if (m.name == name) return m;
    fail("shader module '{}' is not built in", name);
}

gpu::Module over(const gpu::Module& m, const std::string& prefix) {
    gpu::Module out{m.name + " (" + prefix + ")", m.text};
    for (std::string_view name : {"fetch_voxel", "sample_linear", "reconstruct", "dense_"})
        for (std::size_t at = 0; (at = out.text.find(name, at)) != std::string::npos;) {
            out.text.insert(at, prefix + "_");
            at += prefix.size() + 1 + name.size();
        }
    return out;
}

}  // namespace voxloom::slicer
