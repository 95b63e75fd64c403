// Transfer functions: what a scalar value looks like.
//
// A TF is stored as extinction tau per unit of world length and colour c. Users give opacity for a
// reference length d0: tau = -ln(1 - opacity)/d0, opacity clamped to 1 - 2^-24 (methods, section 2).
// Between control points the extinction tau and the premultiplied colour tau*c are linear; outside
// of the first and last point the end values hold. NaN is transparent.
#pragma once

#include <glm/glm.hpp>
#include <memory>
#include <string>
#include <vector>

#include "core/base/types.h"

namespace voxloom {

// rgb: tau * c per world length, a: tau per world length.
using Emission = glm::dvec4;

// What opaque means: nothing is denser, so every sum and integral below stays finite.
inline constexpr double kMaxExtinction = 1e30;

// -ln(1 - opacity)/reference_length, at most kMaxExtinction; 0 for an opacity that is NaN or below 0.
// reference_length > 0.
double extinction_of(double opacity, double reference_length);
// 1 - exp(-extinction * reference_length), 0 to 1; 0 where either is NaN or not above 0.
double opacity_of(double extinction, double reference_length);
// The emission of colour c (not premultiplied) at the given opacity.
Emission emission_of(glm::dvec3 color, double opacity, double reference_length);
// c = tau*c / tau; white where tau is 0, for then the colour is not known.
glm::dvec3 color_of(const Emission& emission);

// 1-D: control points sorted by value; two points with the same value make a step, at which the
// later one holds.
struct TransferFunction1D {
    struct Point {
        double value;
        Emission emission;
    };
    std::vector<Point> points;  // never empty; one point: constant
    Emission at(double value) const;
    // Exact integrals over [a, b] (a <= b, finite) of tau*c and tau with respect to the value.
    Emission integral(double a, double b) const;
    // Least upper bound of tau on [a, b]: 0 means that nothing there is seen, not even at the
    // beginning of a step down at b. 0 when a <= b does not hold (an empty interval, NaN).
    double max_extinction(double a, double b) const;
};

// 2-D over value (x) and gradient magnitude (y, value per world length): samples at the nodes of a
// regular grid, bilinear between, clamped outside; NaN in either is transparent. A range of no extent
// stands for its first column or row.
struct TransferFunction2D {
    ValueRange value, gradient;
    glm::ivec2 dims{0};              // at least 2 x 2
    std::vector<Emission> samples;   // x fastest
    Emission at(double value, double gradient_magnitude) const;
    double max_extinction(double a, double b) const;  // over values [a, b] and all gradients
};

struct TransferFunction {
    double reference_length = 1;     // world units, for showing opacities again
    TransferFunction1D one;
    std::shared_ptr<const TransferFunction2D> two;  // when present, it is what classifies
    double max_extinction(double a, double b) const {
        return two ? two->max_extinction(a, b) : one.max_extinction(a, b);
    }
};
using TransferPtr = std::shared_ptr<const TransferFunction>;

}  // namespace voxloom
