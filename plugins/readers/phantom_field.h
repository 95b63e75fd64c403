// Analytic scalar fields in the phantom's own coordinates.
//
// A field lives over p, for a cubic grid the cube [-1, 1]^3 from the first to the last voxel. Its
// gradient is a closed form, and whole rows along x are evaluated at once: loops without branches
// or library calls, tables where the formula separates, the same bits as value() point by point.
#pragma once

#include <glm/glm.hpp>
#include <memory>
#include <span>

#include "core/base/types.h"
#include "core/base/wide.h"

namespace voxloom {

// How voxel indices and phantom coordinates hang together: p = (i - (dims - 1) / 2) * step.
struct PhantomGrid {
    Index3 dims{0};
    glm::dvec3 step{1.0};  // phantom units a voxel, positive

    double coordinate(int axis, double index) const {
        return (index - double(dims[axis] - 1) * 0.5) * step[axis];
    }
    double index(int axis, double p) const { return p / step[axis] + double(dims[axis] - 1) * 0.5; }
    glm::dvec3 reach() const;  // largest coordinate on each axis, at the last voxel
};

class Field {
  public:
    virtual ~Field() = default;
    virtual double value(glm::dvec3 p) const = 0;
    virtual glm::dvec3 gradient(glm::dvec3 p) const = 0;  // with respect to p
    virtual ValueRange natural() const = 0;               // bounds of value()
    // What the natural range is stored as in a type when nothing else is asked for: itself in
    // floats, the full range in integers.
    virtual ValueRange stored_range(ScalarType type) const;
    virtual int significant_bits(ScalarType) const { return 0; }

    // Evaluates rows along x; made once for many rows, so that what depends on x alone is
    // tabulated once. Immutable: row() may be called by many threads.
    class Rows {
      public:
        virtual ~Rows() = default;
        virtual void row(double y, double z, double* out) const = 0;
    };
    // The field and `x` must outlive the rows.
    virtual std::unique_ptr<Rows> rows(std::span<const double> x) const;

  protected:
    virtual void row(std::span<const double> x, double y, double z, double* out) const;
};
using FieldPtr = std::shared_ptr<const Field>;

// Marschner and Lobb 1994: ((1 - sin(pi z/2)) + a (1 + rho(r))) / (2 (1 + a)),
// rho(r) = cos(2 pi f cos(pi r/2)), r = |(x, y)|: nearly all of its energy near the band limit of
// 40^3.
FieldPtr marschner_lobb_field(double frequency, double alpha);
// dot(direction, p); the natural range is what the grid's box reaches.
FieldPtr ramp_field(glm::dvec3 direction, const PhantomGrid& grid);
// (|p - centre| - radius) * scale, `scale` the world length of a phantom unit: a true distance.
// The natural range holds for every centre within `travel` of the middle.
FieldPtr sphere_distance_field(glm::dvec3 centre, double travel, double radius, double scale,
                               const PhantomGrid& grid);
FieldPtr constant_field(double value);
// 1 at one voxel; between voxels the trilinear hat.
FieldPtr impulse_field(Index3 at, const PhantomGrid& grid);
// +1 and -1 alternating on every axis; between voxels the product of cosines at the Nyquist rate.
FieldPtr checkerboard_field(const PhantomGrid& grid);
// 0 below voxel `first_high` of an axis and 1 from it on; the jump is half a voxel below it.
FieldPtr step_field(int axis, std::int64_t first_high, const PhantomGrid& grid);
// cos(2 pi (count |p| - phase)), concentric shells; smooth everywhere but at the centre.
FieldPtr shells_field(double count, double phase);
// Mean of `count` plane waves of seeded directions and phases, |omega| at most `fraction` of the
// radius of the grid's band limit, and the whole turned about z by `turn` radians.
FieldPtr plane_waves_field(int count, double fraction, std::uint64_t seed, double turn,
                           const PhantomGrid& grid);
// (1 - t) a + t b: linear in t at every point.
FieldPtr blend_field(FieldPtr a, FieldPtr b, double t);
// A head as CT sees it, in Hounsfield units, as overlapping ellipsoids whose edges are smooth steps
// `edge` wide. x to the left, y to the back, z up.
FieldPtr ct_head_field(double edge);

// cos(2 pi t) in double precision by a polynomial, without branches, so that loops vectorise.
inline double cos_turns(double t) {
    constexpr double shifter = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to whole numbers
    const double r = t - ((t + shifter) - shifter);
    // cos(2 pi r) = sin(y) with |y| <= pi/2, where the series up to y^21 is exact to the last bits.
    const double y = (0.25 - (r < 0 ? -r : r)) * 6.283185307179586;
    const double s = y * y;
    double poly = 1.0 / 51090942171709440000.0;
    poly = poly * s - 1.0 / 121645100408832000.0;
    poly = poly * s + 1.0 / 355687428096000.0;
    poly = poly * s - 1.0 / 1307674368000.0;
    poly = poly * s + 1.0 / 6227020800.0;
    poly = poly * s - 1.0 / 39916800.0;
    poly = poly * s + 1.0 / 362880.0;
    poly = poly * s - 1.0 / 5040.0;
    poly = poly * s + 1.0 / 120.0;
    poly = poly * s - 1.0 / 6.0;
    return y + y * s * poly;
}
inline double sin_turns(double t) {
    return cos_turns(t - 0.25);
}

}  // namespace voxloom
