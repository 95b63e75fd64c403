// Bytes as a file of bricks (core/data/brick_file.h), and once more with the lengths and the checksum of the head that an
// honest writer would have put in, so that the fuzzer gets past them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "core/base/error.h"
#include "core/base/hash.h"

namespace voxloom::fuzz {

inline void mend(std::vector<std::byte>& file) {
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

// Calls open(file) with both; it may throw Error.
template <class Open>
void as_file_and_mended(std::span<const std::byte> bytes, const Open& open) {
    std::vector<std::byte> file(bytes.begin(), bytes.end());
    for (int mended = 0; mended < 2; ++mended) {
        if (mended) mend(file);
        try {
            open(file);
        } catch (const Error&) {
        }
    }
}

}  // namespace voxloom::fuzz
