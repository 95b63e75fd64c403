// One step of refinement: a parent's low band and seven (or fewer) bands of details give its children.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>

#include "plugins/codec-wavelet/lifting.h"

namespace voxloom::wavelet {

// Bit a of a band's mask: high along axis a. Mask 0 is the low band.
struct Band {
    int mask = 0;
    glm::ivec3 lo{0}, dims{0};  // where it stands in the family's box
};

// Axes that are not halved keep all samples in the low band. In the details they are correlated all the
// same, so there they are split once more: such a band's mask has the bit of a split axis beside
// that of a halved one.
struct Shape {
    glm::ivec3 dims{1};    // voxels of the children together
    glm::bvec3 halved{false};
    glm::bvec3 split{false};
    Ends shared{};         // faces that a neighbouring family has, too

    glm::ivec3 low() const { return low_dims(dims, halved); }
    std::size_t voxels() const { return std::size_t(dims.x) * std::size_t(dims.y) * std::size_t(dims.z); }
    std::size_t at(glm::ivec3 i) const {
        return (std::size_t(i.z) * std::size_t(dims.y) + std::size_t(i.y)) * std::size_t(dims.x) + std::size_t(i.x);
    }
    Band band(int mask) const {
        Band b{mask, glm::ivec3(0), mask ? low_dims(dims, glm::bvec3(glm::ivec3(halved) | glm::ivec3(split))) : low()};
        for (int a = 0; a < 3; ++a)
            if (mask >> a & 1) {
                b.lo[a] = b.dims[a];
                b.dims[a] = halved[a] || split[a] ? dims[a] - b.dims[a] : 0;
            }
        if (mask && !(mask & bits(halved))) b.dims = glm::ivec3(0);
        return b;
    }
    bool has(const Band& b) const { return b.dims.x > 0 && b.dims.y > 0 && b.dims.z > 0; }
    static int bits(glm::bvec3 axes) { return axes.x | axes.y << 1 | axes.z << 2; }
};

// The order in which bands are coded: those with one high axis first, since the others lean on them.
inline constexpr std::array<int, 7> kBandOrder = {1, 2, 4, 3, 5, 6, 7};

// Norms of the synthesis functions of the 5/3, squared, after j halvings of an axis: scaling
// (2N^2 + 1) / (3N) with N = 2^j, wavelet 23/32, 59/64, ... tending to 0.1875 * 2^j.
double scaling_norm(int j);
double wavelet_norm(int j);

// Norm of a coefficient of a band on level 0. fine_stride is the children's: 2^(times halved); `axes` are
// those halved or split.
double band_norm(int mask, glm::ivec3 fine_stride, glm::bvec3 axes);

// Where to cut n samples of an axis into pieces of at most `step`, 0 and n included. A shared end is a piece of its
// own, so that whatever is done piece by piece does the same to a shared face on both of its sides.
std::vector<int> cuts(int n, bool shared_lo, bool shared_hi, int step);

// The transform of lifting.h, and of the details along the split axes.
void split_family(std::int32_t* box, const Shape& shape, Rounding rounding, std::vector<std::int32_t>& scratch);
void join_family(std::int32_t* box, const Shape& shape, Rounding rounding, std::vector<std::int32_t>& scratch);

// The quantised details of one component of a family: what an entropy coder turns into bytes.
struct Details {
    Shape shape;
    // shape.voxels() numbers in the layout of lifting.h; the low band is not looked at.
    std::int32_t* q = nullptr;
    // The parent's decoded samples, shape.low() of them: known to the decoder, so contexts may use it.
    const std::int32_t* low = nullptr;
    std::array<double, 8> step{1, 1, 1, 1, 1, 1, 1, 1};  // of each mask
    bool finest = false;  // the children are level 0
};

// Calls row(first number, count) for every row of a band, and of all bands of details.
template <class Row>
void for_each_row(const Details& d, const Band& b, const Row& row) {
    if (!d.shape.has(b)) return;
    for (int z = 0; z < b.dims.z; ++z)
        for (int y = 0; y < b.dims.y; ++y)
            row(d.q + d.shape.at(b.lo + glm::ivec3(0, y, z)), std::size_t(b.dims.x));
}
template <class Row>
void for_each_row(const Details& d, const Row& row) {
    for (int mask : kBandOrder) for_each_row(d, d.shape.band(mask), row);
}

}  // namespace voxloom::wavelet
