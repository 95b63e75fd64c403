#include <map>

#include "plugins/lattice-bcc/nodes.h"
#include "plugins/lattice-bcc/resample.h"

namespace voxloom::bcc {

namespace {

constexpr const char* kMethod = R"(
**Method.** The body-centred cubic lattice is a Cartesian grid A and a second one, B, in the middle of its cells. With A's spacing √2
times the volume's (`step: 1`) the same ball of frequencies is free of aliases, and 1/√2 = 71 % of the samples do. Of n voxels along an
axis A takes ⌊(n−1)/√2⌋+1 sites and B ⌊(n−1)/√2−½⌋+1; the first site of A is the first voxel. With anisotropic spacing the ball is an
ellipsoid.

Values between voxels come from the cubic B-spline through them (natural at the ends), from Catmull-Rom splines, or
linearly; of a volume that is a formula (readers.phantom) they are the formula's, so that nothing but the lattice is measured.
A site near voxels that are not finite or masked out takes the mean of the valid ones of its eight neighbours, weighted
trilinearly; where there is none it is NaN, or masked out.

**When to use.** To compare lattices at equal memory or equal bandwidth. **When not.** For finite differences, or where others must read
the samples: few programs know the lattice. `filter: linear` blurs; it is there to show how much.

**Reference.** Theußl, Möller, Gröller: Optimal Regular Volume Sampling, IEEE Visualization 2001; Röber, Hadwiger, Entezari,
Möller: Texture Based Volume Rendering of Hexagonal Data Sets.)";

const std::map<std::string, std::optional<Filter>>& filters() {
    static const std::map<std::string, std::optional<Filter>> all = {
        {"b-spline", Filter::b_spline}, {"catmull-rom", Filter::catmull_rom}, {"linear", Filter::linear}, {"closed-form", std::nullopt}};
    return all;
}

ResampleOptions options_of(const Params& params, ScalarType type) {
    ResampleOptions options;
    options.filter = filters().at(params.text("filter"));
    options.step = kSameBand * params.real("step");
    options.type = type;
    if (params.text("type") == "float" && !is_float(type)) options.type = bytes_of(type) < 4 ? ScalarType::f32 : ScalarType::f64;
    return options;
}

void describe_resample(Description& d) {
    d.output("lattice", PortType::lattice);
    const ValueDesc* input = d.input("volume");
    const VolumeDesc* volume = input ? input->volume() : nullptr;
    if (!volume) return;
    try {
        const ResampleOptions options = options_of(d.params(), volume->type);
        LatticeDesc lattice = lattice_desc(*volume, options.step, options.type);
        const Index3 a = lattice.grids[0].grid.volume()->dims;
        const std::uint64_t sites = is_float(volume->type) || volume->has_mask ? 4 : 1;  // as many arrays of them at a time
        d.working_memory(checked_product(a, 8 * (sites + std::uint64_t(volume->components)), "the lattice") +
                         checked_product({a.x, a.y, volume->dims.z}, 8, "the lattice"));
        d.output("lattice", std::move(lattice));
    } catch (const Error& e) {
        d.problem(e.what());
    }
}

void evaluate_resample(Evaluation& e) {
    VolumePtr volume = e.input<Volume>("volume");
    if (!volume->reads_by_region()) volume = in_memory(volume, e.stop());
    const LatticePtr lattice = resample(*volume, options_of(e.params(), volume->desc().type), e.stop(),
                                        [&](double fraction) { e.progress(fraction, "resampling"); });
    std::uint64_t samples = 0;
    for (const LatticeDesc::Grid& grid : lattice->desc().grids) samples += grid.grid.volume()->voxels();
    e.count("samples", double(samples));
    if (volume->desc().voxels() > 0) e.measure("samples per voxel", double(samples) / double(volume->desc().voxels()));
    e.output("lattice", lattice);
}

}  // namespace

NodeType resample_node() {
    NodeType node;
    node.id = "bcc.resample";
    node.title = "Resample to BCC";
    node.doc = "Samples a volume on a body-centred cubic lattice, which holds the same band of frequencies in 71 % of the samples.";
    node.keywords = {"lattice", "body-centred", "optimal sampling", "bcc", "cartesian", "sphere packing"};
    node.inputs = {{"volume", PortType::volume, "What is sampled."}};
    node.outputs = {{"lattice", PortType::lattice, "Two interleaved grids: A, and B in the middle of its cells."}};
    node.params = {
        param::choice("filter", {"b-spline", "catmull-rom", "linear", "closed-form"}, "b-spline",
                      "Where values between voxels come from; closed-form takes them from the formula of a volume that has one."),
        param::real("step", 1, "Spacing of the lattice over that of the same band, √2 voxels; 0.891 gives as many samples as voxels.")
            .range(0.1, 1).is_quality(),
        param::choice("type", {"source", "float"}, "source", "Type of the samples: that of the volume, rounded, or floats, which hold overshoots and fractions."),
    };
    node.method = kMethod;
    node.describe = describe_resample;
    node.evaluate = evaluate_resample;
    return node;
}

}  // namespace voxloom::bcc
