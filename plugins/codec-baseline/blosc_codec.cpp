// Blosc: bytes or bits of voxels are sorted by significance, then packed by Zstandard or LZ4.
#include <blosc.h>

#include <algorithm>

#include "plugins/codec-baseline/codec.h"

namespace voxloom::baseline {

namespace {

const std::vector<std::string> kCoders = {"zstd", "lz4"};
const std::vector<std::string> kShuffles = {"bits", "bytes", "none"};

Setting::Options options_of(const Params& params) {
    const auto chosen = [&](std::string_view key, const std::vector<std::string>& choices) {
        return int(std::ranges::find(choices, params.text(key)) - choices.begin());
    };
    return {int(params.integer("level")), chosen("coder", kCoders), chosen("shuffle", kShuffles)};
}

Bytes encode(const Form& form, const Setting& setting, std::span<const std::byte> voxels) {
    constexpr int shuffles[] = {BLOSC_BITSHUFFLE, BLOSC_SHUFFLE, BLOSC_NOSHUFFLE};
    Bytes bytes(voxels.size() + BLOSC_MAX_OVERHEAD);
    const int size = blosc_compress_ctx(setting.options.effort, shuffles[setting.options.shuffle], bytes_of(form.type),
                                        voxels.size(), voxels.data(), bytes.data(), bytes.size(),
                                        kCoders[std::size_t(setting.options.coder)].c_str(), 0, 1);
    if (size <= 0) fail("blosc could not compress a brick (its code is {})", size);
    bytes.resize(std::size_t(size));
    return bytes;
}

void decode(const Form&, const Setting&, std::span<const std::byte> bytes, std::span<std::byte> voxels) {
    std::size_t size = 0;
    if (bytes.size() < BLOSC_MIN_HEADER_LENGTH || blosc_cbuffer_validate(bytes.data(), bytes.size(), &size) != 0 ||
        size != voxels.size())
        fail("its blosc header is not that of such a brick");
    const int got = blosc_decompress_ctx(bytes.data(), voxels.data(), voxels.size(), 1);
    if (got < 0 || std::size_t(got) != voxels.size()) fail("blosc could not decompress it (its code is {})", got);
}

}  // namespace

const Codec& blosc_codec() {
    static const Codec codec = {
        .name = "blosc",
        .title = "Blosc",
        .library = "blosc " BLOSC_VERSION_STRING,
        .doc = "Compresses bricks without loss by shuffling their bits and packing them with Zstandard or LZ4.",
        .method = "The bits (or bytes) of a brick's voxels are sorted by significance, so that those that seldom change "
                  "stand together, and then packed by Zstandard or LZ4 in blocks that fit the cache. It knows nothing of "
                  "space: noise stays. NaN, infinities and every other bit come back.",
        .reference = "Alted, Why modern CPUs are starving and what can be done about it, 2010; blosc.org.",
        .keywords = {"zstd", "lz4", "bitshuffle"},
        .targets = {Target::lossless},
        .params = {param::choice("coder", kCoders, "zstd", "What packs the shuffled bytes: zstd is smaller, lz4 faster."),
                   param::choice("shuffle", kShuffles, "bits", "What is sorted by significance before."),
                   param::integer("level", 5, "Effort: 9 is the smallest and slowest, 0 only copies.").range(0, 9).slider(1, 9)},
        .options = options_of,
        .problem = [](const VolumeDesc&) { return std::string(); },
        .direct = [](const Form&, Target, double) { return Setting{}; },
        .scale = nullptr,
        .encode = encode,
        .decode = decode,
    };
    return codec;
}

}  // namespace voxloom::baseline
