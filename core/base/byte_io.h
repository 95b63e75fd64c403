// Little-endian numbers to bytes and back, never beyond the end.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "core/base/error.h"

namespace voxloom {

static_assert(std::endian::native == std::endian::little, "byte_io.h copies numbers as they are");

using Bytes = std::vector<std::byte>;

class ByteWriter {
  public:
    explicit ByteWriter(Bytes& out) : out_(out) {}
    template <class T>
        requires std::is_arithmetic_v<T> || std::is_enum_v<T>
    void number(T v) {
        bytes(std::as_bytes(std::span<const T, 1>(&v, 1)));
    }
    // Seven bits a byte, lowest first, the top bit set on all but the last.
    void varint(std::uint64_t v) {
        for (; v >= 128; v >>= 7) out_.push_back(std::byte(v | 128));
        out_.push_back(std::byte(v));
    }
    void bytes(std::span<const std::byte> data) {
        const std::size_t at = out_.size();
        out_.resize(at + data.size());
        if (!data.empty()) std::memcpy(out_.data() + at, data.data(), data.size());
    }
    // With its length before it.
    void block(std::span<const std::byte> data) {
        varint(data.size());
        bytes(data);
    }
    void text(std::string_view s) { block(std::as_bytes(std::span(s.data(), s.size()))); }

  private:
    Bytes& out_;
};

// Throws Error where the bytes end too early.
class ByteReader {
  public:
    explicit ByteReader(std::span<const std::byte> in) : in_(in) {}
    std::size_t left() const { return in_.size(); }
    std::span<const std::byte> bytes(std::uint64_t count) {
        if (count > in_.size()) fail("the data ends too early");
        auto part = in_.first(std::size_t(count));
        in_ = in_.subspan(std::size_t(count));
        return part;
    }
    template <class T>
    T number() {
        T v;
        std::memcpy(&v, bytes(sizeof v).data(), sizeof v);
        return v;
    }
    std::uint64_t varint() {
        std::uint64_t v = 0;
        for (int shift = 0; shift < 64; shift += 7) {
            const auto b = std::uint64_t(number<std::uint8_t>());
            v |= (b & 127) << shift;
            if (b < 128) return v;
        }
        fail("a length is malformed");
    }
    std::span<const std::byte> block() { return bytes(varint()); }
    std::string text() {
        auto b = block();
        return {reinterpret_cast<const char*>(b.data()), b.size()};
    }

  private:
    std::span<const std::byte> in_;
};

}  // namespace voxloom
