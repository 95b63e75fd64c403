// Filters along lines of samples: the separable parts of resampling.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace voxloom::bcc {

enum class Filter {
    b_spline,     // the cubic spline through the samples, straight at the ends: C2, order 4
    catmull_rom,  // a cubic of four samples: C1, order 3
    linear,
};

// A value between samples: weights of those from `first` on, all of which are there.
struct Taps {
    std::int64_t first = 0;
    std::array<double, 4> weights{};
    int count = 0;
};
// At `position`, from 0 to samples - 1, of `samples` >= 1. Beyond the ends lines go on straight.
Taps taps_at(Filter filter, double position, std::int64_t samples);
// Those of a lattice's grid: `count` positions from `first` on, `step` apart; what lies behind the last sample is there.
std::vector<Taps> taps_of_grid(Filter filter, double first, double step, std::int64_t count, std::int64_t samples);

// Samples to coefficients, for the B-spline alone: so many values, each `stride` behind the one before.
void to_coefficients(Filter filter, double* line, std::int64_t samples, std::int64_t stride = 1);

}  // namespace voxloom::bcc
