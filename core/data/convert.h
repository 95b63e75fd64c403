// Voxels from one scalar type to another. Every type's values are exact in double.
#pragma once

#include <cstddef>

#include "core/base/types.h"

namespace voxloom {

// For |v| < 2^51. Adding and taking away 1.5 * 2^52 leaves the nearest integer, ties to even; unlike
// nearbyint() it vectorises on every machine.
inline double round_half_to_even(double v) { return (v + 0x1.8p52) - 0x1.8p52; }

void to_double(ScalarType type, const std::byte* from, std::size_t count, double* to);
// Integers: rounded half to even and clamped to the type's limits, NaN becomes 0. Floats: finite
// values are clamped to the type's limits, NaN and infinities stay.
void from_double(const double* from, std::size_t count, ScalarType type, std::byte* to);

// By the same rules; a plain copy where the types agree. The arrays do not overlap.
void convert(ScalarType from_type, const std::byte* from, ScalarType to_type, std::byte* to,
             std::size_t count);

// copy_box() that also converts: `components` values a voxel.
void convert_box(const Box& box, ScalarType from_type, const std::byte* from, const Box& from_box,
                 ScalarType to_type, std::byte* to, const Box& to_box, int components);

}  // namespace voxloom
