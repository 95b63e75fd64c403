// Rays walked cell by cell: inside of one, the trilinear field is a cubic of the way travelled.
#include <algorithm>
#include <cmath>

#include "core/base/error.h"
#include "core/base/text.h"
#include "plugins/render-reference/cubic.h"
#include "plugins/render-reference/raycast.h"

namespace voxloom::reference {

namespace {

// Cells with invalid corners interpolate with renormalised weights, which is a quotient of cubics:
// this many cubics through its values stand for it.
constexpr int kPiecesBesideInvalid = 16;

// Eight Gauss points err by less than 1e-13 of the colour at this optical depth.
constexpr double kThinDepth = 0.5;
constexpr int kMaxHalvings = 60;  // then the stretch is a rounding error long
// Light is as steep as normals turn, without bound where the gradient vanishes.
constexpr double kLightTolerance = 1e-7;
constexpr int kMaxLightHalvings = 12;

template <class T>
T trilinear(const std::array<T, 8>& v, const std::array<double, 8>& weights) {
    T sum(0.0);
    for (std::size_t i = 0; i < 8; ++i) sum += weights[i] * v[i];
    return sum;
}

}  // namespace

// The box between eight voxels that interpolate (trilinear), or around one voxel (nearest, and the
// axes with one voxel): there both corners of an axis are the same voxel.
struct Raycaster::Cell {
    const Field& field;
    std::array<Index3, 8> corners{};
    std::array<double, 8> values{};
    int valid = 0;                 // corners with a value
    double min = 0, max = 0;       // of the valid corners
    glm::dvec3 entry{}, across{};  // local coordinates: entry + x * across, x from 0 to 1
    double t = 0, length = 0;      // where the ray enters, how far it goes, in world units
    bool has_gradients = false;
    std::array<glm::dvec3, 8> gradients{};

    glm::dvec3 local(double x) const { return entry + x * across; }

    // Interpolation weights of the valid corners; all zero where none has any.
    std::array<double, 8> weights(double x) const {
        const glm::dvec3 u = local(x);
        std::array<double, 8> w;
        double sum = 0;
        for (std::size_t i = 0; i < 8; ++i) {
            w[i] = (i & 1 ? u.x : 1 - u.x) * (i & 2 ? u.y : 1 - u.y) * (i & 4 ? u.z : 1 - u.z);
            if (std::isnan(values[i])) w[i] = 0;
            sum += w[i];
        }
        if (valid < 8 && sum > 0)
            for (double& each : w) each /= sum;
        return w;
    }

    double value(double x) const {
        double v = 0, sum = 0;
        const std::array<double, 8> w = weights(x);
        for (std::size_t i = 0; i < 8; ++i) {
            if (w[i] == 0) continue;
            v += w[i] * values[i];
            sum += w[i];
        }
        return sum > 0 ? v : kInvalid;
    }

    glm::dvec3 gradient(double x) {
        if (!has_gradients)
            for (std::size_t i = 0; i < 8; ++i)
                gradients[i] =
                    std::isnan(values[i]) ? glm::dvec3(0.0) : field.index_gradient(corners[i]);
        has_gradients = true;
        return field.to_world_gradient(trilinear(gradients, weights(x)));
    }

    // Calls visit(f, from, to) for the cubics that the field is along the ray, in order; each is
    // over the share [from, to] of the cell, its own parameter from 0 to 1. Stops where visit says
    // false, and says so itself.
    template <class Visit>
    bool cubics(const Visit& visit) const {
        if (valid == 8) return visit(trilinear_along(values, entry, across), 0.0, 1.0);
        const double piece = 1.0 / kPiecesBesideInvalid;
        for (int i = 0; i < kPiecesBesideInvalid; ++i) {
            // Through four values inside the piece: at its ends there may be none.
            const double from = i * piece;
            const Cubic f = cubic_through(value(from + piece / 8), value(from + piece * 3 / 8),
                                          value(from + piece * 5 / 8), value(from + piece * 7 / 8))
                                .over(-1.0 / 6, 7.0 / 6);
            if (!std::isnan(f.c[3]) && !visit(f, from, from + piece)) return false;
        }
        return true;
    }
};

// --- The transfer function by pieces -------------------------------------------------------------

void Raycaster::build_segments() {
    const std::vector<TransferFunction1D::Point>& points = scene_.transfer->one.points;
    auto add = [&](double value, double next, const Emission& first, const Emission& last) {
        Segment s;
        s.value = value;
        s.first = first;
        if (next > value) {
            s.per_value = 1 / (next - value);
            s.slope = last - first;
        }
        s.transparent = first == Emission(0.0) && last == Emission(0.0);
        const Emission& main = first.a >= last.a ? first : last;
        if (main.a > 0) {
            s.color = glm::dvec3(main) / main.a;
            const glm::dvec3 odd = glm::abs(glm::dvec3(first) - s.color * first.a) +
                                   glm::abs(glm::dvec3(last) - s.color * last.a);
            s.one_color = odd.x + odd.y + odd.z <= 1e-14 * main.a;
        }
        segments_.push_back(s);
    };
    for (const TransferFunction1D::Point& p : points)
        if (!std::isfinite(glm::dot(p.emission, Emission(1.0))))
            fail("the transfer function's extinction at {} is not finite; an opacity below 1 is",
                 shortest(p.value));
    for (std::size_t i = 0; i < points.size(); ++i) {
        const bool begins = i == 0, new_value = begins || points[i].value > points[i - 1].value;
        if (!new_value) continue;
        knots_.push_back(points[i].value);
        if (begins)
            add(points[0].value, points[0].value, points[0].emission, points[0].emission);
        else
            add(points[i - 1].value, points[i].value, points[i - 1].emission, points[i].emission);
    }
    add(points.back().value, points.back().value, points.back().emission, points.back().emission);
}

// The segment that holds at `value` and just above it.
std::size_t Raycaster::segment_of(double value) const {
    return std::size_t(std::upper_bound(knots_.begin(), knots_.end(), value) - knots_.begin());
}

bool Raycaster::is_transparent(double lo, double hi) const {
    const std::size_t last = segment_of(hi);
    for (std::size_t k = segment_of(lo); k <= last; ++k)
        if (!segments_[k].transparent) return false;
    return true;
}

// --- The walk ------------------------------------------------------------------------------------

// Calls visit(cell) for each cell with a valid voxel that the ray passes, in order, until it says
// false. Faces are met where they are, not where a sum of steps says, so a long ray does not drift.
template <class Visit>
void Raycaster::walk(const Path& path, const Visit& visit) const {
    const bool nearest = field_.reconstruction() == Reconstruction::nearest;
    const Index3 dims = field_.desc().dims;
    Index3 cells = dims, reach(0), index, step;
    glm::dvec3 shift(0.5);  // of the cells' lower faces from their voxels, downwards
    for (int a = 0; a < 3; ++a) {
        if (!nearest && dims[a] > 1) {
            cells[a] = dims[a] - 1;
            reach[a] = 1;
            shift[a] = 0;
        }
        index[a] = std::clamp(std::int64_t(std::floor(path.p[a] + shift[a])), std::int64_t(0),
                              cells[a] - 1);
        step[a] = path.d[a] > 0 ? 1 : -1;
    }
    auto face = [&](int a) {
        if (path.d[a] == 0) return std::numeric_limits<double>::infinity();
        const double at = double(index[a] + (step[a] > 0)) - shift[a];
        return (at - path.p[a]) / path.d[a];
    };

    Cell cell{field_};
    glm::dvec3 next(face(0), face(1), face(2));
    double t = 0;
    while (t < path.length) {
        int axis = next.x <= next.y ? 0 : 1;
        if (next.z < next[axis]) axis = 2;
        const double end = std::min(next[axis], path.length);
        if (end > t) {
            cell.valid = 0;
            for (int i = 0; i < 8; ++i) {
                Index3& corner = cell.corners[std::size_t(i)];
                corner = index + reach * Index3(i & 1, i >> 1 & 1, i >> 2);
                const double v = cell.values[std::size_t(i)] = field_.voxel(corner);
                if (std::isnan(v)) continue;
                cell.min = cell.valid ? std::min(cell.min, v) : v;
                cell.max = cell.valid ? std::max(cell.max, v) : v;
                ++cell.valid;
            }
            if (cell.valid > 0) {
                cell.t = t;
                cell.length = end - t;
                cell.entry = glm::clamp(path.at(t) + shift - glm::dvec3(index), 0.0, 1.0);
                cell.across = (end - t) * path.d;
                cell.has_gradients = false;
                if (!visit(cell)) return;
            }
            t = end;
        }
        index[axis] += step[axis];
        if (index[axis] < 0 || index[axis] >= cells[axis]) return;
        next[axis] = face(axis);
    }
}

// --- Emission and absorption ---------------------------------------------------------------------

void Raycaster::emit_cells(const Path& path, Composite& out) const {
    walk(path, [&](Cell& cell) {
        if (is_transparent(cell.min, cell.max)) return true;
        return cell.cubics([&](const Cubic& f, double from, double to) {
            auto piece = [&](double a, double b, std::size_t segment) {
                if (b > a)
                    emit_piece(segments_[segment], path, cell, f.over(a, b), from + a * (to - from),
                               from + b * (to - from), out);
            };
            monotone_stretches(f, [&](double a, double b, double fa, double fb) {
                if (fa == fb) return piece(a, b, segment_of(fa));
                // From knot to knot, upwards or downwards.
                auto k =
                    std::size_t((fa < fb ? std::upper_bound(knots_.begin(), knots_.end(), fa)
                                         : std::lower_bound(knots_.begin(), knots_.end(), fa)) -
                                knots_.begin());
                double x = a;
                auto cut = [&](double knot) {
                    const double at = solve_monotone(f, x, b, knot);
                    piece(x, at, k);
                    x = at;
                };
                if (fa < fb)
                    for (; k < knots_.size() && knots_[k] < fb; ++k) cut(knots_[k]);
                else
                    for (; k > 0 && knots_[k - 1] > fb; --k) cut(knots_[k - 1]);
                piece(x, b, k);
            });
            return !out.saturated();
        });
    });
}

// One stretch [from, to] of a cell on which the field is the cubic f and the transfer function is
// linear, so that extinction is a cubic too.
void Raycaster::emit_piece(const Segment& segment, const Path& path, Cell& cell, const Cubic& f,
                           double from, double to, Composite& out) const {
    if (segment.transparent || out.saturated()) return;
    const double length = (to - from) * cell.length;
    const Cubic share = f.affine(-segment.value, segment.per_value);
    auto emission = [&](double y) {
        return segment.first + segment.slope * std::clamp(share(y), 0.0, 1.0);
    };
    auto depth = [&](double a, double b) {
        double sum = 0;
        for (const Node& node : kGauss2) sum += node.weight * emission(a + (b - a) * node.x).a;
        return sum * (b - a) * length;
    };

    const bool colored = scene_.compositing == Compositing::emission_absorption;
    if (!colored || (segment.one_color && !scene_.shading)) {
        const double d = depth(0, 1);
        out.color -= std::exp(-out.depth) * std::expm1(-d) * segment.color;
        out.depth += d;
        return;
    }
    auto color = [&](double y) -> glm::dvec3 {
        if (!scene_.shading) return emission(y);
        const double x = from + (to - from) * y;
        return lit(emission(y), cell.gradient(x), path.at(cell.t + x * cell.length), path);
    };
    struct Seen {
        glm::dvec3 fine{0.0}, coarse{0.0};
    };
    auto stretch = [&](const auto& rule, double a, double b) {
        Seen seen;
        for (const Node& node : rule) {
            const double y = a + (b - a) * node.x;
            const glm::dvec3 here = (b - a) * length * std::exp(-depth(a, y)) * color(y);
            seen.fine += node.weight * here;
            seen.coarse += node.coarse * here;
        }
        return seen;
    };
    // Halved until there is little optical depth in a stretch and, as light makes kinks, until two
    // rules agree. Where even that does not help, the extinction is so great that the colour at the
    // stretch's front is all that is seen.
    auto integrate = [&](auto&& self, double a, double b, int halvings) -> void {
        if (out.saturated()) return;
        const double d = depth(a, b), middle = 0.5 * (a + b), through = std::exp(-out.depth);
        if (d > kThinDepth && halvings == kMaxHalvings) {
            out.color -= through * std::expm1(-d) * color(a) / emission(a).a;
            out.depth += d;
            return;
        }
        bool settled = d <= kThinDepth;
        Seen seen;
        if (settled && !scene_.shading) seen = stretch(kGauss8, a, b);
        if (settled && scene_.shading) {
            seen = stretch(kKronrod15, a, b);
            settled = halvings >= kMaxLightHalvings ||
                      glm::length(seen.fine - seen.coarse) * through <= kLightTolerance;
        }
        if (settled) {
            out.color += through * seen.fine;
            out.depth += d;
        } else {
            self(self, a, middle, halvings + 1);
            self(self, middle, b, halvings + 1);
        }
    };
    integrate(integrate, 0, 1, 0);
}

// --- One sample ----------------------------------------------------------------------------------

std::optional<Raycaster::Hit> Raycaster::maximum_cells(const Path& path) const {
    std::optional<Hit> best;
    walk(path, [&](const Cell& cell) {
        if (best && cell.max <= best->value) return true;
        return cell.cubics([&](const Cubic& f, double from, double to) {
            auto look = [&](double x, double value) {
                if (!best || value > best->value)
                    best = {cell.t + (from + x * (to - from)) * cell.length, value};
            };
            look(0, f(0));
            monotone_stretches(f, [&](double, double b, double, double fb) { look(b, fb); });
            return true;
        });
    });
    return best;
}

// The surface is where the value changes sides, in a cell or (nearest) from one cell to the next.
std::optional<Raycaster::Hit> Raycaster::surface_cells(const Path& path) const {
    const double iso = scene_.iso_value;
    std::optional<Hit> hit;
    double reached = -1;  // how far the side is known
    bool above = false;
    walk(path, [&](const Cell& cell) {
        return cell.cubics([&](const Cubic& f, double from, double to) {
            const double start = cell.t + from * cell.length, length = (to - from) * cell.length;
            const bool goes_on = reached >= 0 && start - reached <= 1e-9 * path.length;
            if (goes_on && (f(0) >= iso) != above) {
                hit = {start, iso};
                return false;
            }
            monotone_stretches(f, [&](double a, double b, double fa, double fb) {
                if (!hit && (fa >= iso) != (fb >= iso))
                    hit = {start + solve_monotone(f, a, b, iso) * length, iso};
                above = fb >= iso;
            });
            reached = start + length;
            return !hit;
        });
    });
    return hit;
}

}  // namespace voxloom::reference
