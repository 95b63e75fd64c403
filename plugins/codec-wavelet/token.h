// A magnitude as a token, its size in half octaves, and the bits below: 0, 1, 2, 3, 4-5, 6-7, 8-11, ...
#pragma once

#include <bit>
#include <cstdint>

namespace voxloom::wavelet {

inline constexpr int kMaxToken = 4 + 2 * 28 + 1;  // of numbers below 2^31

inline int token_of(std::uint32_t m) {
    if (m < 4) return int(m);
    const int n = std::bit_width(m) - 1;
    return 4 + 2 * (n - 2) + int(m >> (n - 1) & 1);
}
inline int low_bits_of(int token) { return token < 4 ? 0 : (token - 4) / 2 + 1; }
inline std::uint32_t first_of(int token) {
    if (token < 4) return std::uint32_t(token);
    return std::uint32_t(2 | (token & 1)) << low_bits_of(token);
}

}  // namespace voxloom::wavelet
