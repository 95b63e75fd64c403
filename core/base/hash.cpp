#include "core/base/hash.h"

#include <fmt/format.h>
#include <xxhash.h>

namespace voxloom {

std::string Hash::hex() const { return fmt::format("{:016x}{:016x}", hi, lo); }

Hash hash_bytes(std::span<const std::byte> data) {
    XXH128_hash_t h = XXH3_128bits(data.data(), data.size());
    return {h.low64, h.high64};
}

Hasher& Hasher::bytes(std::span<const std::byte> data) {
    data_.append(reinterpret_cast<const char*>(data.data()), data.size());
    return *this;
}

Hasher& Hasher::text(std::string_view s) {
    value(std::uint64_t(s.size()));
    data_.append(s);
    return *this;
}

Hash Hasher::finish() const { return hash_bytes(std::as_bytes(std::span(data_))); }

}  // namespace voxloom
