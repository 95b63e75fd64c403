#include "plugins/codec-wavelet/family.h"

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

double band_norm(int mask, glm::ivec3 fine_stride, glm::bvec3 halved) {
    double norm = 1;
    for (int a = 0; a < 3; ++a) {
        const int before = std::bit_width(unsigned(fine_stride[a])) - 1;
        norm *= mask >> a & 1 ? wavelet_norm(before + 1) : scaling_norm(before + (halved[a] ? 1 : 0));
    }
    return norm;
}

}  // namespace voxloom::wavelet
