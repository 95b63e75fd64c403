// Voxel values to the integers of the tree and back.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "core/data/volume.h"

namespace voxloom::wavelet {

// value = tree * step + offset. Tree integers stay within 2^26, so that no sum of the transform
// leaves 32 bits (peak_after()).
struct ValueMap {
    double step = 1, offset = 0;

    bool identity() const { return step == 1 && offset == 0; }
    double value(std::int32_t tree) const { return double(tree) * step + offset; }
    std::int32_t tree(double v) const {  // of a finite value
        constexpr double most = 1 << 26;
        const double t = std::clamp((v - offset) / step, -most, most);
        return std::int32_t(t < 0 ? t - 0.5 : t + 0.5);
    }
    // Bits below the unit, where the integers are those of the voxels shifted; else -1.
    int shift() const {
        const int bits = -std::ilogb(step);
        return offset == 0 && bits >= 0 && bits < 16 && std::ldexp(1.0, -bits) == step ? bits : -1;
    }
};

inline constexpr double kTreeBits = 24;

// One to one where the integers of the type are few enough; false where some values only come near.
inline bool is_exact(ScalarType type, const ValueRange& range) {
    return !is_float(type) && range.extent() <= std::exp2(kTreeBits);
}

// `fraction` bits below the unit keep the rounding of lifting out of a lossy result.
inline ValueMap map_of(ScalarType type, const ValueRange& range, int fraction) {
    ValueMap map;
    if (is_exact(type, range)) {
        if (bytes_of(type) > 2) map.offset = std::floor((range.min + range.max) / 2);
        map.step = std::exp2(-fraction);
        while (range.extent() / map.step > std::exp2(kTreeBits)) map.step *= 2;
        return map;
    }
    // A power of two, so that mapping there and back is exact for what lies on the grid.
    map.offset = range.min / 2 + range.max / 2;
    const double extent = range.max / 2 - range.min / 2;  // half of it: the whole may overflow
    map.step = extent > 0 ? std::exp2(std::ceil(std::log2(extent)) + 1 - kTreeBits) : 1.0;
    if (!(map.step > 0) || !std::isnormal(map.step)) map.step = std::numeric_limits<double>::min();
    return map;
}

}  // namespace voxloom::wavelet
