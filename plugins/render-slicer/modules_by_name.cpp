#include "core/base/error.h"
#include "plugins/render-slicer/modules.h"

namespace voxloom::slicer {

gpu::Module module(std::string_view name) {
    for (const gpu::Module& m : modules())
        if (m.name == name) return m;
    fail("shader module '{}' is not built in", name);
}

gpu::Module with(const gpu::Module& m, std::string_view word, const std::string& text) {
    gpu::Module out{m.name + " (" + text + ")", m.text};
    for (std::size_t at = 0; (at = out.text.find(word, at)) != std::string::npos; at += text.size())
        out.text.replace(at, word.size(), text);
    return out;
}

gpu::Module over(const gpu::Module& m, const std::string& prefix) {
    gpu::Module out = m;
    for (const char* name : {"fetch_voxel", "sample_linear", "reconstruct", "dense_"})
        out.text = with(out, name, prefix + "_" + name).text;
    out.name = m.name + " (" + prefix + ")";
    return out;
}

}  // namespace voxloom::slicer
