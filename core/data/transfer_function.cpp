#include "core/data/transfer_function.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <iterator>

namespace voxloom {

namespace {

// An opacity of 1 would be an infinite extinction; this one leaves 6e-8 of what is behind.
constexpr double kMaxOpacity = 1.0 - 0x1p-24;

// std::lerp: exact at both ends and for equal ends, monotone between.
Emission mix(const Emission& a, const Emission& b, double t) {
    return {std::lerp(a.x, b.x, t), std::lerp(a.y, b.y, t), std::lerp(a.z, b.z, t),
            std::lerp(a.w, b.w, t)};
}

// Where v lies between a < b, halved first where the difference would overflow.
double fraction(double v, double a, double b) {
    double extent = b - a;
    return std::isfinite(extent) ? (v - a) / extent : (v / 2 - a / 2) / (b / 2 - a / 2);
}

bool value_below(double value, const TransferFunction1D::Point& point) {
    return value < point.value;
}

// A coordinate in a regular grid of n nodes over `range`: cell and position in it.
struct GridPosition {
    int cell;  // 0 to n-2
    double t;  // 0 to 1
    double x() const { return cell + t; }
};
GridPosition grid_position(double v, const ValueRange& range, int n) {
    double t = range.min < range.max ? std::clamp(fraction(v, range.min, range.max), 0.0, 1.0) : 0.0;
    double x = t * (n - 1);
    int cell = std::min(int(x), n - 2);
    return {cell, x - cell};
}

}  // namespace

double extinction_of(double opacity, double reference_length) {
    assert(reference_length > 0);
    if (!(opacity > 0)) return 0;
    double tau = -std::log1p(-std::min(opacity, kMaxOpacity)) / reference_length;
    return std::min(tau, kMaxExtinction);
}

double opacity_of(double extinction, double reference_length) {
    if (!(extinction > 0) || !(reference_length > 0)) return 0;
    return -std::expm1(-extinction * reference_length);
}

Emission emission_of(glm::dvec3 color, double opacity, double reference_length) {
    double tau = extinction_of(opacity, reference_length);
    return {tau * color, tau};
}

glm::dvec3 color_of(const Emission& emission) {
    return emission.a > 0 ? glm::dvec3(emission) / emission.a : glm::dvec3(1.0);
}

Emission TransferFunction1D::at(double value) const {
    if (std::isnan(value)) return Emission(0.0);
    auto next = std::upper_bound(points.begin(), points.end(), value, value_below);
    if (next == points.begin()) return points.front().emission;
    if (next == points.end()) return points.back().emission;
    const Point& before = *std::prev(next);
    return mix(before.emission, next->emission, fraction(value, before.value, next->value));
}

Emission TransferFunction1D::integral(double a, double b) const {
    if (!(a < b)) return Emission(0.0);
    const Point &first = points.front(), &last = points.back();
    Emission sum(0.0);
    if (a < first.value) sum += first.emission * (std::min(b, first.value) - a);
    if (b > last.value) sum += last.emission * (b - std::max(a, last.value));
    // The segment that holds a, and those after it up to b. The mean of the ends is exact on each.
    auto p = std::upper_bound(points.begin(), points.end(), a, value_below);
    if (p != points.begin()) --p;
    for (; p != points.end() && std::next(p) != points.end() && p->value < b; ++p) {
        const Point &left = *p, &right = *std::next(p);
        double lo = std::max(a, left.value), hi = std::min(b, right.value);
        if (!(lo < hi)) continue;
        Emission at_lo = mix(left.emission, right.emission, fraction(lo, left.value, right.value));
        Emission at_hi = mix(left.emission, right.emission, fraction(hi, left.value, right.value));
        sum += (at_lo + at_hi) * (0.5 * (hi - lo));
    }
    return sum;
}

double TransferFunction1D::max_extinction(double a, double b) const {
    if (!(a <= b)) return 0;
    double largest = std::max(at(a).a, at(b).a);
    // Of several points of one value only the first (the limit from below) and the last (the value
    // itself) are ever approached. At `a` nothing lies below, at `b` the value was taken above.
    auto p = std::upper_bound(points.begin(), points.end(), a, value_below);
    for (; p != points.end() && p->value <= b; ++p) {
        bool is_first = p == points.begin() || std::prev(p)->value < p->value;
        bool is_last = std::next(p) == points.end() || p->value < std::next(p)->value;
        if (is_first || is_last) largest = std::max(largest, p->emission.a);
    }
    return largest;
}

Emission TransferFunction2D::at(double v, double gradient_magnitude) const {
    if (std::isnan(v) || std::isnan(gradient_magnitude)) return Emission(0.0);
    GridPosition x = grid_position(v, value, dims.x);
    GridPosition y = grid_position(gradient_magnitude, gradient, dims.y);
    const Emission* low = &samples[std::size_t(y.cell) * std::size_t(dims.x) + std::size_t(x.cell)];
    const Emission* high = low + dims.x;
    return mix(mix(low[0], low[1], x.t), mix(high[0], high[1], x.t), y.t);
}

double TransferFunction2D::max_extinction(double a, double b) const {
    if (!(a <= b)) return 0;
    // On a bilinear patch the largest value is at a corner: at the nodes between a and b, and on
    // the lines of a and b at the height of each row.
    GridPosition left = grid_position(a, value, dims.x), right = grid_position(b, value, dims.x);
    double largest = 0;
    for (int j = 0; j < dims.y; ++j) {
        const Emission* row = &samples[std::size_t(j) * std::size_t(dims.x)];
        largest = std::max({largest, std::lerp(row[left.cell].a, row[left.cell + 1].a, left.t),
                            std::lerp(row[right.cell].a, row[right.cell + 1].a, right.t)});
        for (int i = int(std::ceil(left.x())); i <= int(right.x()); ++i)
            largest = std::max(largest, row[i].a);
    }
    return largest;
}

}  // namespace voxloom
