// A carry-less binary range coder (32-bit range, 16-bit probabilities), and the integer logistic
// functions that its models mix probabilities with. Integers only: every machine writes and reads
// the same bytes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace voxloom::wavelet {

// ln(p / (1 - p)) in units of 1/256, clamped to +-2047; its inverse, in units of 1/65536.
struct Logistic {
    std::array<std::uint16_t, 4096> squashed;  // of -2048 .. 2047
    std::array<std::int16_t, 4096> stretched;  // of probabilities in 1/4096
    Logistic();
};
extern const Logistic kLogistic;
inline int squash(int x) { return kLogistic.squashed[std::size_t(x < -2047 ? 1 : x > 2047 ? 4095 : x + 2048)]; }
inline int stretch(int p16) { return kLogistic.stretched[std::size_t(p16) >> 4]; }

class RangeEncoder {
  public:
    static constexpr bool kDecodes = false;
    explicit RangeEncoder(std::vector<std::byte>& out) : out_(out) {}
    // `p1` is the probability of a one, 1 to 65535.
    bool code(bool bit, std::uint32_t p1) {
        const std::uint32_t middle = lo_ + std::uint32_t(std::uint64_t(hi_ - lo_) * p1 >> 16);
        if (bit)
            hi_ = middle;
        else
            lo_ = middle + 1;
        while (((lo_ ^ hi_) >> 24) == 0) {
            out_.push_back(std::byte(hi_ >> 24));
            lo_ <<= 8;
            hi_ = hi_ << 8 | 255;
        }
        return bit;
    }
    // As few bytes as tell the rest apart; the decoder takes zeros beyond the end.
    void finish() {
        for (int bytes = 0; bytes <= 4; ++bytes) {
            const std::uint64_t unit = std::uint64_t(1) << (32 - 8 * bytes);
            const std::uint64_t value = (lo_ + unit - 1) / unit * unit;
            if (value > hi_) continue;
            for (int i = 0; i < bytes; ++i) out_.push_back(std::byte(value >> (24 - 8 * i)));
            return;
        }
    }

  private:
    std::vector<std::byte>& out_;
    std::uint32_t lo_ = 0, hi_ = 0xffffffffu;
};

class RangeDecoder {
  public:
    static constexpr bool kDecodes = true;
    explicit RangeDecoder(std::span<const std::byte> in) : in_(in) {
        for (int i = 0; i < 4; ++i) value_ = value_ << 8 | next();
    }
    bool code(bool, std::uint32_t p1) {
        const std::uint32_t middle = lo_ + std::uint32_t(std::uint64_t(hi_ - lo_) * p1 >> 16);
        const bool bit = value_ <= middle;
        if (bit)
            hi_ = middle;
        else
            lo_ = middle + 1;
        while (((lo_ ^ hi_) >> 24) == 0) {
            lo_ <<= 8;
            hi_ = hi_ << 8 | 255;
            value_ = value_ << 8 | next();
        }
        return bit;
    }

  private:
    std::uint32_t next() { return at_ < in_.size() ? std::uint32_t(in_[at_++]) : 0; }
    std::span<const std::byte> in_;
    std::size_t at_ = 0;
    std::uint32_t lo_ = 0, hi_ = 0xffffffffu, value_ = 0;
};

// Only learns and counts.
class RangeCounter {
  public:
    static constexpr bool kDecodes = false;
    bool code(bool bit, std::uint32_t p1);
    double bits() const { return bits_; }

  private:
    double bits_ = 0;
};

// The probability of a one, and how much has been learned of it.
struct Chance {
    std::uint16_t p = 32768;
    std::uint16_t seen = 0;
    void learn(bool bit, int limit) {
        p = std::uint16_t(p + ((bit ? 65535 - int(p) : -int(p)) * kRate[seen] >> 16));
        if (seen < limit) ++seen;
    }
    static const std::array<int, 1024> kRate;  // 65536 / (seen + 1.5)
};

}  // namespace voxloom::wavelet
