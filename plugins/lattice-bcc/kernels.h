// Reconstruction between the sites of a body-centred cubic lattice.
//
// Points are in index coordinates of grid A. All kernels are continuous, and give constants and linear functions exactly.
//
//   half          A alone, trilinear                                        a preview from half of the samples
//   average       (A + B) / 2, both trilinear                               2 texture fetches; does not interpolate
//   cosine        w A + (1 - w) B, w = 1/2 + (cos 2 pi x + cos 2 pi y + cos 2 pi z) / 6
//   linear-box    the tetrahedron of four sites around the point            4 point fetches
//   dc-spline     trilinear on the grid of half the spacing, whose other nodes are means of two neighbours
//   cosine-corrected   cosine, of A and B less their second differences: exact for quadratic functions
//   cubic         mean of the cubic B-splines of both grids, of prefiltered samples: order 4; does not interpolate
//
// Sources: average: Roeber, Hadwiger, Entezari, Moeller, Texture Based Volume Rendering of Hexagonal Data Sets; cosine:
// Csebfalvi, Cosine-Weighted B-Spline Interpolation: A Fast and High-Quality Reconstruction Scheme for the Body-Centered Cubic
// Lattice, TVCG 2013; linear-box: Entezari, Dyer, Moeller, Linear and Cubic Box Splines for the Body Centered Cubic Lattice, IEEE
// Visualization 2004; dc-spline: Domonkos, Csebfalvi, DC-Splines, VMV 2010.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <string_view>

#include "plugins/lattice-bcc/bcc.h"

namespace voxloom::bcc {

enum class Kernel { half, average, cosine, linear_box, dc_spline, cosine_corrected, cubic };
inline constexpr int kKernels = 7;
std::string_view name_of(Kernel kernel);
std::optional<Kernel> kernel_named(std::string_view name);

struct Cell {
    std::int64_t x, y, z;
    glm::dvec3 t;
};
// Without std::floor and std::lerp, which without newer instructions are calls and branches.
inline Cell cell_of(glm::dvec3 p) {
    const auto below = [](double v) {
        const auto i = std::int64_t(v);
        return i - (v < double(i));
    };
    const std::int64_t x = below(p.x), y = below(p.y), z = below(p.z);
    return {x, y, z, p - glm::dvec3(double(x), double(y), double(z))};
}
inline double mix(double a, double b, double t) { return a + t * (b - a); }

// S is Samples, or InnerSamples where the point is inside. p in index coordinates of the grid itself.
template <class S>
double trilinear(const S& s, int grid, glm::dvec3 p) {
    const auto [x, y, z, t] = cell_of(p);
    const auto row = [&](std::int64_t j, std::int64_t k) { return mix(s.at(grid, x, j, k), s.at(grid, x + 1, j, k), t.x); };
    return mix(mix(row(y, z), row(y + 1, z), t.y), mix(row(y, z + 1), row(y + 1, z + 1), t.y), t.z);
}

inline double cosine_weight(glm::dvec3 p) {
    const glm::dvec3 c = glm::cos(2 * std::numbers::pi * p);
    return 0.5 + (c.x + c.y + c.z) / 6;
}

// The sites around p in whose tetrahedron it lies, with their weights.
struct Site {
    int grid;
    glm::i64vec3 at;
    double weight;
};
inline std::array<Site, 4> tetrahedron(glm::dvec3 p) {
    const auto [x, y, z, t] = cell_of(p + 0.5);
    const glm::dvec3 u = t - 0.5;
    int order[3] = {0, 1, 2};
    std::sort(order, order + 3, [&](int i, int k) { return std::abs(u[i]) > std::abs(u[k]) || (std::abs(u[i]) == std::abs(u[k]) && i < k); });
    const double high = std::abs(u[order[0]]), middle = std::abs(u[order[1]]), low = std::abs(u[order[2]]);
    const glm::i64vec3 a0(x, y, z);
    glm::i64vec3 a1 = a0, b0 = a0;
    a1[order[0]] += u[order[0]] < 0 ? -1 : 1;
    for (int i = 0; i < 3; ++i)
        if (u[i] < 0) --b0[i];
    glm::i64vec3 b1 = b0;
    b1[order[2]] += u[order[2]] < 0 ? 1 : -1;
    return {{{0, a0, 1 - high - middle}, {0, a1, high - middle}, {1, b0, middle + low}, {1, b1, middle - low}}};
}

// A node of the grid of half the spacing; i counts halves of A's spacing.
template <class S>
double half_step_node(const S& s, glm::i64vec3 i) {
    const int odd[3] = {int(i.x & 1), int(i.y & 1), int(i.z & 1)};
    const int sum = odd[0] + odd[1] + odd[2];
    const auto site = [&](glm::i64vec3 n) { return s.at(int(n.x & 1), n.x >> 1, n.y >> 1, n.z >> 1); };
    if (sum == 0 || sum == 3) return site(i);
    // The axis on which it differs from the two others leads to a site on either side.
    const int lone = sum == 1 ? 1 : 0, axis = odd[0] == lone ? 0 : odd[1] == lone ? 1 : 2;
    glm::i64vec3 below = i, above = i;
    --below[axis], ++above[axis];
    return 0.5 * (site(below) + site(above));
}

// The cubic B-spline on a grid of coefficients.
template <class S>
double cubic_spline(const S& s, int grid, glm::dvec3 p) {
    const auto [x, y, z, t] = cell_of(p);
    const auto weights = [](double u) {
        const double v = 1 - u;
        return std::array<double, 4>{v * v * v / 6, (4 - 6 * u * u + 3 * u * u * u) / 6, (4 - 6 * v * v + 3 * v * v * v) / 6, u * u * u / 6};
    };
    const auto wx = weights(t.x), wy = weights(t.y), wz = weights(t.z);
    double sum = 0;
    for (int k = 0; k < 4; ++k)
        for (int j = 0; j < 4; ++j) {
            double row = 0;
            for (int i = 0; i < 4; ++i) row += wx[std::size_t(i)] * s.at(grid, x + i - 1, y + j - 1, z + k - 1);
            sum += wz[std::size_t(k)] * wy[std::size_t(j)] * row;
        }
    return sum;
}

// Trilinear less its leading error: t (1 - t) / 2 of each axis' second difference, itself interpolated.
template <class S>
double corrected_trilinear(const S& s, int grid, glm::dvec3 p) {
    const auto [x, y, z, t] = cell_of(p);
    // Of four in a row, the second difference between the two in the middle.
    const auto bend = [](double a, double b, double c, double d, double u) { return mix(a - 2 * b + c, b - 2 * c + d, u); };
    double v[4][4], bends[2][2];  // rows at p.x: by y, then by z; the corners are not needed
    for (int j = 0; j < 4; ++j)
        for (int k = 0; k < 4; ++k) {
            const bool middle_j = j == 1 || j == 2, middle_k = k == 1 || k == 2;
            if (!middle_j && !middle_k) continue;
            const auto at = [&](int i) { return s.at(grid, x + i, y + j - 1, z + k - 1); };
            const double b = at(0), c = at(1);
            v[j][k] = mix(b, c, t.x);
            if (middle_j && middle_k) bends[j - 1][k - 1] = bend(at(-1), b, c, at(2), t.x);
        }
    const auto line = [&](int k) { return mix(v[1][k], v[2][k], t.y); };
    const double value = mix(line(1), line(2), t.z);
    const double in_x = mix(mix(bends[0][0], bends[1][0], t.y), mix(bends[0][1], bends[1][1], t.y), t.z);
    const double in_y = mix(bend(v[0][1], v[1][1], v[2][1], v[3][1], t.y), bend(v[0][2], v[1][2], v[2][2], v[3][2], t.y), t.z);
    const double in_z = bend(line(0), line(1), line(2), line(3), t.z);
    return value - 0.5 * (t.x * (1 - t.x) * in_x + t.y * (1 - t.y) * in_y + t.z * (1 - t.z) * in_z);
}

// The value at p. `cubic` takes the coefficients of with_coefficients() for the samples.
template <Kernel kernel, class S>
double reconstruct(const S& s, glm::dvec3 p) {
    const glm::dvec3 q = p - 0.5;  // in index coordinates of B
    if constexpr (kernel == Kernel::half) {
        return trilinear(s, 0, p);
    } else if constexpr (kernel == Kernel::average) {
        return 0.5 * (trilinear(s, 0, p) + trilinear(s, 1, q));
    } else if constexpr (kernel == Kernel::cosine) {
        return mix(trilinear(s, 1, q), trilinear(s, 0, p), cosine_weight(p));
    } else if constexpr (kernel == Kernel::linear_box) {
        double sum = 0;
        for (const Site& site : tetrahedron(p)) sum += site.weight * s.at(site.grid, site.at.x, site.at.y, site.at.z);
        return sum;
    } else if constexpr (kernel == Kernel::dc_spline) {
        const auto [x, y, z, t] = cell_of(2.0 * p);
        const auto row = [&](std::int64_t j, std::int64_t k) { return mix(half_step_node(s, {x, j, k}), half_step_node(s, {x + 1, j, k}), t.x); };
        return mix(mix(row(y, z), row(y + 1, z), t.y), mix(row(y, z + 1), row(y + 1, z + 1), t.y), t.z);
    } else if constexpr (kernel == Kernel::cosine_corrected) {
        return mix(corrected_trilinear(s, 1, q), corrected_trilinear(s, 0, p), cosine_weight(p));
    } else {
        return 0.5 * (cubic_spline(s, 0, p) + cubic_spline(s, 1, q));
    }
}

// The same of what is valid alone: the weights of the tetrahedron's other sites are shared out; NaN where none is left.
template <class T>
double reconstruct_valid(const Samples<T>& s, glm::dvec3 p) {
    double sum = 0, weight = 0;
    for (const Site& site : tetrahedron(p)) {
        const double v = s.at(site.grid, site.at.x, site.at.y, site.at.z);
        if (!(site.weight > 0) || !std::isfinite(v)) continue;
        sum += site.weight * v;
        weight += site.weight;
    }
    return weight > 0 ? sum / weight : std::numeric_limits<double>::quiet_NaN();
}

// What `cubic` needs: each sample and its eight nearest, c = (7 f - (their sum) / 2) / 3.
template <class T>
Samples<T> with_coefficients(const Samples<T>& samples, const std::stop_token& stop);

// Calls f with the kernel as a constant: f.template operator()<kernel>().
template <class F>
void with_kernel(Kernel kernel, F&& f) {
    switch (kernel) {
        case Kernel::half: return f.template operator()<Kernel::half>();
        case Kernel::average: return f.template operator()<Kernel::average>();
        case Kernel::cosine: return f.template operator()<Kernel::cosine>();
        case Kernel::linear_box: return f.template operator()<Kernel::linear_box>();
        case Kernel::dc_spline: return f.template operator()<Kernel::dc_spline>();
        case Kernel::cosine_corrected: return f.template operator()<Kernel::cosine_corrected>();
        case Kernel::cubic: return f.template operator()<Kernel::cubic>();
    }
}

}  // namespace voxloom::bcc
