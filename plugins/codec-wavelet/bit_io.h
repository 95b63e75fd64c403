// Single bits to bytes and back, lowest first.
#pragma once

#include <bit>
#include <cstring>

#include "core/base/error.h"
#include "plugins/codec-wavelet/coder.h"

namespace voxloom::wavelet {

class BitWriter {
  public:
    void put(std::uint32_t bits, int count) {  // up to 32
        held_ |= std::uint64_t(bits) << held_count_;
        held_count_ += count;
        if (held_count_ < 32) return;
        const auto word = std::uint32_t(held_);
        const auto* bytes = reinterpret_cast<const std::byte*>(&word);
        out_.insert(out_.end(), bytes, bytes + sizeof word);
        held_ >>= 32;
        held_count_ -= 32;
    }
    // Any number above 0, in twice its length or a little more.
    void gamma(std::uint32_t v) {
        const int below = std::bit_width(v) - 1;
        put((1u << below) - 1, below);
        put(0, 1);
        put(v & ((1u << below) - 1), below);
    }
    std::size_t bits() const { return 8 * out_.size() + std::size_t(held_count_); }
    const Bytes& finish() {
        for (; held_count_ > 0; held_count_ -= 8, held_ >>= 8) out_.push_back(std::byte(held_ & 255));
        held_ = 0;
        held_count_ = 0;
        return out_;
    }

  private:
    Bytes out_;
    std::uint64_t held_ = 0;
    int held_count_ = 0;
};

class BitReader {
  public:
    explicit BitReader(std::span<const std::byte> in) : in_(in) {}
    std::uint32_t get(int count) {  // up to 32; zeros beyond the end
        while (held_count_ < count) {
            std::uint32_t next = 0;
            const std::size_t bytes = in_.size() < 4 ? in_.size() : 4;
            if (bytes > 0) std::memcpy(&next, in_.data(), bytes);
            in_ = in_.subspan(bytes);
            held_ |= std::uint64_t(next) << held_count_;
            held_count_ += 32;
        }
        const auto bits = std::uint32_t(held_ & ((std::uint64_t(1) << count) - 1));
        held_ >>= count;
        held_count_ -= count;
        return bits;
    }
    std::uint32_t gamma() {
        int below = 0;
        while (below < 31 && get(1)) ++below;
        if (below == 31 && get(1)) fail("a number is out of range");
        return 1u << below | get(below);
    }

  private:
    std::span<const std::byte> in_;
    std::uint64_t held_ = 0;
    int held_count_ = 0;
};

}  // namespace voxloom::wavelet
