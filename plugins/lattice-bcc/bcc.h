// The body-centred cubic lattice: a Cartesian grid A, and a grid B in the middle of its cells.
//
// In index coordinates of A its sites are the integers, those of B the integers plus one half on every axis. Its dual is
// face-centred cubic, so that with A's spacing sqrt(2) times that of a Cartesian grid the same ball of frequencies is free of
// aliases, and 1/sqrt(2) of the samples do (Theussl, Moeller, Groeller: Optimal Regular Volume Sampling, IEEE Visualization
// 2001). Anisotropic spacing makes an ellipsoid of the ball.
#pragma once

#include <vector>

#include "core/data/value.h"

namespace voxloom::bcc {

inline constexpr double kSameBand = 1.4142135623730951;  // A's spacing over that of the volume

// Samples of the two grids for n Cartesian ones that span the same, with A's spacing `step` of theirs. A grid without
// any would tell nothing of a volume that is one voxel thick: B has at least one where there is a volume.
struct GridDims {
    Index3 a{0}, b{0};
};
GridDims grid_dims(Index3 n, double step);

// The lattice that such a volume is resampled onto: A's first sample is the volume's first voxel. Throws Error where it
// would be too large.
LatticeDesc lattice_desc(const VolumeDesc& volume, double step, ScalarType type);

// Why this is no such lattice of two volumes, or empty.
std::string problem_with(const LatticeDesc& lattice);

// One component of both grids, to reconstruct from. T holds every value exactly; what is not valid is NaN.
template <class T>
struct Samples {
    Index3 dims[2]{};
    std::vector<T> values[2];

    // Beyond the ends the last sample is continued.
    double at(int grid, std::int64_t x, std::int64_t y, std::int64_t z) const {
        const Index3& n = dims[grid];
        const auto inside = [](std::int64_t i, std::int64_t count) { return i < 0 ? 0 : i >= count ? count - 1 : i; };
        return double(values[grid][std::size_t((inside(z, n.z) * n.y + inside(y, n.y)) * n.x + inside(x, n.x))]);
    }
};

// The same without the ends, for points that are further than `kReach` samples from all of them: about twice as fast.
inline constexpr double kReach = 3;
template <class T>
struct InnerSamples {
    explicit InnerSamples(const Samples<T>& samples) : dims{samples.dims[0], samples.dims[1]}, values{samples.values[0].data(), samples.values[1].data()} {}
    double at(int grid, std::int64_t x, std::int64_t y, std::int64_t z) const { return double(values[grid][(z * dims[grid].y + y) * dims[grid].x + x]); }
    bool holds(glm::dvec3 p) const {
        const glm::dvec3 last(glm::min(dims[0], dims[1]) - std::int64_t(1));
        return glm::all(glm::greaterThan(p, glm::dvec3(kReach))) && glm::all(glm::lessThan(p, last - kReach));
    }

    Index3 dims[2];
    const T* values[2];
};

// Reads a component of both grids into memory.
template <class T>
Samples<T> load(const Lattice& lattice, int component, const std::stop_token& stop);

}  // namespace voxloom::bcc
