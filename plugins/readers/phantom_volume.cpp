#include "plugins/readers/phantom_volume.h"

#include <cmath>
#include <limits>
#include <vector>

#include "core/base/parallel.h"
#include "plugins/readers/phantom_random.h"

namespace voxloom {

namespace {

// Rows for about a millisecond of work: long enough to amortise a task, short enough to cancel.
constexpr std::int64_t kVoxelsPerTask = 1 << 16;
// Longer rows are computed in parts, so that tables along them stay small.
constexpr std::int64_t kMostColumns = 1 << 16;

// Streams of seeded numbers, so that noise, specials and mask do not hang together.
constexpr std::uint64_t kNoiseStream = 0x6e6f, kSpecialStream = 0x7370, kMaskStream = 0x6d61;

inline double clamped(double v, double lo, double hi) {
    return v < lo ? lo : v > hi ? hi : v;
}

// Scales, rounds half to even and clamps. Written so that it vectorises without SSE 4: adding
// 1.5 * 2^52 rounds every |v| < 2^51.
template <class T>
inline void store(const double* v, std::size_t n, double gain, double offset, T* out) {
    if constexpr (std::is_floating_point_v<T>) {
        for (std::size_t i = 0; i < n; ++i) out[i] = T(v[i] * gain + offset);
    } else {
        constexpr double shifter = 6755399441055744.0;
        constexpr double lo = double(std::numeric_limits<T>::lowest());
        constexpr double hi = double(std::numeric_limits<T>::max());
        using Wide = std::conditional_t<sizeof(T) == 4, std::int64_t, std::int32_t>;
        for (std::size_t i = 0; i < n; ++i)
            out[i] = T(Wide((clamped(v[i] * gain + offset, lo, hi) + shifter) - shifter));
    }
}
#define VOXLOOM_STORE(T)                                                                    \
    VOXLOOM_WIDE void store_row(const double* v, std::size_t n, double gain, double offset, \
                                T* out) {                                                   \
        store(v, n, gain, offset, out);                                                     \
    }
VOXLOOM_STORE(std::uint8_t)
VOXLOOM_STORE(std::int8_t)
VOXLOOM_STORE(std::uint16_t)
VOXLOOM_STORE(std::int16_t)
VOXLOOM_STORE(std::uint32_t)
VOXLOOM_STORE(std::int32_t)
VOXLOOM_STORE(float)
VOXLOOM_STORE(double)
#undef VOXLOOM_STORE

template <class T>
T special_value(Special kind, std::uint64_t bits) {
    const T sign = bits & 1 ? T(-1) : T(1);
    switch (kind) {
        case Special::inf:
            return sign * std::numeric_limits<T>::infinity();
        case Special::denormal:
            return sign * std::numeric_limits<T>::denorm_min() * T(1 + (bits >> 1) % 1000);
        default:
            return std::numeric_limits<T>::quiet_NaN();
    }
}

// Whether the seeded number falls into the share; the share is kept to 53 bits.
inline bool falls_in(std::uint64_t bits, double share) {
    return unit_number(bits) < share;
}

class Phantom final : public Volume {
  public:
    Phantom(VolumeDesc desc, FieldPtr field, const PhantomGrid& grid, const PhantomFinish& finish)
        : Volume(std::move(desc)), field_(std::move(field)), grid_(grid), finish_(finish) {
        if (finish_.noise > 0) return;
        const glm::dmat4 to_index = glm::inverse(this->desc().index_to_world);
        const glm::dmat3 to_phantom =
            glm::dmat3(grid.step.x, 0, 0, 0, grid.step.y, 0, 0, 0, grid.step.z) *
            glm::dmat3(to_index);
        auto phantom_point = [to_index, grid](glm::dvec3 world) {
            const glm::dvec3 i = glm::dvec3(to_index * glm::dvec4(world, 1.0));
            return glm::dvec3(grid.coordinate(0, i.x), grid.coordinate(1, i.y),
                              grid.coordinate(2, i.z));
        };
        closed_.value = [f = field_, gain = finish.gain, offset = finish.offset, phantom_point](
                            glm::dvec3 w) { return f->value(phantom_point(w)) * gain + offset; };
        closed_.gradient = [f = field_, gain = finish.gain, transposed = glm::transpose(to_phantom),
                            phantom_point](glm::dvec3 w) {
            return transposed * (f->gradient(phantom_point(w)) * gain);
        };
    }

    void read(const Box& box, std::span<std::byte> out,
              const std::stop_token& stop) const override {
        if (box.empty()) return;
        for (std::int64_t x = box.lo.x; x < box.hi.x; x += kMostColumns)
            read_columns(box, x, std::min(x + kMostColumns, box.hi.x), out, stop);
    }

    void read_mask(const Box& box, std::span<std::uint8_t> out) const override {
        const Index3 n = box.dims();
        const std::uint64_t seed = finish_.seed ^ kMaskStream;
        parallel_for(
            0, box.empty() ? 0 : n.y * n.z,
            std::max<std::int64_t>(1, kVoxelsPerTask / std::max<std::int64_t>(n.x, 1)),
            [&](std::int64_t from, std::int64_t to) {
                for (std::int64_t r = from; r < to; ++r) {
                    const std::uint64_t at = number_of(box.lo + Index3(0, r % n.y, r / n.y));
                    for (std::int64_t i = 0; i < n.x; ++i)
                        out[std::size_t(r * n.x + i)] = !falls_in(
                            seeded_bits(seed, at + std::uint64_t(i)), finish_.masked_share);
                }
            });
    }

    const ClosedForm* closed_form() const override { return closed_.value ? &closed_ : nullptr; }

  private:
    // Columns [from_x, to_x) of the box. Tables along x are as long as these columns, no longer.
    void read_columns(const Box& box, std::int64_t from_x, std::int64_t to_x,
                      std::span<std::byte> out, const std::stop_token& stop) const {
        const Index3 n = box.dims();
        std::vector<double> x;
        for (std::int64_t i = from_x; i < to_x; ++i) x.push_back(grid_.coordinate(0, double(i)));
        const std::unique_ptr<Field::Rows> rows = field_->rows(x);
        parallel_for(
            0, n.y * n.z, std::max<std::int64_t>(1, kVoxelsPerTask / (to_x - from_x)),
            [&](std::int64_t from, std::int64_t to) {
                std::vector<double> values(x.size());
                for (std::int64_t r = from; r < to; ++r) {
                    check_stop(stop);
                    const Index3 first(from_x, box.lo.y + r % n.y, box.lo.z + r / n.y);
                    rows->row(grid_.coordinate(1, double(first.y)),
                              grid_.coordinate(2, double(first.z)), values.data());
                    const std::int64_t at = r * n.x + from_x - box.lo.x;
                    finish(first, values, out.data() + std::size_t(at) * desc().voxel_bytes());
                }
            },
            stop);
    }

    std::uint64_t number_of(Index3 i) const {
        return std::uint64_t((i.z * desc().dims.y + i.y) * desc().dims.x + i.x);
    }

    void finish(Index3 first, std::vector<double>& values, std::byte* out) const {
        const std::uint64_t at = number_of(first);
        if (finish_.noise > 0)
            for (std::size_t i = 0; i < values.size(); ++i)
                values[i] +=
                    finish_.noise * seeded_noise(seeded_bits(finish_.seed ^ kNoiseStream, at + i));
        with_type(desc().type, [&](auto t) {
            using T = decltype(t);
            T* typed = reinterpret_cast<T*>(out);
            store_row(values.data(), values.size(), finish_.gain, finish_.offset, typed);
            if constexpr (std::is_floating_point_v<T>) {
                if (finish_.special == Special::none) return;
                for (std::size_t i = 0; i < values.size(); ++i) {
                    const std::uint64_t bits = seeded_bits(finish_.seed ^ kSpecialStream, at + i);
                    if (falls_in(bits, finish_.special_share))
                        typed[i] = special_value<T>(finish_.special, scatter(bits));
                }
            }
        });
    }

    FieldPtr field_;
    PhantomGrid grid_;
    PhantomFinish finish_;
    ClosedForm closed_;
};

}  // namespace

VolumePtr make_phantom(VolumeDesc desc, FieldPtr field, const PhantomGrid& grid,
                       PhantomFinish finish) {
    desc.dense_bytes();  // an Error where it does not fit
    return std::make_shared<Phantom>(std::move(desc), std::move(field), grid, finish);
}

}  // namespace voxloom
