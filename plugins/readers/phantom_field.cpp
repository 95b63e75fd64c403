#include "plugins/readers/phantom_field.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "plugins/readers/phantom_random.h"

namespace voxloom {

namespace {

constexpr double kPi = 3.14159265358979323846;
using glm::dvec3;

// ---- loops -------------------------------------------------------------------------------------

inline double marschner_lobb(double rr, double f, double alpha, double z_part) {
    const double r = std::sqrt(rr);
    return z_part + alpha * cos_turns(f * cos_turns(0.25 * r));
}

VOXLOOM_WIDE void marschner_lobb_row(const double* x, std::size_t n, double yy, double f,
                                     double alpha, double z_part, double* out) {
    for (std::size_t i = 0; i < n; ++i) out[i] = marschner_lobb(x[i] * x[i] + yy, f, alpha, z_part);
}

VOXLOOM_WIDE void sphere_row(const double* x, std::size_t n, double cx, double yz, double radius,
                             double scale, double* out) {
    for (std::size_t i = 0; i < n; ++i)
        out[i] = (std::sqrt((x[i] - cx) * (x[i] - cx) + yz) - radius) * scale;
}

VOXLOOM_WIDE void shells_row(const double* x, std::size_t n, double yz, double count, double phase,
                             double* out) {
    for (std::size_t i = 0; i < n; ++i)
        out[i] = cos_turns(count * std::sqrt(x[i] * x[i] + yz) - phase);
}

VOXLOOM_WIDE void add_wave(const double* cosine, const double* sine, std::size_t n, double c,
                           double s, double* out) {
    for (std::size_t i = 0; i < n; ++i) out[i] += c * cosine[i] - s * sine[i];
}

// ---- fields ------------------------------------------------------------------------------------

class MarschnerLobb final : public Field {
  public:
    MarschnerLobb(double f, double alpha)
        : f_(f), gain_(1 / (2 * (1 + alpha))), alpha_(alpha * gain_) {}
    double value(dvec3 p) const override {
        return marschner_lobb(p.x * p.x + p.y * p.y, f_, alpha_, z_part(p.z));
    }
    dvec3 gradient(dvec3 p) const override {
        const double r = std::sqrt(p.x * p.x + p.y * p.y);
        const double inner = kPi * r / 2;
        // d rho/dr = sin(2 pi f cos(pi r/2)) * 2 pi f * sin(pi r/2) * pi/2, and sin(pi r/2)/r ->
        // pi/2.
        const double over_r = r > 1e-9 ? std::sin(inner) / r : kPi / 2;
        const double radial =
            alpha_ * std::sin(2 * kPi * f_ * std::cos(inner)) * 2 * kPi * f_ * over_r * kPi / 2;
        return {radial * p.x, radial * p.y, -gain_ * kPi / 2 * std::cos(kPi * p.z / 2)};
    }
    ValueRange natural() const override { return {0, 1}; }

  protected:
    void row(std::span<const double> x, double y, double z, double* out) const override {
        marschner_lobb_row(x.data(), x.size(), y * y, f_, alpha_, z_part(z), out);
    }

  private:
    double z_part(double z) const { return gain_ * (1 - sin_turns(0.25 * z)) + alpha_; }
    double f_, gain_, alpha_;
};

class Ramp final : public Field {
  public:
    Ramp(dvec3 direction, const PhantomGrid& grid) : direction_(direction) {
        double reach = glm::dot(glm::abs(direction), grid.reach());
        // A grid without extent along the ramp holds its middle.
        range_ = reach > 0 ? ValueRange{-reach, reach} : ValueRange{-1, 1};
    }
    double value(dvec3 p) const override {
        return direction_.x * p.x + (direction_.y * p.y + direction_.z * p.z);
    }
    dvec3 gradient(dvec3) const override { return direction_; }
    ValueRange natural() const override { return range_; }

  private:
    dvec3 direction_;
    ValueRange range_;
};

class SphereDistance final : public Field {
  public:
    SphereDistance(dvec3 centre, double travel, double radius, double scale,
                   const PhantomGrid& grid)
        : centre_(centre), radius_(radius), scale_(scale) {
        const double far = glm::length(grid.reach()) + travel;  // of the farthest corner
        range_ = {-radius * scale, std::max(far - radius, 0.0) * scale};
        if (range_.extent() <= 0) range_ = {-scale, scale};
    }
    double value(dvec3 p) const override {
        dvec3 q = p - centre_;
        return (std::sqrt(q.x * q.x + (q.y * q.y + q.z * q.z)) - radius_) * scale_;
    }
    dvec3 gradient(dvec3 p) const override {
        double r = glm::length(p - centre_);
        return r > 0 ? (p - centre_) * (scale_ / r) : dvec3(0.0);
    }
    ValueRange natural() const override { return range_; }

  protected:
    void row(std::span<const double> x, double y, double z, double* out) const override {
        const double qy = y - centre_.y, qz = z - centre_.z;
        sphere_row(x.data(), x.size(), centre_.x, qy * qy + qz * qz, radius_, scale_, out);
    }

  private:
    dvec3 centre_;
    double radius_, scale_;
    ValueRange range_;
};

class Constant final : public Field {
  public:
    explicit Constant(double value) : value_(value) {}
    double value(dvec3) const override { return value_; }
    dvec3 gradient(dvec3) const override { return dvec3(0.0); }
    ValueRange natural() const override { return {value_, value_}; }
    ValueRange stored_range(ScalarType) const override { return {value_, value_}; }

  private:
    double value_;
};

class Impulse final : public Field {
  public:
    Impulse(Index3 at, const PhantomGrid& grid) : at_(at), grid_(grid) {}
    double value(dvec3 p) const override { return hat(0, p.x) * hat(1, p.y) * hat(2, p.z); }
    dvec3 gradient(dvec3 p) const override {
        return {slope(0, p.x) * hat(1, p.y) * hat(2, p.z),
                hat(0, p.x) * slope(1, p.y) * hat(2, p.z),
                hat(0, p.x) * hat(1, p.y) * slope(2, p.z)};
    }
    ValueRange natural() const override { return {0, 1}; }

  protected:
    void row(std::span<const double> x, double y, double z, double* out) const override {
        std::fill_n(out, x.size(), 0.0);
        if (!hits(1, y) || !hits(2, z)) return;
        for (std::size_t i = 0; i < x.size(); ++i) out[i] = hits(0, x[i]) ? 1.0 : 0.0;
    }

  private:
    double offset(int axis, double p) const { return grid_.index(axis, p) - double(at_[axis]); }
    bool hits(int axis, double p) const { return std::abs(offset(axis, p)) < 0.5; }
    double hat(int axis, double p) const { return std::max(0.0, 1 - std::abs(offset(axis, p))); }
    double slope(int axis, double p) const {
        double t = offset(axis, p);
        return std::abs(t) < 1 ? (t > 0 ? -1 : 1) / grid_.step[axis] : 0.0;
    }
    Index3 at_;
    PhantomGrid grid_;
};

class Checkerboard final : public Field {
  public:
    explicit Checkerboard(const PhantomGrid& grid) : grid_(grid) {}
    double value(dvec3 p) const override { return wave(0, p.x) * wave(1, p.y) * wave(2, p.z); }
    dvec3 gradient(dvec3 p) const override {
        return {slope(0, p.x) * wave(1, p.y) * wave(2, p.z),
                wave(0, p.x) * slope(1, p.y) * wave(2, p.z),
                wave(0, p.x) * wave(1, p.y) * slope(2, p.z)};
    }
    ValueRange natural() const override { return {-1, 1}; }

  protected:
    void row(std::span<const double> x, double y, double z, double* out) const override {
        // At the voxels the cosines are exact.
        const std::int64_t yz = whole(1, y) + whole(2, z);
        for (std::size_t i = 0; i < x.size(); ++i)
            out[i] = ((whole(0, x[i]) + yz) & 1) ? -1.0 : 1.0;
    }

  private:
    std::int64_t whole(int axis, double p) const { return std::llround(grid_.index(axis, p)); }
    double wave(int axis, double p) const { return cos_turns(0.5 * grid_.index(axis, p)); }
    double slope(int axis, double p) const {
        return -kPi / grid_.step[axis] * sin_turns(0.5 * grid_.index(axis, p));
    }
    PhantomGrid grid_;
};

class Step final : public Field {
  public:
    Step(int axis, std::int64_t first_high, const PhantomGrid& grid)
        : axis_(axis), jump_(grid.coordinate(axis, double(first_high) - 0.5)) {}
    double value(dvec3 p) const override { return p[axis_] >= jump_ ? 1.0 : 0.0; }
    dvec3 gradient(dvec3) const override { return dvec3(0.0); }
    ValueRange natural() const override { return {0, 1}; }

  private:
    int axis_;
    double jump_;
};

class Shells final : public Field {
  public:
    Shells(double count, double phase) : count_(count), phase_(phase) {}
    double value(dvec3 p) const override {
        return cos_turns(count_ * std::sqrt(p.x * p.x + (p.y * p.y + p.z * p.z)) - phase_);
    }
    dvec3 gradient(dvec3 p) const override {
        double r = glm::length(p);
        if (r <= 0) return dvec3(0.0);
        return p * (-2 * kPi * count_ * sin_turns(count_ * r - phase_) / r);
    }
    ValueRange natural() const override { return {-1, 1}; }

  protected:
    void row(std::span<const double> x, double y, double z, double* out) const override {
        shells_row(x.data(), x.size(), y * y + z * z, count_, phase_, out);
    }

  private:
    double count_, phase_;
};

class PlaneWaves final : public Field {
  public:
    PlaneWaves(int count, double fraction, std::uint64_t seed, double turn, const PhantomGrid& grid)
        : gain_(1.0 / std::max(count, 1)) {
        // In turns a phantom unit: half a turn a voxel is the band limit, along the coarsest axis.
        const double limit = fraction * 0.5 / std::max({grid.step.x, grid.step.y, grid.step.z});
        const double c = std::cos(turn), s = std::sin(turn);
        SeededNumbers random(seed);
        for (int k = 0; k < count; ++k) {
            const double z = 2 * random.next() - 1, angle = 2 * kPi * random.next();
            const double radius = limit * std::cbrt(random.next());  // uniform in the ball
            const double flat = std::sqrt(std::max(0.0, 1 - z * z));
            const dvec3 w(flat * std::cos(angle), flat * std::sin(angle), z);
            waves_.push_back(
                {radius * dvec3(c * w.x - s * w.y, s * w.x + c * w.y, w.z), random.next()});
        }
    }
    // The same products as row(): cos(a + b) = cos a cos b - sin a sin b.
    double value(dvec3 p) const override {
        double sum = 0;
        for (const Wave& wave : waves_) {
            const double a = wave.turns.x * p.x, b = rest(wave, p.y, p.z);
            sum += gain_ * cos_turns(b) * cos_turns(a) - gain_ * sin_turns(b) * sin_turns(a);
        }
        return sum;
    }
    dvec3 gradient(dvec3 p) const override {
        dvec3 sum(0.0);
        for (const Wave& wave : waves_)
            sum -= wave.turns *
                   (2 * kPi * gain_ * sin_turns(wave.turns.x * p.x + rest(wave, p.y, p.z)));
        return sum;
    }
    ValueRange natural() const override { return {-1, 1}; }

    std::unique_ptr<Rows> rows(std::span<const double> x) const override {
        return std::make_unique<Tables>(*this, x);
    }

  private:
    struct Wave {
        dvec3 turns;  // omega / (2 pi)
        double phase;
    };
    static double rest(const Wave& wave, double y, double z) {
        return wave.turns.y * y + wave.turns.z * z + wave.phase;
    }

    class Tables final : public Rows {
      public:
        Tables(const PlaneWaves& field, std::span<const double> x) : field_(field), n_(x.size()) {
            cosine_.reserve(n_ * field.waves_.size());
            sine_.reserve(n_ * field.waves_.size());
            for (const Wave& wave : field.waves_)
                for (double at : x) {
                    cosine_.push_back(cos_turns(wave.turns.x * at));
                    sine_.push_back(sin_turns(wave.turns.x * at));
                }
        }
        void row(double y, double z, double* out) const override {
            std::fill_n(out, n_, 0.0);
            for (std::size_t k = 0; k < field_.waves_.size(); ++k) {
                const double b = rest(field_.waves_[k], y, z);
                add_wave(cosine_.data() + k * n_, sine_.data() + k * n_, n_,
                         field_.gain_ * cos_turns(b), field_.gain_ * sin_turns(b), out);
            }
        }

      private:
        const PlaneWaves& field_;
        std::size_t n_;
        std::vector<double> cosine_, sine_;
    };

    std::vector<Wave> waves_;
    double gain_;
};

class Blend final : public Field {
  public:
    Blend(FieldPtr a, FieldPtr b, double t) : a_(std::move(a)), b_(std::move(b)), t_(t) {}
    double value(dvec3 p) const override { return (1 - t_) * a_->value(p) + t_ * b_->value(p); }
    dvec3 gradient(dvec3 p) const override {
        return (1 - t_) * a_->gradient(p) + t_ * b_->gradient(p);
    }
    ValueRange natural() const override {
        return {std::min(a_->natural().min, b_->natural().min),
                std::max(a_->natural().max, b_->natural().max)};
    }
    std::unique_ptr<Rows> rows(std::span<const double> x) const override {
        return std::make_unique<Both>(a_->rows(x), b_->rows(x), t_, x.size());
    }

  private:
    class Both final : public Rows {
      public:
        Both(std::unique_ptr<Rows> a, std::unique_ptr<Rows> b, double t, std::size_t n)
            : a_(std::move(a)), b_(std::move(b)), t_(t), n_(n) {}
        void row(double y, double z, double* out) const override {
            std::vector<double> other(n_);
            a_->row(y, z, out);
            b_->row(y, z, other.data());
            for (std::size_t i = 0; i < n_; ++i) out[i] = (1 - t_) * out[i] + t_ * other[i];
        }

      private:
        std::unique_ptr<Rows> a_, b_;
        double t_;
        std::size_t n_;
    };

    FieldPtr a_, b_;
    double t_;
};

}  // namespace

glm::dvec3 PhantomGrid::reach() const {
    return glm::max((glm::dvec3(dims) - 1.0) * 0.5, glm::dvec3(0.0)) * step;
}

ValueRange Field::stored_range(ScalarType type) const {
    if (is_float(type)) return natural();
    auto [lo, hi] = limits_of(type);
    return {lo, hi};
}

std::unique_ptr<Field::Rows> Field::rows(std::span<const double> x) const {
    class Direct final : public Rows {
      public:
        Direct(const Field& field, std::span<const double> at) : field_(field), x_(at) {}
        void row(double y, double z, double* out) const override { field_.row(x_, y, z, out); }

      private:
        const Field& field_;
        std::span<const double> x_;
    };
    return std::make_unique<Direct>(*this, x);
}

void Field::row(std::span<const double> x, double y, double z, double* out) const {
    for (std::size_t i = 0; i < x.size(); ++i) out[i] = value({x[i], y, z});
}

FieldPtr marschner_lobb_field(double frequency, double alpha) {
    return std::make_shared<MarschnerLobb>(frequency, alpha);
}
FieldPtr ramp_field(dvec3 direction, const PhantomGrid& grid) {
    return std::make_shared<Ramp>(direction, grid);
}
FieldPtr sphere_distance_field(dvec3 centre, double travel, double radius, double scale,
                               const PhantomGrid& grid) {
    return std::make_shared<SphereDistance>(centre, travel, radius, scale, grid);
}
FieldPtr constant_field(double value) {
    return std::make_shared<Constant>(value);
}
FieldPtr impulse_field(Index3 at, const PhantomGrid& grid) {
    return std::make_shared<Impulse>(at, grid);
}
FieldPtr checkerboard_field(const PhantomGrid& grid) {
    return std::make_shared<Checkerboard>(grid);
}
FieldPtr step_field(int axis, std::int64_t first_high, const PhantomGrid& grid) {
    return std::make_shared<Step>(axis, first_high, grid);
}
FieldPtr shells_field(double count, double phase) {
    return std::make_shared<Shells>(count, phase);
}
FieldPtr plane_waves_field(int count, double fraction, std::uint64_t seed, double turn,
                           const PhantomGrid& grid) {
    return std::make_shared<PlaneWaves>(count, fraction, seed, turn, grid);
}
FieldPtr blend_field(FieldPtr a, FieldPtr b, double t) {
    return std::make_shared<Blend>(std::move(a), std::move(b), t);
}

}  // namespace voxloom
