// Blocks of 4^3 voxels: a mean, and the differences to it that are quantised.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <type_traits>

#include "core/base/types.h"

namespace voxloom::vq {

inline constexpr int kSide = 4;
inline constexpr int kVoxels = 64;   // of a block, x fastest
inline constexpr int kOctants = 8;   // of 2^3 voxels: bit 0 upper half in x, 1 in y, 2 in z
constexpr int octant_of(int voxel) { return (voxel >> 1 & 1) | (voxel >> 3 & 1) << 1 | (voxel >> 5 & 1) << 2; }

inline Index3 blocks_of(Index3 dims) { return (dims + Index3(kSide - 1)) / Index3(kSide); }

// One component of the voxels of a brick.
template <class T>
struct Channel {
    T* voxels;  // of the brick, all components
    Index3 dims;
    int components, component;

    T& at(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return voxels[((z * dims.y + y) * dims.x + x) * components + component];
    }
};

template <class T>
using Block = std::array<T, kVoxels>;

// The last voxel of an axis stands for those beyond it.
template <class T>
Block<T> read_block(const Channel<const T>& from, Index3 block) {
    Block<T> values;
    const Index3 lo = block * Index3(kSide);
    T* to = values.data();
    for (int z = 0; z < kSide; ++z)
        for (int y = 0; y < kSide; ++y)
            for (int x = 0; x < kSide; ++x)
                *to++ = from.at(std::min(lo.x + x, from.dims.x - 1), std::min(lo.y + y, from.dims.y - 1),
                                std::min(lo.z + z, from.dims.z - 1));
    return values;
}

// The reverse; what is beyond the end is dropped.
template <class T>
void write_block(const Channel<T>& to, Index3 block, const Block<T>& values) {
    const Index3 lo = block * Index3(kSide), n = glm::min(Index3(kSide), to.dims - lo);
    const T* from = values.data();
    if (n == Index3(kSide) && to.components == 1) {
        for (int z = 0; z < kSide; ++z)
            for (int y = 0; y < kSide; ++y, from += kSide) std::copy_n(from, kSide, &to.at(lo.x, lo.y + y, lo.z + z));
        return;
    }
    for (std::int64_t z = 0; z < n.z; ++z)
        for (std::int64_t y = 0; y < n.y; ++y)
            for (std::int64_t x = 0; x < n.x; ++x) to.at(lo.x + x, lo.y + y, lo.z + z) = from[(z * kSide + y) * kSide + x];
}

template <class T>
bool all_finite(const Block<T>& values) {
    if constexpr (std::is_floating_point_v<T>)
        return std::ranges::all_of(values, [](T v) { return std::isfinite(v); });
    return true;
}
template <class T>
bool is_constant(const Block<T>& values) {
    return std::ranges::all_of(values, [&](T v) { return v == values[0]; });
}

// The exponent of half of what the values span, of which the whole may be beyond double. They are finite, and not all the same.
template <class T>
int exponent_of(const Block<T>& values) {
    const auto [least, most] = std::ranges::minmax(values);
    int exponent = 0;
    (void)std::frexp(double(most) / 2 - double(least) / 2, &exponent);
    return exponent;
}

// Differences are counted in this: 1 for integers; for floats a power of two near the extent of the volume, but not much above
// that of the block in the middle of all, whose exponent is `middle`: squares of differences must not vanish in float
// because a few voxels hold something huge.
constexpr int kNarrow = 20, kWide = 40;  // exponents below and above the unit's that blocks may have
inline double unit_for(ScalarType type, ValueRange range, std::optional<int> middle = {}) {
    if (!is_float(type)) return 1;
    const double half = range.max / 2 - range.min / 2;  // the whole may be beyond double
    if (!(half > 0)) return range.extent() > 0 ? std::numeric_limits<double>::denorm_min() : 1;
    int exponent = 0;
    (void)std::frexp(half, &exponent);
    if (middle) exponent = std::min(exponent, *middle + kNarrow);
    return std::ldexp(1.0, std::clamp(exponent + 1, -1074, 1023));
}
// Squares of what is wider would be no numbers in float: such blocks are kept as they are.
template <class T>
bool is_too_wide(const Block<T>& values, double unit) {
    if constexpr (std::is_floating_point_v<T>) return exponent_of(values) > std::ilogb(unit) + kWide;
    return false;
}
inline double in_units(double v, double from, double unit) {
    const double d = v - from;
    return std::isfinite(d) ? d / unit : v / unit - from / unit;
}

template <class T>
T rounded(double v, T least, T most) {
    if constexpr (std::is_integral_v<T>) v = std::floor(v + 0.5);
    return v <= double(least) ? least : v >= double(most) ? most : T(v);
}

// The block's mean as it is stored, and its differences in units: to that mean in closed loop, to the exact one in
// open loop. The values are finite.
template <class T>
T mean_and_differences(const Block<T>& values, double unit, bool closed, float* differences) {
    std::array<double, kVoxels> d;
    double sum = 0;
    for (std::size_t i = 0; i < kVoxels; ++i) sum += d[i] = in_units(double(values[i]), double(values[0]), unit);
    const double exact = sum / kVoxels;
    const auto [least, most] = std::ranges::minmax(values);
    const T mean = rounded(double(values[0]) + unit * exact, least, most);
    const double from = closed ? in_units(double(mean), double(values[0]), unit) : exact;
    for (std::size_t i = 0; i < kVoxels; ++i) differences[i] = float(d[i] - from);
    return mean;
}

inline std::array<float, kOctants> octant_means(const float* differences) {
    std::array<double, kOctants> sums{};
    for (int i = 0; i < kVoxels; ++i) sums[std::size_t(octant_of(i))] += double(differences[i]);
    std::array<float, kOctants> means;
    for (std::size_t o = 0; o < kOctants; ++o) means[o] = float(sums[o] / (kVoxels / kOctants));
    return means;
}

// What the octants' part does not say: the vector that the second codebook is for.
inline void take_octants_off(const float* octants, float* differences) {
    for (int i = 0; i < kVoxels; ++i) differences[i] -= octants[octant_of(i)];
}

}  // namespace voxloom::vq
