// Any text given as the description of raw voxels is refused with an Error, or describes a volume
// whose size is known to fit.
#include <string_view>

#include "core/base/error.h"
#include "plugins/readers/raw_sidecar.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    try {
        voxloom::RawSidecar raw = voxloom::parse_raw_sidecar(
            {reinterpret_cast<const char*>(data), size}, "fuzz.raw.yaml");
        if (raw.steps < 1 || raw.desc.components < 1 || raw.desc.components > 4) __builtin_trap();
        const auto limit = std::uint64_t(1) << 63;
        if (raw.desc.dense_bytes() >= limit / std::uint64_t(raw.steps)) __builtin_trap();
        for (int a = 0; a < 3; ++a)
            if (!(raw.desc.spacing()[a] > 0)) __builtin_trap();
    } catch (const voxloom::Error&) {
    }
    return 0;
}
