// Rays sampled at short equal steps: for what has no closed form inside of a cell.
#include <algorithm>
#include <cmath>

#include "plugins/render-reference/raycast.h"

namespace voxloom::reference {

// Equal steps over the whole path, none longer than asked for.
std::int64_t Raycaster::step_count(const Path& path) const {
    return std::max<std::int64_t>(1, std::int64_t(std::ceil(path.length / step_length_)));
}

// The middle of each step stands for all of it; the step's own absorption is exact for that value.
void Raycaster::emit_steps(const Path& path, Composite& out) const {
    const std::int64_t n = step_count(path);
    const double h = path.length / double(n);
    for (std::int64_t k = 0; k < n && !out.saturated(); ++k) {
        const glm::dvec3 p = path.at((double(k) + 0.5) * h);
        const double value = field_.value(p);
        if (std::isnan(value)) continue;
        Emission e = classify(p, value);
        if (e == Emission(0.0)) continue;
        if (scene_.shading) e = lit(e, field_.gradient(p), p, path);
        // (1 - exp(-tau h)) / tau goes to h where there is no absorption.
        const double x = e.a * h, shown = x > 0 ? -std::expm1(-x) / e.a : h;
        out.color += std::exp(-out.depth) * shown * glm::dvec3(e);
        out.depth += x;
    }
}

std::optional<Raycaster::Hit> Raycaster::maximum_steps(const Path& path) const {
    const std::int64_t n = step_count(path);
    std::optional<Hit> best;
    for (std::int64_t k = 0; k <= n; ++k) {
        const double t = path.length * (double(k) / double(n));
        const double value = field_.value(path.at(t));
        if (!std::isnan(value) && (!best || value > best->value)) best = {t, value};
    }
    return best;
}

// The first step over which the value changes sides, then bisection.
std::optional<Raycaster::Hit> Raycaster::surface_steps(const Path& path) const {
    const std::int64_t n = step_count(path);
    const double iso = scene_.iso_value;
    double before = kInvalid, t_before = 0;
    for (std::int64_t k = 0; k <= n; ++k) {
        const double t = path.length * (double(k) / double(n)), value = field_.value(path.at(t));
        if (!std::isnan(value) && !std::isnan(before) && (value >= iso) != (before >= iso)) {
            double a = t_before, b = t;
            for (int i = 0; i < 60; ++i) {
                const double middle = 0.5 * (a + b), v = field_.value(path.at(middle));
                if (std::isnan(v)) break;
                ((v >= iso) == (before >= iso) ? a : b) = middle;
            }
            return Hit{0.5 * (a + b), iso};
        }
        before = value;
        t_before = t;
    }
    return std::nullopt;
}

}  // namespace voxloom::reference
