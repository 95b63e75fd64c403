#include "plugins/scene/classification.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/parallel.h"

namespace voxloom::scene {

glm::dvec3 Coloring::at(double value) const {
    // Divided before subtracting: the span may be all of double.
    double extent = span.max / 2 - span.min / 2;
    double t = extent > 0 ? (value / 2 - span.min / 2) / extent : 0.5;
    return map->at(reversed ? 1 - t : t);
}

double Coloring::value_of(double position) const {
    return std::lerp(span.min, span.max, reversed ? 1 - position : position);
}

double Density::extinction(double opacity) const {
    return std::min(extinction_of(opacity, reference_length) * scale, kMaxExtinction);
}

namespace {

// Values between lo and hi, in rising order, where the map bends.
std::vector<double> bends(const Coloring& coloring, double lo, double hi) {
    std::vector<double> values;
    for (const ColorMap::Knot& knot : coloring.map->knots) {
        double value = coloring.value_of(knot.position);
        if (lo < value && value < hi) values.push_back(value);
    }
    std::sort(values.begin(), values.end());
    return values;
}

}  // namespace

TransferFunction1D through_points(std::vector<ControlPoint> points, const Coloring& coloring,
                                  const Density& density) {
    std::stable_sort(points.begin(), points.end(),
                     [](const auto& a, const auto& b) { return a.value < b.value; });
    TransferFunction1D f;
    auto add = [&](double value, double tau, glm::dvec3 color) {
        f.points.push_back({value, Emission(tau * color, tau)});
    };
    for (std::size_t i = 0; i < points.size(); ++i) {
        const ControlPoint& p = points[i];
        const double tau = density.extinction(p.opacity);
        add(p.value, tau, p.color ? *p.color : coloring.at(p.value));
        if (i + 1 == points.size()) break;
        const ControlPoint& next = points[i + 1];
        const double next_tau = density.extinction(next.opacity);
        if (p.color || next.color || (tau == 0 && next_tau == 0)) continue;
        for (double value : bends(coloring, p.value, next.value)) {
            double t = (value / 2 - p.value / 2) / (next.value / 2 - p.value / 2);
            add(value, std::lerp(tau, next_tau, t), coloring.at(value));
        }
    }
    return f;
}

TransferFunction1D sum_of_peaks(std::span<const Peak> peaks) {
    std::vector<double> values;
    for (const Peak& peak : peaks)
        for (double offset : {-0.5, 0.0, 0.5}) values.push_back(peak.value + offset * peak.width);
    std::sort(values.begin(), values.end());
    values.erase(std::unique(values.begin(), values.end()), values.end());

    // Each triangle is linear between the corners of all, so their sum is exact. Its corners are
    // compared as they were computed: between two peaks there is exactly nothing.
    TransferFunction1D f;
    for (double value : values) {
        Emission sum(0.0);
        for (const Peak& peak : peaks) {
            double half = 0.5 * peak.width;
            if (value > peak.value - half && value < peak.value + half)
                sum += peak.emission * (1 - std::abs(value - peak.value) / half);
        }
        f.points.push_back({value, sum});
    }
    if (f.points.empty()) f.points.push_back({0, Emission(0.0)});
    return f;
}

double Shape::weight(double value, double gradient_magnitude) const {
    if (gradient_magnitude < gradient.min || gradient_magnitude > gradient.max) return 0;
    double t = (gradient_magnitude - gradient.min) / gradient.extent();
    double lo = std::lerp(bottom.min, top.min, t), hi = std::lerp(bottom.max, top.max, t);
    if (!(lo <= value && value <= hi)) return 0;
    auto rise = [&](double to_border) {  // 0 at the border, 1 in the middle
        return edge > 0 ? std::min(1.0, to_border / edge) : 1.0;
    };
    double half = 0.5 * (hi - lo);
    double across = half > 0 ? 1 - std::abs(value - 0.5 * (lo + hi)) / half : 1;
    return rise(across) * rise(1 - std::abs(2 * t - 1));
}

namespace {

// `shapes` with a margin of one cell, so that the outermost nodes are clear of them; not beyond `limit`.
ValueRange grid_range(ValueRange shapes, ValueRange limit, int nodes) {
    double cell = shapes.extent() / (nodes - 3);
    ValueRange range{std::max(shapes.min - cell, limit.min), std::min(shapes.max + cell, limit.max)};
    // Nothing of the shapes is where data can be: take them as they are.
    return range.min < range.max ? range : ValueRange{shapes.min - cell, shapes.max + cell};
}

// Where the middle of sub-sample k of n lies in the cell about node i; the cells of the first and
// the last node are cut in half by the grid's end.
double sub_sample(const ValueRange& range, int nodes, int i, int k, int n) {
    double cell = range.extent() / (nodes - 1);
    double lo = std::max(i - 0.5, 0.0), hi = std::min(i + 0.5, double(nodes - 1));
    return range.min + cell * std::lerp(lo, hi, (k + 0.5) / n);
}

}  // namespace

TransferFunction2D rasterize(std::span<const Shape> shapes, const Domain& domain, glm::ivec2 dims,
                             const std::stop_token& stop) {
    constexpr int kSub = 8;  // sub-samples a side
    constexpr double kInf = std::numeric_limits<double>::infinity();
    ValueRange values{kInf, -kInf}, gradients{kInf, -kInf};
    for (const Shape& s : shapes) {
        values = {std::min({values.min, s.bottom.min, s.top.min}),
                  std::max({values.max, s.bottom.max, s.top.max})};
        gradients = {std::min(gradients.min, s.gradient.min),
                     std::max(gradients.max, s.gradient.max)};
    }
    TransferFunction2D f;
    f.dims = dims;
    f.value = grid_range(values, domain.value, dims.x);
    f.gradient = grid_range(gradients, domain.gradient, dims.y);
    f.samples.assign(std::size_t(dims.x) * std::size_t(dims.y), Emission(0.0));
    parallel_for(0, dims.y, 4, [&](std::int64_t begin, std::int64_t end) {
        for (int j = int(begin); j < int(end); ++j)
            for (int i = 0; i < dims.x; ++i) {
                Emission& sample = f.samples[std::size_t(j) * std::size_t(dims.x) + std::size_t(i)];
                for (const Shape& shape : shapes) {
                    double sum = 0;
                    for (int l = 0; l < kSub; ++l)
                        for (int k = 0; k < kSub; ++k)
                            sum += shape.weight(sub_sample(f.value, dims.x, i, k, kSub),
                                                sub_sample(f.gradient, dims.y, j, l, kSub));
                    sample += shape.emission * (sum / (kSub * kSub));
                }
            }
    }, stop);
    return f;
}

}  // namespace voxloom::scene
