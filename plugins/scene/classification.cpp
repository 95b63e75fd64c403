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
    if (points.empty()) return {{{0, Emission(0.0)}}};
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
    if (peaks.empty()) return {{{0, Emission(0.0)}}};
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
    return f;
}

double Shape::mean(double a, double b, double gradient_magnitude) const {
    if (gradient_magnitude < gradient.min || gradient_magnitude > gradient.max) return 0;
    const double t = (gradient_magnitude - gradient.min) / gradient.extent();
    const double lo = std::lerp(bottom.min, top.min, t), hi = std::lerp(bottom.max, top.max, t);
    if (!(lo < hi)) return 0;
    const double middle = 0.5 * (lo + hi), half = 0.5 * (hi - lo);
    // Integral from 0 to u of min(1, (1 - |u|)/edge), u from -1 to 1 across the shape.
    auto integral = [&](double value) {
        double u = std::clamp((value - middle) / half, -1.0, 1.0), d = 1 - std::abs(u);
        double area = d >= edge ? std::abs(u) : 1 - edge + (edge * edge - d * d) / (2 * edge);
        return std::copysign(area, u);
    };
    const double along = 1 - std::abs(2 * t - 1);  // 0 at the lower and the upper border
    const double fade = along < edge ? along / edge : 1;
    return fade * half * (integral(b) - integral(a)) / (b - a);
}

namespace {

// `shapes` with a margin of one cell, so that the outermost nodes are clear of them; not beyond `limit`.
ValueRange grid_range(ValueRange shapes, ValueRange limit, int nodes) {
    double cell = shapes.extent() / (nodes - 3);
    ValueRange range{std::max(shapes.min - cell, limit.min), std::min(shapes.max + cell, limit.max)};
    // Nothing of the shapes is where data can be: take them as they are.
    return range.min < range.max ? range : ValueRange{shapes.min - cell, shapes.max + cell};
}

// The cell about node i; those of the first and the last node are cut in half by the grid's end.
ValueRange cell_of(const ValueRange& range, int nodes, int i) {
    double cell = range.extent() / (nodes - 1);
    return {range.min + cell * std::max(i - 0.5, 0.0),
            range.min + cell * std::min(i + 0.5, double(nodes - 1))};
}

}  // namespace

TransferFunction2D rasterize(std::span<const Shape> shapes, const Domain& domain, glm::ivec2 dims,
                             const std::stop_token& stop) {
    constexpr int kSub = 16;  // gradients a cell
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
                const ValueRange v = cell_of(f.value, dims.x, i), g = cell_of(f.gradient, dims.y, j);
                for (const Shape& shape : shapes) {
                    double sum = 0;
                    for (int k = 0; k < kSub; ++k)
                        sum += shape.mean(v.min, v.max, std::lerp(g.min, g.max, (k + 0.5) / kSub));
                    sample += shape.emission * (sum / kSub);
                }
            }
    }, stop);
    return f;
}

}  // namespace voxloom::scene
