// Any bytes as a vector-quantised file, and as what stands behind an intact head: refused with an Error, or decoded
// without a step outside.
#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/base/error.h"
#include "fuzz/mended_file.h"
#include "plugins/codec-vq/vq_bricks.h"

namespace {

using namespace voxloom;
using voxloom::fuzz::as_file_and_mended;
using namespace voxloom::vq;

constexpr std::uint64_t kMostBytes = 1 << 22;  // of a brick: honest files have larger ones, which only take longer

void decode_some(const VqBricks& bricks) {
    const std::size_t count = std::min<std::size_t>(bricks.index().bricks.places.size(), 8);
    for (std::size_t i = 0; i < count; ++i) {
        const BrickId id = brick_at(bricks.desc(), i);
        if (bricks.family_bytes(id) > kMostBytes) continue;
        try {
            bricks.refine(id, nullptr, {});
        } catch (const Error&) {
        }
    }
}

// A brick's bytes alone, with codebooks of one codeword. The first bytes choose the form.
void decode_one(std::span<const std::byte> in) {
    if (in.size() < 2) return;
    const auto choice = [&](std::size_t i) { return std::size_t(in[i]); };
    BrickForm form;
    form.dims = {1 + std::int64_t(choice(0) % 8), 1 + std::int64_t(choice(0) / 8 % 8), 1 + std::int64_t(choice(0) / 64 * 3)};
    form.type = ScalarType(choice(1) % kScalarTypes);
    form.components = 1 + int(choice(1) / 8 % 4);
    const std::vector<Codebooks> books(std::size_t(form.components), zero_codebooks());
    std::vector<std::byte> out(form.values() * bytes_of(form.type));
    try {
        decode_brick(form, books, in.subspan(2), out);
    } catch (const Error&) {
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto in = std::as_bytes(std::span(data, size));
    decode_one(in);
    as_file_and_mended(in, [](std::span<const std::byte> file) { decode_some(*open_bytes(file, nullptr, "fuzzed")); });
    return 0;
}
