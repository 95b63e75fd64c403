// Any bytes as a wavelet file, and as what stands behind an intact head: refused with an Error, or decoded
// without a step outside.
#include <cstdint>
#include <vector>

#include "core/base/error.h"
#include "core/data/brick_cache.h"
#include "fuzz/mended_file.h"
#include "plugins/codec-wavelet/exact_layer.h"
#include "plugins/codec-wavelet/file_format.h"
#include "plugins/codec-wavelet/mask_layer.h"

namespace {

using namespace voxloom;
using voxloom::fuzz::as_file_and_mended;
using namespace voxloom::wavelet;

void decode_some(const BricksPtr& bricks) {
    const BricksDesc& desc = bricks->desc();
    if (desc.volume.voxels() == 0) return;
    for (int level = 0; level < int(desc.levels.size()) && level < 4; ++level) {
        const Index3 dims = desc.levels[std::size_t(level)].dims;
        const Box box{glm::max(dims - Index3(20), Index3(0)), dims};
        BrickCache cache(64 << 20);
        try {
            Buffer out(box.voxels() * desc.volume.voxel_bytes());
            read_region(bricks, level, box, out.bytes(), cache);
        } catch (const Error&) {
        }
    }
}

// A coder's bytes alone: where checksums would hide most of it. The first byte chooses the coder and the size.
void decode_details(std::span<const std::byte> in) {
    if (in.empty()) return;
    const auto choice = std::uint8_t(in[0]);
    Details d;
    d.shape = {{1 + (choice >> 2 & 7), 4 + (choice >> 5), 7}, glm::bvec3(true)};
    d.finest = choice & 128;
    std::vector<std::int32_t> q(d.shape.voxels()), low(d.shape.voxels(), 1000);
    d.q = q.data();
    d.low = low.data();
    try {
        make_coder(CoderKind(choice % kCoderKinds))->decode(in.subspan(1), d);
    } catch (const Error&) {
    }
}

// Masks, distances and patches alone. The first byte chooses the type.
void decode_layers(std::span<const std::byte> in) {
    if (in.empty()) return;
    const auto type = ScalarType(std::uint8_t(in[0]) % kScalarTypes);
    constexpr std::size_t count = 5 * 4 * 3;
    std::vector<std::byte> values(count * bytes_of(type));
    const auto refused = [](auto&& decode) {
        try {
            decode();
        } catch (const Error&) {
        }
    };
    refused([&] { decode_mask(in.subspan(1), {5, 4, 3}); });
    refused([&] { decode_distances(type, in.subspan(1), values.data(), count); });
    refused([&] { decode_patches(type, in.subspan(1), values.data(), count); });
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto in = std::as_bytes(std::span(data, size));
    decode_details(in);
    decode_layers(in);
    as_file_and_mended(in, [](std::span<const std::byte> file) { decode_some(open_bytes(file, nullptr, "fuzzed")); });
    return 0;
}
