// Seeded numbers that depend on nothing but the seed and a position: no state, no library, the same
// on every machine and for every order of evaluation.
#pragma once

#include <cstdint>

namespace voxloom {

// The finaliser of SplitMix64 (Steele, Lea, Flood 2014): a bijection that scatters every bit.
inline std::uint64_t scatter(std::uint64_t x) {
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

// Uniform in [0, 1).
inline double unit_number(std::uint64_t bits) {
    return double(bits >> 11) * 0x1p-53;
}

// The number of position `index` in the stream `seed`.
inline std::uint64_t seeded_bits(std::uint64_t seed, std::uint64_t index) {
    return scatter(scatter(seed) ^ index);
}

// Mean 0, variance 1, bounded by 2 sqrt(3): the sum of four uniform numbers.
inline double seeded_noise(std::uint64_t bits) {
    const double sum = double(bits & 0xffff) + double(bits >> 16 & 0xffff) +
                       double(bits >> 32 & 0xffff) + double(bits >> 48);
    return (sum - 2 * 65535.0) * (1.7320508075688772 / 65535.0);
}

class SeededNumbers {
  public:
    explicit SeededNumbers(std::uint64_t seed) : seed_(seed) {}
    double next() { return unit_number(seeded_bits(seed_, index_++)); }

  private:
    std::uint64_t seed_, index_ = 0;
};

}  // namespace voxloom
