// 128-bit content hash (XXH3), the key of every cache.
#pragma once

#include <compare>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace voxloom {

struct Hash {
    std::uint64_t lo = 0, hi = 0;
    friend auto operator<=>(const Hash&, const Hash&) = default;
    std::string hex() const;
};

struct HashOfHash {
    std::size_t operator()(const Hash& h) const { return std::size_t(h.lo); }
};

// Feeds values one after the other; text is length-prefixed, so ("ab","c") differs from ("a","bc").
class Hasher {
  public:
    Hasher& bytes(std::span<const std::byte> data);
    Hasher& text(std::string_view s);
    template <class T>
        requires std::is_arithmetic_v<T> || std::is_enum_v<T>
    Hasher& value(T v) {
        return bytes(std::as_bytes(std::span<const T, 1>(&v, 1)));
    }
    Hasher& hash(const Hash& h) { return value(h.lo).value(h.hi); }
    Hash finish() const;

  private:
    std::string data_;
};

Hash hash_bytes(std::span<const std::byte> data);

}  // namespace voxloom
