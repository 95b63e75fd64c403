// Nothing is compressed: what the others are measured against.
#include <cstring>

#include "plugins/codec-baseline/codec.h"

namespace voxloom::baseline {

namespace {

Bytes encode(const Form&, const Setting&, std::span<const std::byte> voxels) { return {voxels.begin(), voxels.end()}; }

void decode(const Form&, const Setting&, std::span<const std::byte> bytes, std::span<std::byte> voxels) {
    if (bytes.size() != voxels.size()) fail("it has {} bytes instead of {}", bytes.size(), voxels.size());
    if (!bytes.empty()) std::memcpy(voxels.data(), bytes.data(), bytes.size());
}

}  // namespace

const Codec& raw_codec() {
    static const Codec codec = {
        .name = "raw",
        .title = "Uncompressed",
        .library = "memcpy",
        .doc = "Cuts a volume into bricks without compressing them.",
        .method = "Bricks are copied as they are.",
        .reference = "",
        .keywords = {"uncompressed", "copy"},
        .targets = {Target::lossless},
        .params = {},
        .options = [](const Params&) { return Setting::Options{}; },
        .problem = [](const VolumeDesc&) { return std::string(); },
        .direct = [](const Form&, Target, double) { return Setting{}; },
        .scale = nullptr,
        .encode = encode,
        .decode = decode,
    };
    return codec;
}

}  // namespace voxloom::baseline
