#include "plugins/codec-wavelet/family.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace voxloom::wavelet {

double scaling_norm(int j) {
    const double n = std::ldexp(1.0, j);
    return std::sqrt((2 * n * n + 1) / (3 * n));
}

double wavelet_norm(int j) {
    static constexpr double kSquared[] = {0,           23.0 / 32,    59.0 / 64,      203.0 / 128,
                                          779.0 / 256, 3083.0 / 512, 12299.0 / 1024, 49163.0 / 2048};
    if (j < 8) return std::sqrt(kSquared[j]);
    return std::sqrt(0.1875 * std::ldexp(1.0, j));
}

double band_norm(int mask, glm::ivec3 fine_stride, glm::bvec3 axes) {
    double norm = 1;
    for (int a = 0; a < 3; ++a) {
        const int before = std::bit_width(unsigned(fine_stride[a])) - 1;
        norm *= mask >> a & 1 ? wavelet_norm(before + 1) : scaling_norm(before + (axes[a] ? 1 : 0));
    }
    return norm;
}

std::vector<int> cuts(int n, bool shared_lo, bool shared_hi, int step) {
    std::vector<int> at{0};
    const int last = shared_hi ? n - 1 : n;
    if (shared_lo && n > 1) at.push_back(1);
    while (at.back() < last) at.push_back(std::min(at.back() + step, last));
    if (at.back() < n) at.push_back(n);
    return at;
}

namespace {

// Calls transform(dense copy, its dims) for what each set of halved high axes covers, and puts it back.
template <class Transform>
void each_detail_box(std::int32_t* box, const Shape& shape, const Transform& transform) {
    if (!glm::any(shape.split)) return;
    const Shape whole{shape.dims, shape.halved};
    std::vector<std::int32_t> copy;
    for (int mask : kBandOrder) {
        const Band b = whole.band(mask);
        if (!whole.has(b)) continue;
        copy.resize(std::size_t(b.dims.x) * std::size_t(b.dims.y) * std::size_t(b.dims.z));
        auto rows = [&](auto&& move) {
            std::size_t at = 0;
            for (int z = 0; z < b.dims.z; ++z)
                for (int y = 0; y < b.dims.y; ++y, at += std::size_t(b.dims.x))
                    move(box + whole.at(b.lo + glm::ivec3(0, y, z)), copy.data() + at);
        };
        rows([&](std::int32_t* in_box, std::int32_t* in_copy) { std::copy_n(in_box, b.dims.x, in_copy); });
        transform(copy.data(), b.dims);
        rows([&](std::int32_t* in_box, std::int32_t* in_copy) { std::copy_n(in_copy, b.dims.x, in_box); });
    }
}

}  // namespace

void split_family(std::int32_t* box, const Shape& shape, Rounding rounding, std::vector<std::int32_t>& scratch) {
    forward(box, shape.dims, shape.halved, rounding, scratch, shape.shared);
    each_detail_box(box, shape, [&](std::int32_t* part, glm::ivec3 dims) {
        forward(part, dims, shape.split, rounding, scratch, shape.shared);
    });
}

void join_family(std::int32_t* box, const Shape& shape, Rounding rounding, std::vector<std::int32_t>& scratch) {
    each_detail_box(box, shape, [&](std::int32_t* part, glm::ivec3 dims) {
        inverse(part, dims, shape.split, rounding, scratch, shape.shared);
    });
    inverse(box, shape.dims, shape.halved, rounding, scratch, shape.shared);
}

}  // namespace voxloom::wavelet
