// Any bytes as a brick file, and as what stands behind an intact head: refused with an Error, or decoded without a
// step outside. CharLS may not come back from what nobody encoded, so its bricks are not decoded.
#include <algorithm>
#include <cstdint>
#include <vector>

#include "fuzz/mended_file.h"
#include "plugins/codec-baseline/flat_bricks.h"

namespace {

using namespace voxloom;
using voxloom::fuzz::as_file_and_mended;
using namespace voxloom::baseline;

constexpr std::uint64_t kMostBytes = 1 << 22;  // of a brick: honest files have larger ones, which only take longer

void decode_some(const FlatBricks& bricks) {
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

// A brick's bytes alone. The first bytes choose the codec, its setting and the form.
void decode_one(std::span<const std::byte> in) {
    if (in.size() < 4) return;
    const auto choice = [&](std::size_t i) { return std::size_t(in[i]); };
    const Codec& codec = *codecs()[choice(0) % codecs().size()];
    if (codec.name == "jpegls") return;
    Form form;
    form.dims = {1 + std::int64_t(choice(1) % 16), 1 + std::int64_t(choice(1) / 16), 1 + std::int64_t(choice(2) % 8)};
    form.type = ScalarType(choice(2) / 8 % kScalarTypes);
    form.components = 1 + int(choice(3) % 4);
    form.range = {0, double((1 << (1 + choice(3) / 4 % 7)) - 1)};
    Setting setting;
    setting.mode = std::uint8_t(choice(3) / 32 % 4);
    setting.amount = 1 + double(choice(0) / 8);
    std::vector<std::byte> out(form.bytes());
    try {
        decode_brick(codec, form, setting, in.subspan(4), out);
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
