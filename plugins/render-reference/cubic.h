// Cubics on [0, 1]: what a trilinear field is along a ray inside one cell.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <glm/glm.hpp>
#include <utility>

namespace voxloom::reference {

// c[0] + c[1] x + c[2] x^2 + c[3] x^3
struct Cubic {
    std::array<double, 4> c{};

    double operator()(double x) const { return ((c[3] * x + c[2]) * x + c[1]) * x + c[0]; }
    double slope(double x) const { return (3 * c[3] * x + 2 * c[2]) * x + c[1]; }

    // The same curve over [a, b], with the parameter again from 0 to 1.
    Cubic over(double a, double b) const {
        const double h = b - a;
        return {{(*this)(a), h * slope(a), h * h * (3 * c[3] * a + c[2]), h * h * h * c[3]}};
    }
    // scale * (f + shift)
    Cubic affine(double shift, double scale) const {
        return {{scale * (c[0] + shift), scale * c[1], scale * c[2], scale * c[3]}};
    }
};

// The trilinear interpolation of a cell's corners (bit 0 of the number: x, 1: y, 2: z) along the
// straight line from local coordinates u to u + d.
inline Cubic trilinear_along(const std::array<double, 8>& v, glm::dvec3 u, glm::dvec3 d) {
    // Lines along x, then their bilinear blend: every product of two lines stays a short
    // polynomial.
    double line[4][2];
    for (int i = 0; i < 4; ++i) {
        double slope = v[std::size_t(2 * i + 1)] - v[std::size_t(2 * i)];
        line[i][0] = v[std::size_t(2 * i)] + slope * u.x;
        line[i][1] = slope * d.x;
    }
    double plane[2][3];
    for (int i = 0; i < 2; ++i) {
        const double s0 = line[2 * i + 1][0] - line[2 * i][0],
                     s1 = line[2 * i + 1][1] - line[2 * i][1];
        plane[i][0] = line[2 * i][0] + s0 * u.y;
        plane[i][1] = line[2 * i][1] + s1 * u.y + s0 * d.y;
        plane[i][2] = s1 * d.y;
    }
    double s[3];
    for (int k = 0; k < 3; ++k) s[k] = plane[1][k] - plane[0][k];
    return {{plane[0][0] + s[0] * u.z, plane[0][1] + s[1] * u.z + s[0] * d.z,
             plane[0][2] + s[2] * u.z + s[1] * d.z, s[2] * d.z}};
}

// The cubic through values at 0, 1/3, 2/3 and 1.
inline Cubic cubic_through(double y0, double y1, double y2, double y3) {
    return {{y0, (-11 * y0 + 18 * y1 - 9 * y2 + 2 * y3) / 2,
             (18 * y0 - 45 * y1 + 36 * y2 - 9 * y3) / 2,
             (-9 * y0 + 27 * y1 - 27 * y2 + 9 * y3) / 2}};
}

// Calls visit(a, b, f(a), f(b)) for the stretches of [0, 1] on which f is monotone, in order.
template <class Visit>
void monotone_stretches(const Cubic& f, const Visit& visit) {
    // Roots of the slope in the form that does not cancel.
    const double a = 3 * f.c[3], b = f.c[2], c = f.c[1], discriminant = b * b - a * c;
    double turn[2] = {2, 2};
    if (discriminant > 0) {
        const double q = -(b + std::copysign(std::sqrt(discriminant), b));
        if (a != 0) turn[0] = q / a;
        if (q != 0) turn[1] = c / q;
        if (turn[0] > turn[1]) std::swap(turn[0], turn[1]);
    }
    double from = 0, f_from = f.c[0];
    for (double to : {turn[0], turn[1], 1.0}) {
        if (!(to > from && to <= 1)) continue;
        const double f_to = f(to);
        visit(from, to, f_from, f_to);
        from = to;
        f_from = f_to;
    }
}

// Where f, monotone on [a, b], takes the value v between f(a) and f(b): Newton's method kept inside
// a bracket by bisection.
inline double solve_monotone(const Cubic& f, double a, double b, double v) {
    const bool rising = f(b) > f(a);
    double x = 0.5 * (a + b);
    for (int i = 0; i < 100 && b - a > 1e-16; ++i) {
        const double y = f(x) - v;
        if (y == 0) return x;
        ((y > 0) == rising ? b : a) = x;
        const double step = y / f.slope(x);
        double next = x - step;
        if (!(next > a && next < b)) next = 0.5 * (a + b);
        if (std::abs(next - x) <= 1e-16) return next;
        x = next;
    }
    return x;
}

// Quadrature on [0, 1]. Gauss's rules of two and eight points are exact to degree 3 and 15;
// Kronrod's fifteen points to degree 22, and with the second weights seven of them are Gauss's
// rule, exact to degree 13, so that the difference tells the error.
struct Node {
    double x, weight, coarse = 0;
};
inline constexpr std::array<Node, 2> kGauss2 = {
    {{0.21132486540518713, 0.5}, {0.7886751345948129, 0.5}}};
inline constexpr std::array<Node, 8> kGauss8 = {{{0.019855071751231912, 0.050614268145188344},
                                                 {0.10166676129318664, 0.11119051722668717},
                                                 {0.2372337950418355, 0.15685332293894352},
                                                 {0.4082826787521751, 0.18134189168918088},
                                                 {0.5917173212478248, 0.18134189168918088},
                                                 {0.7627662049581645, 0.15685332293894352},
                                                 {0.8983332387068134, 0.11119051722668717},
                                                 {0.9801449282487681, 0.050614268145188344}}};
inline constexpr std::array<Node, 15> kKronrod15 = {
    {{0.004272314439593694, 0.011467661005264612, 0.0},
     {0.025446043828620757, 0.03154604631498928, 0.06474248308443485},
     {0.06756778832011545, 0.052395005161125094, 0.0},
     {0.12923440720030277, 0.07032662985776296, 0.13985269574463832},
     {0.20695638226615443, 0.08450236331963396, 0.0},
     {0.2970774243113014, 0.09517528903239271, 0.19091502525255946},
     {0.39610752249605075, 0.10221647003764944, 0.0},
     {0.5, 0.10474107054236391, 0.2089795918367347},
     {0.6038924775039493, 0.10221647003764944, 0.0},
     {0.7029225756886985, 0.09517528903239271, 0.19091502525255946},
     {0.7930436177338456, 0.08450236331963396, 0.0},
     {0.8707655927996972, 0.07032662985776296, 0.13985269574463832},
     {0.9324322116798845, 0.052395005161125094, 0.0},
     {0.9745539561713792, 0.03154604631498928, 0.06474248308443485},
     {0.9957276855604063, 0.011467661005264612, 0.0}}};

}  // namespace voxloom::reference
