#include "plugins/lattice-bcc/filters.h"

#include <algorithm>
#include <cmath>

namespace voxloom::bcc {

namespace {

std::array<double, 4> cubic_weights(Filter filter, double t) {
    const double s = 1 - t;
    if (filter == Filter::b_spline)
        return {s * s * s / 6, (4 - 6 * t * t + 3 * t * t * t) / 6, (4 - 6 * s * s + 3 * s * s * s) / 6, t * t * t / 6};
    return {-0.5 * t * s * s, 1 + t * t * (1.5 * t - 2.5), 1 + s * s * (1.5 * s - 2.5), -0.5 * s * t * t};
}

}  // namespace

Taps taps_at(Filter filter, double position, std::int64_t samples) {
    position = std::clamp(position, 0.0, double(samples - 1));
    if (samples == 1) return {0, {1}, 1};
    const std::int64_t cell = std::min(std::int64_t(position), samples - 2);
    const double t = position - double(cell);
    if (filter == Filter::linear) return {cell, {1 - t, t}, 2};
    std::array<double, 4> w = cubic_weights(filter, t);
    Taps taps{cell - 1, w, 4};
    // What would lie one behind an end is twice the end less the one before it.
    if (cell + 2 == samples) {
        taps.count = 3;
        taps.weights[2] += 2 * w[3];
        taps.weights[1] -= w[3];
    }
    if (cell == 0) {
        w = taps.weights;
        taps = {0, {w[1] + 2 * w[0], w[2] - w[0], w[3]}, taps.count - 1};
    }
    return taps;
}

std::vector<Taps> taps_of_grid(Filter filter, double first, double step, std::int64_t count, std::int64_t samples) {
    std::vector<Taps> taps;
    taps.reserve(std::size_t(count));
    for (std::int64_t i = 0; i < count; ++i) taps.push_back(taps_at(filter, first + step * double(i), samples));
    return taps;
}

// c[i-1] + 4 c[i] + c[i+1] = 6 f[i] between the ends, and c = f at them: the natural spline. Gaussian elimination, whose
// pivots converge at once to 2 + sqrt(3).
void to_coefficients(Filter filter, double* line, std::int64_t samples, std::int64_t stride) {
    if (filter != Filter::b_spline || samples < 3) return;
    std::vector<double> factor(std::size_t(samples), 0.0);
    for (std::int64_t i = 1; i + 1 < samples; ++i) {
        factor[std::size_t(i)] = 1 / (4 - factor[std::size_t(i - 1)]);
        line[i * stride] = (6 * line[i * stride] - line[(i - 1) * stride]) * factor[std::size_t(i)];
    }
    for (std::int64_t i = samples - 2; i > 0; --i) line[i * stride] -= factor[std::size_t(i)] * line[(i + 1) * stride];
}

}  // namespace voxloom::bcc
