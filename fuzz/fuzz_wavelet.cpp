// Any bytes as a wavelet file, and as what stands behind an intact head: refused with an Error, or decoded
// without a step outside.
#include <cstdint>
#include <cstring>
#include <vector>

#include "core/base/error.h"
#include "core/base/hash.h"
#include "core/data/brick_cache.h"
#include "plugins/codec-wavelet/file_format.h"

namespace {

using namespace voxloom;
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

// The same checksums an honest writer would have put in, so that the fuzzer gets past them.
void mend_checksum(std::vector<std::byte>& file) {
    constexpr std::size_t preamble = 40;
    if (file.size() < preamble) return;
    std::uint64_t head = 0;
    std::memcpy(&head, file.data() + 16, 8);
    if (head > file.size() - preamble) {
        head = file.size() - preamble;
        std::memcpy(file.data() + 16, &head, 8);
    }
    const std::uint64_t payload = file.size() - preamble - head;
    std::memcpy(file.data() + 24, &payload, 8);
    Hasher hasher;
    hasher.bytes(std::span(file).first(32));
    hasher.bytes(std::span(file).subspan(preamble, std::size_t(head)));
    const std::uint64_t hash = hasher.finish().lo;
    std::memcpy(file.data() + 32, &hash, 8);
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

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto* first = reinterpret_cast<const std::byte*>(data);
    decode_details({first, size});
    std::vector<std::byte> file(first, first + size);
    for (int mended = 0; mended < 2; ++mended) {
        if (mended) mend_checksum(file);
        try {
            decode_some(open_bytes(file, nullptr, "fuzzed"));
        } catch (const Error&) {
        }
    }
    return 0;
}
