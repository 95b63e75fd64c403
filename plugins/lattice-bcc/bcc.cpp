#include "plugins/lattice-bcc/bcc.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "core/base/parallel.h"
#include "core/data/convert.h"

namespace voxloom::bcc {

GridDims grid_dims(Index3 n, double step) {
    GridDims dims;
    for (int a = 0; a < 3; ++a) {
        if (n[a] < 1) return {};
        const double length = double(n[a] - 1) / step + 1e-9;  // a site on the last voxel counts
        dims.a[a] = std::int64_t(std::floor(length)) + 1;
        dims.b[a] = std::max(std::int64_t(std::floor(length - 0.5)) + 1, std::int64_t(1));
    }
    return dims;
}

LatticeDesc lattice_desc(const VolumeDesc& volume, double step, ScalarType type) {
    const GridDims dims = grid_dims(volume.dims, step);
    LatticeDesc lattice;
    lattice.kind = "bcc";
    for (const int grid : {0, 1}) {
        VolumeDesc desc = volume;
        desc.dims = grid == 0 ? dims.a : dims.b;
        desc.type = type;
        desc.significant_bits = 0;  // splines overshoot
        desc.range.reset();
        desc.has_mask = volume.has_mask && !is_float(type);  // floats have NaN for it
        const double first = grid == 0 ? 0 : 0.5 * step;
        desc.index_to_world[3] = volume.index_to_world * glm::dvec4(glm::dvec3(first), 1);
        for (int a = 0; a < 3; ++a) desc.index_to_world[a] = volume.index_to_world[a] * step;
        (void)desc.dense_bytes();
        lattice.grids.push_back({desc, glm::dvec3(grid == 0 ? 0.0 : 0.5), 0});
    }
    return lattice;
}

std::string problem_with(const LatticeDesc& lattice) {
    if (lattice.kind != "bcc" || lattice.grids.size() != 2)
        return fmt::format("it takes a body-centred cubic lattice, and this is {}; put bcc.resample before", lattice.kind.empty() ? "another one" : lattice.kind);
    const auto* a = std::get_if<VolumeDesc>(&lattice.grids[0].grid.detail);
    const auto* b = std::get_if<VolumeDesc>(&lattice.grids[1].grid.detail);
    if (!a || !b) return "it takes a lattice whose grids are volumes";
    if (a->components != b->components || a->type != b->type) return "the grids of the lattice have samples of two kinds";
    if ((a->voxels() == 0) != (b->voxels() == 0)) return "one of the lattice's grids is empty";
    if (lattice.grids[1].offset != glm::dvec3(0.5)) return "the second grid of the lattice is not in the middle of the first one's cells";
    return {};
}

template <class T>
Samples<T> load(const Lattice& lattice, int component, const std::stop_token& stop) {
    Samples<T> samples;
    for (const int grid : {0, 1}) {
        const VolumePtr volume = in_memory(std::get<VolumePtr>(lattice.grids()[std::size_t(grid)]), stop);
        const VolumeDesc& desc = volume->desc();
        samples.dims[grid] = desc.dims;
        samples.values[grid].resize(std::size_t(desc.voxels()));
        const auto slice = std::size_t(desc.dims.x * desc.dims.y), components = std::size_t(desc.components);
        parallel_for(0, desc.dims.z, 1, [&](std::int64_t lo, std::int64_t hi) {
            std::vector<double> values(slice * components);
            std::vector<std::uint8_t> valid(desc.has_mask ? slice : 0);
            for (std::int64_t z = lo; z < hi; ++z) {
                const std::size_t first = std::size_t(z) * slice;
                to_double(desc.type, volume->data() + first * desc.voxel_bytes(), values.size(), values.data());
                if (desc.has_mask) volume->read_mask({{0, 0, z}, {desc.dims.x, desc.dims.y, z + 1}}, valid);
                for (std::size_t i = 0; i < slice; ++i) {
                    const double v = desc.has_mask && !valid[i] ? std::numeric_limits<double>::quiet_NaN() : values[i * components + std::size_t(component)];
                    samples.values[grid][first + i] = T(std::isfinite(v) ? v : std::numeric_limits<double>::quiet_NaN());
                }
            }
        }, stop);
    }
    return samples;
}

template Samples<float> load(const Lattice&, int, const std::stop_token&);
template Samples<double> load(const Lattice&, int, const std::stop_token&);

}  // namespace voxloom::bcc
