#include <algorithm>
#include <atomic>
#include <cmath>

#include "core/base/parallel.h"
#include "core/data/convert.h"
#include "plugins/lattice-bcc/kernels.h"
#include "plugins/lattice-bcc/nodes.h"

namespace voxloom::bcc {

namespace {

constexpr const char* kMethod = R"(
**Method.** Values between the sites of the lattice, at the voxels of a Cartesian grid: `like` another volume, or of its own spacing.

| kernel | samples a value | interpolates | order |
|---|---|---|---|
| half | 8 of A | A alone | 2 |
| average | 8 of A, 8 of B | no | 2 |
| cosine | 8 of A, 8 of B | yes | 2 |
| linear-box | 4 | yes | 2 |
| dc-spline | 14 | yes | 2 |
| cosine-corrected | 2 × 7 trilinear | yes | 3 |
| cubic | 64 of A, 64 of B | no, quasi | 4 |

`average` is the mean of both grids' trilinear interpolation. At sites it returns the mean of a sample and its
neighbours: resolution is lost, and no prefilter brings it back, for its response is 0 at one frequency of the band.
`linear-box` has 56 to 80 % of its error, from 4 samples. Where a kernel meets samples that are not valid the linear box of the valid
ones takes its place; NaN, or 0 of integers, where there is none.

**When to use.** To measure reconstruction against the volume, or to hand a lattice to nodes that take volumes. **When not.** In
front of a node that takes lattices.

**Reference.** Csébfalvi: Cosine-Weighted B-Spline Interpolation, TVCG 2013 (cosine); Entezari, Dyer, Möller: Linear and Cubic Box
Splines for the Body Centered Cubic Lattice, IEEE Visualization 2004 (linear-box); Domonkos, Csébfalvi: DC-Splines, VMV
2010 (dc-spline).)";

// The grid that is filled, of a lattice whose grid A is `a`.
VolumeDesc filled_desc(const Params& params, const LatticeDesc& lattice, const VolumeDesc* like) {
    const VolumeDesc &a = *lattice.grids[0].grid.volume(), &b = *lattice.grids[1].grid.volume();
    VolumeDesc desc = a;
    if (like) {
        desc.dims = like->dims;
        desc.index_to_world = like->index_to_world;
    } else {
        const double step = params.real("step");
        for (int i = 0; i < 3; ++i) {
            // Up to the last site of either grid, but that an axis of one A has one voxel.
            const double length = a.dims[i] > 1 ? std::max(double(a.dims[i] - 1), double(b.dims[i]) - 0.5) : 0;
            desc.dims[i] = a.dims[i] < 1 ? 0 : std::int64_t(std::floor(length / step + 1e-9)) + 1;
            desc.index_to_world[i] = a.index_to_world[i] * step;
        }
    }
    if (params.text("type") == "float" && !is_float(a.type)) {
        desc.type = bytes_of(a.type) < 4 ? ScalarType::f32 : ScalarType::f64;
    }
    desc.has_mask = false;
    desc.range.reset();
    (void)desc.dense_bytes();
    return desc;
}

const LatticeDesc* lattice_of(const ValueDesc* value) {
    const auto* lattice = value ? std::get_if<std::shared_ptr<const LatticeDesc>>(&value->detail) : nullptr;
    return lattice ? lattice->get() : nullptr;
}

void describe_reconstruct(Description& d) {
    d.output("volume", PortType::volume);
    const LatticeDesc* lattice = lattice_of(d.input("lattice"));
    const ValueDesc* like = d.input("like");
    if (!lattice || (like && !like->volume())) return;
    if (std::string problem = problem_with(*lattice); !problem.empty()) return d.problem(std::move(problem), "lattice");
    try {
        d.output("volume", filled_desc(d.params(), *lattice, like ? like->volume() : nullptr));
        std::uint64_t sites = 0;
        for (const LatticeDesc::Grid& grid : lattice->grids) sites += grid.grid.volume()->voxels();
        d.working_memory(2 * sites * sizeof(double));
    } catch (const Error& e) {
        d.problem(e.what());
    }
}

// The point itself near the lattice; further off one where the last samples are continued, as they are there, in numbers that
// indices can hold.
template <class T>
glm::dvec3 within_reach(const Samples<T>& samples, glm::dvec3 p) {
    constexpr double kBeyond = 4;
    const glm::dvec3 most(glm::max(samples.dims[0], samples.dims[1]));
    for (int a = 0; a < 3; ++a) p[a] = p[a] > -kBeyond ? std::min(p[a], most[a] + kBeyond) : -kBeyond;
    return p;
}

// One component of the volume from the lattice's. `to_a` maps voxels to index coordinates of grid A.
template <class T>
void fill(const Samples<T>& samples, Kernel kernel, const glm::dmat4& to_a, const VolumeDesc& desc, int component, Buffer& voxels, Evaluation& e) {
    const Samples<T> coefficients = kernel == Kernel::cubic ? with_coefficients(samples, e.stop()) : Samples<T>();
    const Samples<T>& source = kernel == Kernel::cubic ? coefficients : samples;
    const InnerSamples<T> inner(source);
    const std::size_t row = std::size_t(desc.dims.x), value_bytes = bytes_of(desc.type);
    std::atomic<std::int64_t> rows{0};
    with_kernel(kernel, [&]<Kernel k>() {
        parallel_for(0, desc.dims.y * desc.dims.z, 8, [&](std::int64_t lo, std::int64_t hi) {
            std::vector<double> values(row);
            std::vector<std::byte> bytes(row * value_bytes);
            for (std::int64_t line = lo; line < hi; ++line) {
                const glm::dvec4 first = to_a * glm::dvec4(0, double(line % desc.dims.y), double(line / desc.dims.y), 1);
                for (std::size_t x = 0; x < row; ++x) {
                    const glm::dvec3 p = within_reach(samples, glm::dvec3(first + double(x) * to_a[0]));
                    double v = inner.holds(p) ? reconstruct<k>(inner, p) : reconstruct<k>(source, p);
                    if (!std::isfinite(v)) v = reconstruct_valid(samples, p);
                    values[x] = v;
                }
                from_double(values.data(), row, desc.type, bytes.data());
                std::byte* out = voxels.data() + (std::size_t(line) * row * std::size_t(desc.components) + std::size_t(component)) * value_bytes;
                for (std::size_t x = 0; x < row; ++x) std::copy_n(bytes.data() + x * value_bytes, value_bytes, out + x * std::size_t(desc.components) * value_bytes);
                rows += 1;
            }
            e.progress((double(component) + double(rows) / double(desc.dims.y * desc.dims.z)) / double(desc.components), "reconstructing");
        }, e.stop());
    });
}

void evaluate_reconstruct(Evaluation& e) {
    check_stop(e.stop());
    const LatticePtr lattice = e.input<Lattice>("lattice");
    const VolumePtr like = e.input<Volume>("like");
    const VolumeDesc& a = *lattice->desc().grids[0].grid.volume();
    VolumeDesc desc = filled_desc(e.params(), lattice->desc(), like ? &like->desc() : nullptr);
    if (a.voxels() == 0 && desc.voxels() > 0) fail("the lattice is empty, and the volume that it is to be like is not");
    const Kernel kernel = *kernel_named(e.params().text("kernel"));
    const glm::dmat4 to_a = glm::inverse(a.index_to_world) * desc.index_to_world;
    Buffer voxels(desc.dense_bytes(), "volume");
    for (int c = 0; c < desc.components && desc.voxels() > 0; ++c) {
        // Integers of up to 16 bits and short floats are exact as floats.
        if (bytes_of(a.type) < 4 || a.type == ScalarType::f32)
            fill(load<float>(*lattice, c, e.stop()), kernel, to_a, desc, c, voxels, e);
        else
            fill(load<double>(*lattice, c, e.stop()), kernel, to_a, desc, c, voxels, e);
    }
    e.output("volume", VolumePtr(std::make_shared<DenseVolume>(std::move(desc), std::move(voxels))));
}

}  // namespace

NodeType reconstruct_node() {
    NodeType node;
    node.id = "bcc.reconstruct";
    node.title = "Reconstruct from BCC";
    node.doc = "Fills a Cartesian volume from a body-centred cubic lattice, by one of several reconstruction kernels.";
    node.keywords = {"lattice", "body-centred", "bcc", "interpolation", "box spline", "cosine-weighted", "kernel"};
    node.inputs = {{"lattice", PortType::lattice, "A lattice of bcc.resample."},
                   {"like", PortType::volume, "The volume whose voxels' places are filled, to be compared with it.", true}};
    node.outputs = {{"volume", PortType::volume, "What the kernel gives at each voxel."}};
    std::vector<std::string> kernels;
    for (int k = 0; k < kKernels; ++k) kernels.emplace_back(name_of(Kernel(k)));
    node.params = {
        param::choice("kernel", kernels, "linear-box", "How values between the sites come about.").is_quality(),
        param::real("step", 1 / kSameBand, "Spacing of the voxels over that of the lattice's grids; not used where `like` is wired.").range(0.05, 4).slider(0.25, 1.5),
        param::choice("type", {"source", "float"}, "source", "Type of the voxels: that of the lattice, rounded, or floats."),
    };
    node.method = kMethod;
    node.describe = describe_reconstruct;
    node.evaluate = evaluate_reconstruct;
    return node;
}

}  // namespace voxloom::bcc
