// The headers of NRRD, MetaImage and NIfTI that are looked at before ITK sees them.
#include <string_view>

#include "core/base/error.h"
#include "plugins/readers/text_header.h"

using namespace voxloom;

namespace {
template <class F>
void survive(F&& f) {
    try {
        f();
    } catch (const Error&) {
    }
}
}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string_view head(reinterpret_cast<const char*>(data), size);
    const std::filesystem::path path = "/nowhere/fuzz";
    survive([&] { nrrd_layout(parse_nrrd_header(head, path), path, 3, 1000, 2); });
    survive([&] { meta_layout(parse_meta_header(head, path), path); });
    survive([&] { nifti_layout(head, path, false); });
    survive([&] { nifti_layout(head, path, true); });
    return 0;
}
