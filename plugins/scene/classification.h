// From what people draw (points, peaks, shapes) to transfer functions in extinction and
// premultiplied colour.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "core/data/transfer_function.h"
#include "plugins/scene/color_maps.h"

namespace voxloom::scene {

// A colour map laid over values: its left end at span.min, its right end at span.max.
struct Coloring {
    const ColorMap* map;
    bool reversed = false;
    ValueRange span;
    glm::dvec3 at(double value) const;
    double value_of(double position) const;  // the value where the map's position is
};

struct ControlPoint {
    double value;
    double opacity;                   // 0 to 1, of reference_length
    std::optional<glm::dvec3> color;  // taken from the map where it is not given
};
// How opacities are meant: of this world length, and then this much denser.
struct Density {
    double reference_length = 1;
    double scale = 1;
    double extinction(double opacity) const;
};

// Piecewise linear extinction through the points, sorted by value (two of one value make a step, in
// their order). Between two points that take their colour from the map it follows the map: points
// are put in where the map bends, which leaves the extinction as it is.
TransferFunction1D through_points(std::vector<ControlPoint> points, const Coloring& coloring,
                                  const Density& density);

// A triangle of extinction about a value: what draws an isosurface as a thin shell. Overlapping
// peaks add up.
struct Peak {
    double value;
    double width;       // of its base, above 0
    Emission emission;  // at its tip
};
TransferFunction1D sum_of_peaks(std::span<const Peak> peaks);

// A trapezoid over value and gradient magnitude: from [bottom.min, bottom.max] at gradient.min to
// [top.min, top.max] at gradient.max. A box where both are equal, a triangle where one is a point.
// `edge` is the share of the way from border to middle over which the extinction rises from 0.
struct Shape {
    ValueRange bottom, top, gradient;
    Emission emission;
    double edge = 1;
    // Mean weight, 0 to 1, over the values from a to b (a < b) at one gradient magnitude; exact.
    double mean(double a, double b, double gradient_magnitude) const;
};
// The sum of the shapes on a grid of `dims` nodes that covers them. Every sample is the mean over
// its cell, so what is narrower than a cell keeps its integral. `domain` is where data can be: the
// grid ends there, and what a shape has at that end is held beyond it.
struct Domain {
    ValueRange value, gradient;
};
TransferFunction2D rasterize(std::span<const Shape> shapes, const Domain& domain, glm::ivec2 dims,
                             const std::stop_token& stop);

}  // namespace voxloom::scene
