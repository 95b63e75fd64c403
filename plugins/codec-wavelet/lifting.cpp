#include "plugins/codec-wavelet/lifting.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>

namespace voxloom::wavelet {

namespace {

// Sums wrap as the hardware's do: corrupt data must not be undefined behaviour.
template <class T>
T plus(T a, T b) {
    using U = std::make_unsigned_t<T>;
    return T(U(U(a) + U(b)));
}
template <class T>
T minus(T a, T b) {
    using U = std::make_unsigned_t<T>;
    return T(U(U(a) - U(b)));
}
template <class T>
T predicted(T left, T right, T p) {
    return T(plus(plus(left, right), p) >> 1);
}
template <class T>
T updated(T left, T right) {
    return T(plus(plus(left, right), T(2)) >> 2);
}

struct Shared {
    bool lo, hi;
};
Shared at_ends(const Ends& shared, int axis) { return {shared.lo[axis], shared.hi[axis]}; }

// One line along x, from `in` to `out`, which do not overlap.
template <class T>
inline __attribute__((always_inline)) void forward_line(const T* __restrict in, T* __restrict out, int n, T p, Shared shared) {
    const int low = (n + 1) / 2, high = n / 2;
    T* s = out;
    T* d = out + low;
    const int inner = (n - 1) / 2;  // odd samples that have an even one on both sides
    for (int i = 0; i < inner; ++i) d[i] = minus(in[2 * i + 1], predicted(in[2 * i], in[2 * i + 2], p));
    if (inner < high) d[inner] = minus(in[n - 1], predicted(in[n - 2], in[n - 2], p));
    s[0] = plus(in[0], updated(d[0], d[0]));
    for (int i = 1; i < high; ++i) s[i] = plus(in[2 * i], updated(d[i - 1], d[i]));
    if (high < low) s[high] = plus(in[2 * high], updated(d[high - 1], d[high - 1]));
    if (shared.lo) s[0] = in[0];
    if (shared.hi) s[low - 1] = in[n - 1];
}

template <class T>
inline __attribute__((always_inline)) void inverse_line(const T* __restrict in, T* __restrict out, int n, T p, Shared shared, T* __restrict even) {
    const int low = (n + 1) / 2, high = n / 2;
    const T* s = in;
    const T* d = in + low;
    even[0] = minus(s[0], updated(d[0], d[0]));
    for (int i = 1; i < high; ++i) even[i] = minus(s[i], updated(d[i - 1], d[i]));
    if (high < low) even[high] = minus(s[high], updated(d[high - 1], d[high - 1]));
    if (shared.lo) even[0] = s[0];
    if (shared.hi) even[low - 1] = s[low - 1];
    const int inner = (n - 1) / 2;
    for (int i = 0; i < inner; ++i) {
        out[2 * i] = even[i];
        out[2 * i + 1] = plus(d[i], predicted(even[i], even[i + 1], p));
    }
    if (inner < high) {
        out[n - 2] = even[inner];
        out[n - 1] = plus(d[inner], predicted(even[inner], even[inner], p));
    } else {
        out[n - 1] = even[inner];
    }
}

// Families of full size, by far the most, have lines of a length that the compiler knows here.
template <class T>
void forward_lines(const T* __restrict in, T* __restrict out, int n, T p, Shared shared) {
    if (n == 32)
        forward_line(in, out, 32, p, shared);
    else
        forward_line(in, out, n, p, shared);
}
template <class T>
void inverse_lines(const T* __restrict in, T* __restrict out, int n, T p, Shared shared, T* __restrict even) {
    if (n == 32)
        inverse_line(in, out, 32, p, shared, even);
    else
        inverse_line(in, out, n, p, shared, even);
}

// The same across n rows of `width` samples, so that the inner loops run along the rows.
template <class T>
void forward_rows(const T* __restrict in, T* __restrict out, int n, std::size_t width, T p, Shared shared) {
    const int low = (n + 1) / 2, high = n / 2;
    auto source = [&](int i) { return in + std::size_t(i) * width; };
    T* const s = out;
    T* const d = out + std::size_t(low) * width;
    for (int i = 0; i < high; ++i) {
        const T* here = source(2 * i + 1);
        const T* left = source(2 * i);
        const T* right = source(2 * i + 2 < n ? 2 * i + 2 : 2 * i);
        T* to = d + std::size_t(i) * width;
        for (std::size_t x = 0; x < width; ++x) to[x] = minus(here[x], predicted(left[x], right[x], p));
    }
    for (int i = 0; i < low; ++i) {
        const T* here = source(2 * i);
        const T* left = d + std::size_t(i > 0 ? i - 1 : 0) * width;
        const T* right = d + std::size_t(i < high ? i : high - 1) * width;
        T* to = s + std::size_t(i) * width;
        for (std::size_t x = 0; x < width; ++x) to[x] = plus(here[x], updated(left[x], right[x]));
    }
    if (shared.lo) std::copy_n(source(0), width, s);
    if (shared.hi) std::copy_n(source(n - 1), width, s + std::size_t(low - 1) * width);
}

template <class T>
void inverse_rows(const T* __restrict in, T* __restrict out, int n, std::size_t width, T p, Shared shared) {
    const int low = (n + 1) / 2, high = n / 2;
    const T* const s = in;
    const T* const d = in + std::size_t(low) * width;
    auto target = [&](int i) { return out + std::size_t(i) * width; };
    for (int i = 0; i < low; ++i) {
        const T* here = s + std::size_t(i) * width;
        const T* left = d + std::size_t(i > 0 ? i - 1 : 0) * width;
        const T* right = d + std::size_t(i < high ? i : high - 1) * width;
        T* to = target(2 * i);
        for (std::size_t x = 0; x < width; ++x) to[x] = minus(here[x], updated(left[x], right[x]));
    }
    if (shared.lo) std::copy_n(s, width, target(0));
    if (shared.hi) std::copy_n(s + std::size_t(low - 1) * width, width, target(n - 1));
    for (int i = 0; i < high; ++i) {
        const T* here = d + std::size_t(i) * width;
        const T* left = target(2 * i);
        const T* right = target(2 * i + 2 < n ? 2 * i + 2 : 2 * i);
        T* to = target(2 * i + 1);
        for (std::size_t x = 0; x < width; ++x) to[x] = plus(here[x], predicted(left[x], right[x], p));
    }
}

// The axes that take part. Those across rows go to and fro between box and scratch; lines along x, which a small
// buffer holds, are worked on in place or lead to the other side, so that the result ends up in the box.
template <class T>
struct Passes {
    std::size_t width, plane, all;
    bool x, y, z;
    Passes(glm::ivec3 dims, glm::bvec3 halved, std::vector<T>& scratch)
        : width(std::size_t(dims.x)), plane(width * std::size_t(dims.y)), all(plane * std::size_t(dims.z)),
          x(halved.x && dims.x > 1), y(halved.y && dims.y > 1), z(halved.z && dims.z > 1) {
        scratch.resize(std::max(scratch.size(), all + 2 * width));
    }
    bool odd() const { return y != z; }
};

}  // namespace

template <class T>
void forward(T* box, glm::ivec3 dims, glm::bvec3 halved, Rounding rounding, std::vector<T>& scratch,
             Ends shared) {
    const Passes<T> passes(dims, halved, scratch);
    const T p = T(rounding);
    T* const line = scratch.data() + passes.all;
    T* from = box;
    T* to = scratch.data();
    if (passes.x) {
        T* const out = passes.odd() ? to : box;
        for (std::size_t row = 0; row < passes.all; row += passes.width) {
            std::copy_n(box + row, passes.width, line);
            forward_lines(line, out + row, dims.x, p, at_ends(shared, 0));
        }
        if (passes.odd()) std::swap(from, to);
    }
    if (passes.y) {
        for (std::size_t z = 0; z < passes.all; z += passes.plane)
            forward_rows(from + z, to + z, dims.y, passes.width, p, at_ends(shared, 1));
        std::swap(from, to);
    }
    if (passes.z) {
        forward_rows(from, to, dims.z, passes.plane, p, at_ends(shared, 2));
        std::swap(from, to);
    }
    if (from != box) std::memcpy(box, from, passes.all * sizeof(T));
}

template <class T>
void inverse(T* box, glm::ivec3 dims, glm::bvec3 halved, Rounding rounding, std::vector<T>& scratch,
             Ends shared) {
    const Passes<T> passes(dims, halved, scratch);
    const T p = T(rounding);
    T* const line = scratch.data() + passes.all;
    T* from = box;
    T* to = scratch.data();
    if (passes.z) {
        inverse_rows(from, to, dims.z, passes.plane, p, at_ends(shared, 2));
        std::swap(from, to);
    }
    if (passes.y) {
        for (std::size_t z = 0; z < passes.all; z += passes.plane)
            inverse_rows(from + z, to + z, dims.y, passes.width, p, at_ends(shared, 1));
        std::swap(from, to);
    }
    if (passes.x) {
        for (std::size_t row = 0; row < passes.all; row += passes.width) {
            std::copy_n(from + row, passes.width, line);
            inverse_lines(line, box + row, dims.x, p, at_ends(shared, 0), line + passes.width);
        }
        return;
    }
    if (from != box) std::memcpy(box, from, passes.all * sizeof(T));
}

template void forward<std::int16_t>(std::int16_t*, glm::ivec3, glm::bvec3, Rounding, std::vector<std::int16_t>&, Ends);
template void inverse<std::int16_t>(std::int16_t*, glm::ivec3, glm::bvec3, Rounding, std::vector<std::int16_t>&, Ends);
template void forward<std::int32_t>(std::int32_t*, glm::ivec3, glm::bvec3, Rounding, std::vector<std::int32_t>&, Ends);
template void inverse<std::int32_t>(std::int32_t*, glm::ivec3, glm::bvec3, Rounding, std::vector<std::int32_t>&, Ends);

double peak_after(double min, double max) {
    const double centre = (min + max) / 2, half = (max - min) / 2;
    const double low = std::abs(centre) + 1.836 * 1.836 * 1.836 * half;
    const double high = 2.970 * 2.970 * 2.970 * half;
    // Predict adds two neighbours before it halves them; roundings add up to a few units.
    return std::max(2 * low, 2 * high) + 16;
}

}  // namespace voxloom::wavelet
