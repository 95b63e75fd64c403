// The head: some eighty ellipsoids, painted one over the other like the parts of a wax model.
//
// Part k covers a point by c = smooth step of the distance to its surface, `edge` wide (thin parts
// have thinner edges), and mixes its Hounsfield units in: v <- (1 - c) v + c h. The order of the
// list is the order of painting, so a shell is a large part and a smaller one over it. The field is
// C1, and its gradient follows the same recurrence.
//
// A row meets few parts, and those mostly inside, where c is 1: the row's interval with each part
// is found first, the inner part of it is filled, and only edges are evaluated.
#include <algorithm>
#include <cmath>
#include <vector>

#include "plugins/readers/phantom_field.h"

namespace voxloom {

namespace {

using glm::dvec3;

constexpr double kAir = -1000, kFat = -90, kSkin = 30, kMuscle = 55, kWater = 5, kGrey = 38,
                 kWhite = 28, kBlood = 75, kSponge = 450, kBone = 1200, kTooth = 2200,
                 kMetal = 3071;

struct Part {
    double hounsfield;
    dvec3 centre, radii;
    double tilt = 0;  // turn about x (the axis from ear to ear), radians, front downwards
};

// Coordinates: x from the right to the left ear, y from the nose to the back, z from neck to crown.
std::vector<Part> head() {
    std::vector<Part> parts;
    auto add = [&](double h, dvec3 centre, dvec3 radii, double tilt = 0) {
        parts.push_back({h, centre, radii, tilt});
    };
    auto pair = [&](double h, dvec3 centre, dvec3 radii, double tilt = 0) {
        add(h, centre, radii, tilt);
        add(h, {-centre.x, centre.y, centre.z}, radii, tilt);
    };

    // Outside.
    add(kSkin, {0, 0.22, -0.95}, {0.44, 0.46, 0.75}, -0.15);
    add(kSkin, {0, 0.04, 0.18}, {0.74, 0.92, 0.80});
    add(kSkin, {0, -0.36, -0.34}, {0.56, 0.54, 0.56}, 0.1);
    add(kSkin, {0, -0.62, -0.74}, {0.28, 0.24, 0.16});
    add(kSkin, {0, -0.88, -0.20}, {0.09, 0.10, 0.20}, -0.35);
    add(kSkin, {0, -0.95, -0.32}, {0.12, 0.09, 0.07});
    pair(kSkin, {0.73, 0.10, -0.10}, {0.05, 0.12, 0.18}, 0.2);
    add(kSkin, {0, -0.90, -0.49}, {0.18, 0.06, 0.045});
    add(kSkin, {0, -0.88, -0.60}, {0.16, 0.06, 0.045});
    add(kFat, {0, 0.04, 0.19}, {0.71, 0.89, 0.77});
    // Muscles of neck and jaw.
    pair(kMuscle, {0.22, 0.42, -0.90}, {0.14, 0.16, 0.55}, -0.1);
    pair(kMuscle, {0.30, 0.12, -0.95}, {0.09, 0.10, 0.55}, 0.3);
    pair(kMuscle, {0.46, -0.28, -0.42}, {0.06, 0.18, 0.28}, 0.1);
    // Skull: outer table, spongy diploe, inner table.
    add(kBone, {0, 0.04, 0.19}, {0.695, 0.875, 0.755});
    add(kSponge, {0, 0.04, 0.19}, {0.670, 0.850, 0.730});
    add(kBone, {0, 0.04, 0.19}, {0.645, 0.825, 0.705});
    // Face: cheek bones, upper jaw, bridge of the nose, lower jaw with its rami.
    pair(kBone, {0.36, -0.58, -0.24}, {0.17, 0.13, 0.08});
    pair(kBone, {0.50, -0.28, -0.22}, {0.05, 0.30, 0.035});
    add(kSponge, {0, -0.48, -0.32}, {0.30, 0.34, 0.26});
    add(kBone, {0, -0.60, -0.44}, {0.29, 0.27, 0.09});
    add(kBone, {0, -0.84, -0.10}, {0.05, 0.05, 0.12}, -0.3);
    add(kBone, {0, -0.46, -0.68}, {0.36, 0.38, 0.10}, 0.12);
    add(kMuscle, {0, -0.34, -0.66}, {0.29, 0.38, 0.16}, 0.12);
    pair(kBone, {0.39, -0.22, -0.45}, {0.035, 0.10, 0.26}, -0.1);
    // Base of the skull, petrous bones with their air cells.
    add(kBone, {0, 0.02, -0.30}, {0.30, 0.34, 0.10}, 0.15);
    pair(kBone, {0.38, 0.12, -0.28}, {0.22, 0.12, 0.10});
    pair(kAir, {0.55, 0.24, -0.30}, {0.05, 0.07, 0.07});
    // Inside of the skull: fluid, grey matter, white matter, the fissure between the halves.
    add(kWater, {0, 0.04, 0.20}, {0.625, 0.805, 0.670});
    add(kGrey, {0, 0.04, 0.21}, {0.605, 0.785, 0.650});
    pair(kWhite, {0.28, 0.04, 0.24}, {0.24, 0.65, 0.47});
    pair(kGrey, {0.25, -0.02, 0.14}, {0.09, 0.16, 0.10});
    add(kWater, {0, 0.04, 0.54}, {0.014, 0.49, 0.23});
    pair(kWater, {0.50, -0.12, 0.10}, {0.09, 0.22, 0.012}, 0.2);
    // Ventricles, pineal gland, plexus, a fresh bleeding.
    pair(kWater, {0.12, -0.08, 0.27}, {0.060, 0.32, 0.085}, -0.15);
    pair(kWater, {0.20, 0.30, 0.16}, {0.060, 0.20, 0.080}, 0.25);
    add(kWater, {0, 0.05, 0.12}, {0.020, 0.14, 0.10});
    add(kSponge, {0, 0.24, 0.14}, {0.025, 0.025, 0.025});
    pair(kSponge, {0.20, 0.34, 0.17}, {0.020, 0.030, 0.020});
    add(kBlood, {0.36, -0.18, 0.36}, {0.10, 0.13, 0.09}, 0.3);
    // Cerebellum, brain stem, fourth ventricle, spinal cord in its canal.
    add(kWater, {0, 0.34, -0.23}, {0.38, 0.26, 0.17});
    pair(kGrey, {0.19, 0.36, -0.24}, {0.175, 0.22, 0.145});
    add(kGrey, {0, 0.15, -0.20}, {0.11, 0.12, 0.30}, -0.1);
    add(kWater, {0, 0.27, -0.22}, {0.035, 0.03, 0.07});
    // Spine.
    for (double z : {-0.56, -0.71, -0.86, -1.01}) {
        add(kBone, {0, 0.22, z}, {0.150, 0.120, 0.060});
        add(kSponge, {0, 0.22, z}, {0.125, 0.095, 0.040});
        add(kBone, {0, 0.42, z - 0.03}, {0.150, 0.110, 0.045});
        add(kBone, {0, 0.56, z - 0.06}, {0.030, 0.120, 0.030}, -0.3);
    }
    add(kWater, {0, 0.38, -0.75}, {0.070, 0.055, 0.60});
    add(kGrey, {0, 0.38, -0.75}, {0.045, 0.035, 0.60});
    // Air: frontal, maxillary and sphenoid sinuses, nose, mouth, throat.
    pair(kBone, {0.10, -0.745, 0.10}, {0.12, 0.055, 0.10}, 0.2);
    pair(kAir, {0.10, -0.750, 0.10}, {0.09, 0.035, 0.07}, 0.2);
    pair(kAir, {0.21, -0.52, -0.31}, {0.10, 0.15, 0.13});
    add(kAir, {0, -0.22, -0.18}, {0.11, 0.10, 0.08});
    pair(kAir, {0.055, -0.56, -0.28}, {0.030, 0.30, 0.12});
    pair(kAir, {0.045, -0.93, -0.36}, {0.025, 0.06, 0.07}, 0.3);
    add(kAir, {0, -0.42, -0.53}, {0.19, 0.26, 0.025}, 0.05);
    add(kAir, {0, -0.10, -0.72}, {0.080, 0.080, 0.50}, -0.05);
    // Orbits: a cone of fat, the eye with its lens, the nerve and the muscles around it.
    pair(kFat, {0.29, -0.68, -0.07}, {0.165, 0.24, 0.150});
    pair(kMuscle, {0.18, -0.60, -0.07}, {0.015, 0.18, 0.030});
    pair(kMuscle, {0.38, -0.60, -0.07}, {0.015, 0.18, 0.030});
    pair(kWhite, {0.25, -0.54, -0.07}, {0.018, 0.18, 0.018});
    pair(kSkin, {0.29, -0.76, -0.07}, {0.120, 0.120, 0.120});
    pair(kWater, {0.29, -0.76, -0.07}, {0.108, 0.108, 0.108});
    pair(kBlood, {0.29, -0.855, -0.07}, {0.045, 0.018, 0.045});
    // Teeth on two arches, two of them filled.
    for (int row = 0; row < 2; ++row)
        for (int k = -6; k <= 6; ++k) {
            const double angle = 0.19 * k;
            const dvec3 at(0.27 * std::sin(angle), -0.50 - 0.29 * std::cos(angle),
                           row ? -0.575 : -0.495);
            const bool filled = (row == 0 && k == 5) || (row == 1 && k == -4);
            add(kTooth, at, {0.026, 0.030, 0.045});
            if (filled) add(kMetal, at, {0.020, 0.020, 0.024});
        }
    return parts;
}

// A part ready for evaluation: q(p) = |A (p - centre)| is 1 on the surface, and (q - 1) times the
// smallest radius is the distance from it (exactly so along that radius, a lower bound elsewhere).
struct Shape {
    double hounsfield;
    dvec3 centre, inverse_radii, bounds;  // bounds: half extents of the outer edge's box
    double cosine, sine;
    double steepness;  // smallest radius / width of the edge
};
constexpr double kSmallestSteepness = 1.7;  // the edge takes at most 0.3 of a radius on either side

inline dvec3 scaled(const Shape& s, dvec3 d) {
    return {d.x * s.inverse_radii.x, (s.cosine * d.y + s.sine * d.z) * s.inverse_radii.y,
            (s.cosine * d.z - s.sine * d.y) * s.inverse_radii.z};
}

// 1 inside, 0 outside, a cubic step between; `t` runs from 1 to 0 over the edge.
inline double coverage(double q, double steepness) {
    double t = 0.5 - (q - 1) * steepness;
    t = t < 0 ? 0 : t;
    t = t > 1 ? 1 : t;
    return t * t * (3 - 2 * t);
}

// Of a row: q^2 = (dx a)^2 + rest, since the tilt leaves x alone.
VOXLOOM_WIDE void paint_edge(const double* x, std::size_t n, double cx, double ax, double rest,
                             double steepness, double hounsfield, double* out) {
    for (std::size_t i = 0; i < n; ++i) {
        const double dx = (x[i] - cx) * ax;
        const double c = coverage(std::sqrt(dx * dx + rest), steepness);
        out[i] = (1 - c) * out[i] + c * hounsfield;
    }
}

class CtHead final : public Field {
  public:
    explicit CtHead(double edge) {
        for (const Part& part : head()) {
            const double smallest = std::min({part.radii.x, part.radii.y, part.radii.z});
            Shape s{part.hounsfield,
                    part.centre,
                    1.0 / part.radii,
                    {},
                    std::cos(part.tilt),
                    std::sin(part.tilt),
                    std::max(smallest / edge, kSmallestSteepness)};
            const dvec3 outer = part.radii * outer_q(s);
            s.bounds = {outer.x, std::hypot(s.cosine * outer.y, s.sine * outer.z),
                        std::hypot(s.sine * outer.y, s.cosine * outer.z)};
            shapes_.push_back(s);
        }
    }
    double value(dvec3 p) const override {
        double v = kAir;
        for (const Shape& s : shapes_) {
            const dvec3 u = scaled(s, p - s.centre);
            const double c = coverage(std::sqrt(u.x * u.x + (u.y * u.y + u.z * u.z)), s.steepness);
            v = (1 - c) * v + c * s.hounsfield;
        }
        return v;
    }
    dvec3 gradient(dvec3 p) const override {
        double v = kAir;
        dvec3 g(0.0);
        for (const Shape& s : shapes_) {
            const dvec3 u = scaled(s, p - s.centre);
            const double q = glm::length(u);
            const double t = std::clamp(0.5 - (q - 1) * s.steepness, 0.0, 1.0);
            const double c = t * t * (3 - 2 * t);
            if (c <= 0) continue;
            // dc/dp = -6 t (1 - t) * steepness * dq/dp, with dq/dp = A^T u / q.
            dvec3 slope(0.0);
            if (t < 1 && q > 0) {
                const dvec3 w = u * s.inverse_radii;
                slope = dvec3(w.x, s.cosine * w.y - s.sine * w.z, s.sine * w.y + s.cosine * w.z) *
                        (-6 * t * (1 - t) * s.steepness / q);
            }
            g = (1 - c) * g + (s.hounsfield - v) * slope;
            v = (1 - c) * v + c * s.hounsfield;
        }
        return g;
    }
    ValueRange natural() const override { return {-1024, 3071}; }
    // Signed types and floats hold Hounsfield units; unsigned ones the scanner's 12 bits.
    ValueRange stored_range(ScalarType type) const override {
        switch (type) {
            case ScalarType::u16:
            case ScalarType::u32:
                return {0, 4095};
            case ScalarType::u8:
            case ScalarType::i8:
                return Field::stored_range(type);
            default:
                return natural();
        }
    }
    int significant_bits(ScalarType type) const override {
        return bytes_of(type) > 1 && !is_float(type) ? 12 : 0;
    }

  protected:
    void row(std::span<const double> x, double y, double z, double* out) const override {
        std::fill_n(out, x.size(), kAir);
        for (const Shape& s : shapes_) {
            if (std::abs(y - s.centre.y) >= s.bounds.y || std::abs(z - s.centre.z) >= s.bounds.z)
                continue;
            const dvec3 u = scaled(s, {0.0, y - s.centre.y, z - s.centre.z});
            const double rest = u.y * u.y + u.z * u.z;
            const double outer = half_width(s, outer_q(s), rest),
                         inner = half_width(s, inner_q(s), rest);
            if (outer <= 0) continue;
            // Outside of `outer` c is 0 and inside of `inner` it is 1, with a little to spare, so
            // the bits are those of value() wherever the interval is cut.
            const std::size_t a = first_above(x, s.centre.x - outer),
                              d = first_above(x, s.centre.x + outer);
            std::size_t b = d, c = d;
            if (inner > 0) {
                b = first_above(x, s.centre.x - inner);
                c = first_above(x, s.centre.x + inner);
                std::fill(out + b, out + c, s.hounsfield);
            }
            paint(s, rest, x, a, b, out);
            paint(s, rest, x, c, d, out);
        }
    }

  private:
    static double outer_q(const Shape& s) { return (1 + 0.5 / s.steepness) * (1 + 1e-9); }
    static double inner_q(const Shape& s) { return (1 - 0.5 / s.steepness) * (1 - 1e-9); }
    // Half of the row's length within q, 0 where the row passes by.
    static double half_width(const Shape& s, double q, double rest) {
        return q > 0 && q * q > rest ? std::sqrt(q * q - rest) / s.inverse_radii.x : 0;
    }
    static std::size_t first_above(std::span<const double> x, double at) {
        return std::size_t(std::upper_bound(x.begin(), x.end(), at) - x.begin());
    }
    static void paint(const Shape& s, double rest, std::span<const double> x, std::size_t from,
                      std::size_t to, double* out) {
        if (from < to)
            paint_edge(x.data() + from, to - from, s.centre.x, s.inverse_radii.x, rest, s.steepness,
                       s.hounsfield, out + from);
    }

    std::vector<Shape> shapes_;
};

}  // namespace

FieldPtr ct_head_field(double edge) {
    return std::make_shared<CtHead>(edge);
}

}  // namespace voxloom
