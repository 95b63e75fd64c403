#include "core/data/convert.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

#include "core/base/buffer.h"

namespace voxloom {

namespace {

template <class T>
T narrowed(double v) {
    constexpr double lo = double(std::numeric_limits<T>::lowest());
    constexpr double hi = double(std::numeric_limits<T>::max());
    if constexpr (std::is_floating_point_v<T>) {
        return std::isinf(v) ? T(v) : T(v < lo ? lo : v > hi ? hi : v);
    } else {
        v = v == v ? v : 0.0;
        v = v < lo ? lo : v > hi ? hi : v;
        return T(round_half_to_even(v));
    }
}

template <class From, class To>
void clamp_integers(const From* from, std::size_t count, To* to) {
    using Wide = std::conditional_t<sizeof(From) < 4 && sizeof(To) < 4, std::int32_t, std::int64_t>;
    constexpr auto lo = Wide(std::numeric_limits<To>::lowest()), hi = Wide(std::numeric_limits<To>::max());
    for (std::size_t i = 0; i < count; ++i) to[i] = To(std::clamp(Wide(from[i]), lo, hi));
}

// Calls with(T()) where the type is one of integers; false where it is not.
template <class With>
bool with_integer(ScalarType type, const With& with) {
    with_type(type, [&](auto t) {
        if constexpr (std::is_integral_v<decltype(t)>) with(t);
    });
    return !is_float(type);
}

// Calls with(From(), To()) where both types are of integers; false where one is not.
template <class With>
bool with_integers(ScalarType from, ScalarType to, const With& with) {
    return !is_float(to) && with_integer(from, [&](auto f) { with_integer(to, [&](auto t) { with(f, t); }); });
}

}  // namespace

void to_double(ScalarType type, const std::byte* from, std::size_t count, double* to) {
    with_type(type, [&](auto t) {
        const auto* values = reinterpret_cast<const decltype(t)*>(from);
        for (std::size_t i = 0; i < count; ++i) to[i] = double(values[i]);
    });
}

void from_double(const double* from, std::size_t count, ScalarType type, std::byte* to) {
    with_type(type, [&](auto t) {
        using T = decltype(t);
        T* values = reinterpret_cast<T*>(to);
        for (std::size_t i = 0; i < count; ++i) values[i] = narrowed<T>(from[i]);
    });
}

void convert(ScalarType from_type, const std::byte* from, ScalarType to_type, std::byte* to,
             std::size_t count) {
    if (from_type == to_type) {
        std::memcpy(to, from, count * bytes_of(from_type));
        return;
    }
    // Several times faster than through double.
    if (with_integers(from_type, to_type, [&](auto f, auto t) {
            clamp_integers(reinterpret_cast<const decltype(f)*>(from), count, reinterpret_cast<decltype(t)*>(to));
        }))
        return;
    constexpr std::size_t kChunk = 512;
    double values[kChunk];
    for (std::size_t i = 0; i < count; i += kChunk) {
        const std::size_t n = std::min(kChunk, count - i);
        to_double(from_type, from + i * bytes_of(from_type), n, values);
        from_double(values, n, to_type, to + i * bytes_of(to_type));
    }
}

void convert_box(const Box& box, ScalarType from_type, const std::byte* from, const Box& from_box,
                 ScalarType to_type, std::byte* to, const Box& to_box, int components) {
    const std::size_t from_bytes = bytes_of(from_type) * std::size_t(components);
    const std::size_t to_bytes = bytes_of(to_type) * std::size_t(components);
    if (from_type == to_type) {
        copy_box(box, from, from_box, to, to_box, from_bytes);
        return;
    }
    if (box.empty()) return;
    assert(from_box.contains(box) && to_box.contains(box));
    const Index3 fd = from_box.dims(), td = to_box.dims();
    const std::size_t row = std::size_t(box.dims().x) * std::size_t(components);
    const auto each_row = [&](auto&& convert_row) {
        for (std::int64_t z = box.lo.z; z < box.hi.z; ++z)
            for (std::int64_t y = box.lo.y; y < box.hi.y; ++y) {
                const Index3 f = Index3(box.lo.x, y, z) - from_box.lo;
                const Index3 t = Index3(box.lo.x, y, z) - to_box.lo;
                convert_row(from + std::size_t((f.z * fd.y + f.y) * fd.x + f.x) * from_bytes,
                            to + std::size_t((t.z * td.y + t.y) * td.x + t.x) * to_bytes);
            }
    };
    // The types are looked at once: rows of bricks are short.
    if (with_integers(from_type, to_type, [&](auto f, auto t) {
            each_row([&](const std::byte* a, std::byte* b) {
                clamp_integers(reinterpret_cast<const decltype(f)*>(a), row, reinterpret_cast<decltype(t)*>(b));
            });
        }))
        return;
    each_row([&](const std::byte* a, std::byte* b) { convert(from_type, a, to_type, b, row); });
}

}  // namespace voxloom
