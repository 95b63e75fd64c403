// The nodes readers.phantom and readers.phantom-series: parameters to fields, fields to volumes.
#include "plugins/readers/phantom.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "plugins/readers/phantom_random.h"
#include "plugins/readers/phantom_volume.h"

namespace voxloom {

namespace {

constexpr double kPi = 3.14159265358979323846;

// ---- the grid, the same for both nodes ---------------------------------------------------------

std::vector<std::string> type_names() {
    std::vector<std::string> names;
    for (int i = 0; i < kScalarTypes; ++i) names.emplace_back(name_of(ScalarType(i)));
    return names;
}

void add_grid_params(std::vector<ParamSpec>& params, std::vector<double> dims) {
    params.insert(
        params.end(),
        {
            param::vector("dims", std::move(dims), "Voxels along x, y and z.")
                .range(0, 1e9)
                .slider(1, 512)
                .whole()
                .in_unit("voxels")
                .in_group("grid"),
            param::choice("type", type_names(), "u8", "Scalar type of the voxels.")
                .in_group("grid"),
            param::vector("spacing", {1, 1, 1}, "World length from voxel to voxel along each axis.")
                .range(1e-90, 1e90)
                .slider(0.1, 10, Scale::logarithmic)
                .in_group("grid"),
            param::vector("origin", {0, 0, 0}, "World position of the first voxel.")
                .range(-1e90, 1e90)
                .in_group("grid"),
            param::vector("rotation", {0, 0, 1, 0},
                          "Turn of the grid in the world about its first voxel: an axis and an "
                          "angle in degrees.")
                .range(-1e6, 1e6)
                .in_group("grid"),
            param::text("unit", "", "Unit of world lengths.").in_group("grid"),
            param::choice(
                "fit", {"inside", "outside", "stretch"}, "inside",
                "How the phantom's cube meets a grid that is none: inside it, around it, or "
                "stretched over it axis by axis.")
                .in_group("grid"),
            param::real(
                "low", 0,
                "Stored value of the phantom's smallest value; low and high equal: the full range "
                "of integer types, the natural one of floats.")
                .range(-1e90, 1e90)
                .in_group("values"),
            param::real("high", 0, "Stored value of the phantom's largest value.")
                .range(-1e90, 1e90)
                .in_group("values"),
        });
}

struct Grid {
    VolumeDesc desc;
    PhantomGrid phantom;
    double scale = 1;  // world length of a phantom unit (the smallest one when stretched)
};

// Throws Error for what no single parameter's range can say.
Grid grid_of(const Params& params) {
    Grid grid;
    VolumeDesc& desc = grid.desc;
    desc.dims = params.index3("dims");
    desc.type = *scalar_type_named(params.text("type"));
    desc.unit = params.text("unit");
    const glm::dvec3 spacing = params.vec3("spacing");
    const std::vector<double>& turn = params.numbers("rotation");
    const glm::dvec3 axis(turn[0], turn[1], turn[2]);
    glm::dmat4 world = glm::translate(glm::dmat4(1.0), params.vec3("origin"));
    if (turn[3] != 0) {
        if (glm::length(axis) <= 0)
            fail("the axis of the rotation has no length; give one that is not 0");
        world = glm::rotate(world, glm::radians(turn[3]), glm::normalize(axis));
    }
    desc.index_to_world = glm::scale(world, spacing);
    desc.dense_bytes();

    // Half the world extent of each axis that has one; the phantom's cube spans it.
    glm::dvec3 half = desc.extent() * spacing * 0.5;
    double smallest = 0, largest = 0;
    for (int a = 0; a < 3; ++a) {
        if (half[a] <= 0) continue;
        smallest = smallest > 0 ? std::min(smallest, half[a]) : half[a];
        largest = std::max(largest, half[a]);
    }
    if (largest <= 0) smallest = largest = spacing.x;  // a single voxel: its value is the centre's
    const std::string& fit = params.text("fit");
    for (int a = 0; a < 3; ++a)
        half[a] = fit == "inside" || half[a] <= 0 ? smallest : fit == "outside" ? largest : half[a];
    grid.phantom = {desc.dims, spacing / half};
    grid.scale = fit == "outside" ? largest : smallest;
    return grid;
}

// Maps the natural range to the one that is asked for, or to what the field stores by default.
void set_range(const Params& params, const Field& field, ScalarType type, PhantomFinish& finish) {
    const ValueRange natural = field.natural();
    ValueRange stored{params.real("low"), params.real("high")};
    if (stored.extent() == 0 || natural.extent() <= 0) stored = field.stored_range(type);
    for (double v : {stored.min, stored.max})
        if (type == ScalarType::f32 && std::abs(v) > limits_of(type).second && std::isfinite(v))
            fail("values up to {} do not fit in f32; take type f64 or a smaller range", v);
    if (natural.extent() <= 0) return;  // a constant is stored as it is
    finish.gain = stored.extent() / natural.extent();
    finish.offset = stored.min - finish.gain * natural.min;
}

// ---- readers.phantom ---------------------------------------------------------------------------

FieldPtr field_of(const Params& params, const Grid& grid) {
    const std::string& kind = params.text("kind");
    const PhantomGrid& g = grid.phantom;
    if (kind == "marschner-lobb")
        return marschner_lobb_field(params.real("frequency"), params.real("alpha"));
    if (kind == "ramp") {
        glm::dvec3 direction = params.vec3("direction");
        if (glm::length(direction) <= 0)
            fail("the direction of the ramp has no length; give one that is not 0");
        return ramp_field(direction, g);
    }
    if (kind == "sphere-distance")
        return sphere_distance_field(glm::dvec3(0.0), 0, params.real("radius"), grid.scale, g);
    if (kind == "constant") return constant_field(params.real("value"));
    if (kind == "impulse") {
        Index3 at = params.index3("at");
        for (int a = 0; a < 3; ++a) {
            if (at[a] < 0) at[a] = g.dims[a] / 2;
            if (at[a] >= g.dims[a] && g.dims[a] > 0)
                fail("the impulse at {} on axis {} is outside of {} voxels", at[a], "xyz"[a],
                     g.dims[a]);
        }
        return impulse_field(at, g);
    }
    if (kind == "checkerboard") return checkerboard_field(g);
    if (kind == "step") {
        const int axis = params.text("axis")[0] - 'x';
        return step_field(axis, std::llround(params.real("position") * double(g.dims[axis])), g);
    }
    if (kind == "shells") return shells_field(params.real("shells"), 0);
    if (kind == "plane-waves")
        return plane_waves_field(int(params.integer("waves")), params.real("band"),
                                 std::uint64_t(params.integer("seed")), 0, g);
    return ct_head_field(params.real("edge"));
}

struct Phantom {
    Grid grid;
    FieldPtr field;
    PhantomFinish finish;
};

Phantom phantom_of(const Params& params) {
    Phantom phantom{grid_of(params), nullptr, {}};
    VolumeDesc& desc = phantom.grid.desc;
    phantom.field = field_of(params, phantom.grid);
    PhantomFinish& finish = phantom.finish;
    set_range(params, *phantom.field, desc.type, finish);
    finish.noise = params.real("noise");
    finish.seed = std::uint64_t(params.integer("seed"));
    finish.masked_share = params.real("masked_share");
    const std::string& special = params.text("special");
    finish.special = special == "nan"        ? Special::nan
                     : special == "inf"      ? Special::inf
                     : special == "denormal" ? Special::denormal
                                             : Special::none;
    finish.special_share = params.real("special_share");
    if (finish.special != Special::none && !is_float(desc.type))
        fail("{} voxels cannot be {}; take type f32 or f64, or special: none", name_of(desc.type),
             special);
    desc.name = params.text("kind");
    desc.significant_bits = phantom.field->significant_bits(desc.type);
    desc.has_mask = finish.masked_share > 0;
    return phantom;
}

NodeType phantom_type() {
    NodeType type;
    type.id = "readers.phantom";
    type.title = "Phantom";
    type.doc = "Makes an analytic volume of any size and scalar type, computed where it is read.";
    type.keywords = {"analytic",     "test",    "synthetic", "marschner-lobb", "ramp", "sphere",
                     "checkerboard", "impulse", "shells",    "plane waves",    "ct",   "head"};
    type.outputs = {{"volume", PortType::volume, "The phantom, with its closed form."}};
    type.params = {
        param::choice("kind",
                      {"marschner-lobb", "ramp", "sphere-distance", "constant", "impulse",
                       "checkerboard", "step", "shells", "plane-waves", "ct-head"},
                      "marschner-lobb", "Which function of space."),
        param::real("frequency", 6, "Marschner-Lobb: f_M, waves of the radial part.")
            .range(0, 1e6)
            .slider(0, 20)
            .shown_if("kind", {"marschner-lobb"}),
        param::real("alpha", 0.25,
                    "Marschner-Lobb: weight of the radial part against the ramp in z.")
            .range(0, 1e6)
            .slider(0, 1)
            .shown_if("kind", {"marschner-lobb"}),
        param::vector("direction", {1, 0, 0},
                      "Ramp: its gradient, in phantom units along the grid's axes.")
            .range(-1e6, 1e6)
            .shown_if("kind", {"ramp"}),
        param::real("radius", 0.6, "Sphere distance: radius of the sphere, 1 being half the cube.")
            .range(0, 1e6)
            .slider(0, 1)
            .shown_if("kind", {"sphere-distance"}),
        param::real("value", 1, "Constant: the voxels' value, clamped to the type.")
            .shown_if("kind", {"constant"}),
        param::vector("at", {-1, -1, -1},
                      "Impulse: the voxel that is high; -1: the middle of the axis.")
            .range(-1, 1e9)
            .whole()
            .in_unit("voxels")
            .shown_if("kind", {"impulse"}),
        param::choice("axis", {"x", "y", "z"}, "x", "Step: the axis along which the value jumps.")
            .shown_if("kind", {"step"}),
        param::real("position", 0.5, "Step: share of the axis that is low.")
            .range(0, 1)
            .slider(0, 1)
            .shown_if("kind", {"step"}),
        param::real("shells", 6, "Shells: how many from the centre to the cube's face.")
            .range(0, 1e6)
            .slider(1, 32)
            .shown_if("kind", {"shells"}),
        param::integer("waves", 16, "Plane waves: how many are summed.")
            .range(1, 1000)
            .slider(1, 64)
            .shown_if("kind", {"plane-waves"}),
        param::real("band", 0.5,
                    "Plane waves: largest frequency as a share of the grid's band limit.")
            .range(0, 100)
            .slider(0, 1)
            .shown_if("kind", {"plane-waves"}),
        param::real("edge", 0.02,
                    "CT head: width of the edges between tissues, 1 being half the cube.")
            .range(1e-6, 1)
            .slider(0.002, 0.1, Scale::logarithmic)
            .shown_if("kind", {"ct-head"}),
        param::integer("seed", 1, "Seed of everything random: waves, noise, special values, mask.")
            .range(0, 4294967295.0)
            .in_group("values"),
        param::real("noise", 0,
                    "Standard deviation of noise, in the phantom's natural units (Hounsfield units "
                    "for the head).")
            .range(0, 1e9)
            .slider(0, 50)
            .in_group("values"),
        param::choice("special", {"none", "nan", "inf", "denormal"}, "none",
                      "Special values sprinkled over the voxels of float types.")
            .in_group("values")
            .for_experts(),
        param::real("special_share", 0.001, "Share of the voxels that are special.")
            .range(0, 1)
            .slider(1e-5, 1, Scale::logarithmic)
            .shown_if("special", {"nan", "inf", "denormal"})
            .in_group("values")
            .for_experts(),
        param::real("masked_share", 0,
                    "Share of the voxels that a validity mask marks as invalid; 0: no mask.")
            .range(0, 1)
            .slider(0, 1)
            .in_group("values")
            .for_experts(),
    };
    add_grid_params(type.params, {64, 64, 64});
    type.method =
        R"(Evaluates a closed formula at the voxels that are read, row by row and in parallel; nothing is held,
so that a phantom of ten gigabytes costs no memory. The volume carries its value and gradient in
world coordinates, against which reconstruction and rendering are tested without interpolation.

The phantom lives in a cube from -1 to 1 that spans the grid from the first to the last voxel
(`fit` says how where the grid is no cube). Natural values, mapped to `low` .. `high`:

| kind | value | range |
|---|---|---|
| marschner-lobb | ((1 - sin(pi z/2)) + a(1 + cos(2 pi f cos(pi r/2)))) / (2(1 + a)) | 0 .. 1 |
| ramp | direction . p | reached in the grid |
| sphere-distance | distance to the sphere in world lengths, negative inside | reached in the grid |
| constant | `value`, not mapped | |
| impulse | 1 at one voxel, 0 elsewhere; between voxels the trilinear hat | 0 .. 1 |
| checkerboard | alternating at the Nyquist rate on all axes | -1 .. 1 |
| step | 0, then 1 along an axis | 0 .. 1 |
| shells | cos(2 pi shells r) | -1 .. 1 |
| plane-waves | mean of waves of random direction, phase and frequency below `band` | -1 .. 1 |
| ct-head | Hounsfield units of a head; 12 bits with an offset of 1024 in unsigned types | -1024 .. 3071 |

Use it to measure: an error against a closed form is an error and not a difference of two guesses.
Do not use it to judge compression ratios: real scans have noise (`noise` adds some).

S. Marschner and R. Lobb, An evaluation of reconstruction filters for volume rendering, 1994.)";
    type.describe = [](Description& d) {
        try {
            Phantom phantom = phantom_of(d.params());
            ValueDesc volume(phantom.grid.desc);
            volume.by_region = true;
            d.output("volume", std::move(volume));
        } catch (const Error& e) {
            d.problem(e.what());
        }
    };
    type.evaluate = [](Evaluation& e) {
        Phantom phantom = phantom_of(e.params());
        e.output("volume", make_phantom(phantom.grid.desc, phantom.field, phantom.grid.phantom,
                                        phantom.finish));
    };
    return type;
}

// ---- readers.phantom-series --------------------------------------------------------------------

// Uneven times keep their order: each moves by less than half a step.
std::vector<double> times_of(const Params& params) {
    if (const std::vector<double>& given = params.numbers("times"); !given.empty()) {
        for (std::size_t i = 1; i < given.size(); ++i)
            if (!(given[i - 1] < given[i]))
                fail("the times must increase, {} stands before {}", given[i - 1], given[i]);
        return given;
    }
    std::vector<double> times(std::size_t(params.integer("steps")));
    SeededNumbers random(std::uint64_t(params.integer("seed")));
    for (std::size_t i = 0; i < times.size(); ++i)
        times[i] = params.real("time_step") *
                   (double(i) + params.real("unevenness") * (random.next() - 0.5));
    return times;
}

FieldPtr field_at(const Params& params, const Grid& grid, const std::vector<double>& times,
                  double time) {
    const std::string& kind = params.text("kind");
    const PhantomGrid& g = grid.phantom;
    const double turns = time / params.real("period");
    const auto seed = std::uint64_t(params.integer("seed"));
    if (kind == "moving-sphere") {
        const double angle = 2 * kPi * turns;
        const glm::dvec3 at =
            0.4 * glm::dvec3(std::cos(angle), std::sin(angle), 0.5 * std::sin(angle));
        return sphere_distance_field(at, 0.5, 0.4, grid.scale, g);
    }
    if (kind == "rotating-waves")
        return plane_waves_field(int(params.integer("waves")), params.real("band"), seed,
                                 2 * kPi * turns, g);
    if (kind == "pulsating-shells") return shells_field(params.real("shells"), turns);
    // Linear in time from the first step to the last: exact under linear interpolation.
    const double length = times.size() > 1 ? times.back() - times.front() : 1;
    return blend_field(
        plane_waves_field(int(params.integer("waves")), params.real("band"), seed, 0, g),
        plane_waves_field(int(params.integer("waves")), params.real("band"), seed + 1, 0, g),
        (time - times.front()) / length);
}

class PhantomSeries final : public Series {
  public:
    PhantomSeries(SeriesDesc desc, Params params, Grid grid)
        : Series(std::move(desc)), params_(std::move(params)), grid_(std::move(grid)) {
        // One mapping for all times, or the values of two steps could not be compared.
        if (!this->desc().times.empty())
            set_range(params_,
                      *field_at(params_, grid_, this->desc().times, this->desc().times.front()),
                      grid_.desc.type, finish_);
    }
    Value fetch(std::size_t i, const std::stop_token& stop) const override {
        check_stop(stop);
        if (i >= desc().times.size())
            fail("phantom series: step {} of {} is not there", i, desc().times.size());
        return make_phantom(grid_.desc, field_at(params_, grid_, desc().times, desc().times[i]),
                            grid_.phantom, finish_);
    }

  private:
    Params params_;
    Grid grid_;
    PhantomFinish finish_;
};

SeriesDesc series_of(const Params& params, Grid& grid) {
    grid = grid_of(params);
    grid.desc.name = params.text("kind");
    SeriesDesc desc;
    desc.element = PortType::volume;
    desc.step = grid.desc;
    desc.times = times_of(params);
    desc.time_unit = params.text("time_unit");
    return desc;
}

NodeType series_type() {
    NodeType type;
    type.id = "readers.phantom-series";
    type.title = "Moving phantom";
    type.doc =
        "Makes a series of analytic volumes that move, turn, pulsate or change linearly in time.";
    type.keywords = {"analytic", "test", "synthetic", "time", "4-D", "moving", "animation"};
    type.outputs = {{"series", PortType::series, "The phantom at each time."}};
    type.params = {
        param::choice("kind",
                      {"moving-sphere", "rotating-waves", "pulsating-shells", "linear-in-time"},
                      "moving-sphere", "Which function of space and time."),
        param::integer("steps", 10, "Number of times.")
            .range(1, 1000000)
            .slider(1, 100)
            .in_group("time"),
        param::real("time_step", 1, "Time from step to step.").range(1e-12, 1e12).in_group("time"),
        param::real("unevenness", 0, "Seeded shifts of the times, as a share of the time step.")
            .range(0, 0.99)
            .slider(0, 0.99)
            .in_group("time"),
        param::list("times", {}, "The times themselves, increasing, instead of steps.")
            .range(-1e12, 1e12)
            .in_group("time"),
        param::text("time_unit", "s", "Unit of the times.").in_group("time"),
        param::real("period", 10, "Time of one orbit, turn or pulse.")
            .range(1e-12, 1e12)
            .slider(1, 100)
            .in_group("time"),
        param::real("shells", 6, "Shells from the centre to the cube's face.")
            .range(0, 1e6)
            .slider(1, 32)
            .shown_if("kind", {"pulsating-shells"}),
        param::integer("waves", 16, "How many waves are summed.")
            .range(1, 1000)
            .slider(1, 64)
            .shown_if("kind", {"rotating-waves", "linear-in-time"}),
        param::real("band", 0.5, "Largest frequency as a share of the grid's band limit.")
            .range(0, 100)
            .slider(0, 1)
            .shown_if("kind", {"rotating-waves", "linear-in-time"}),
        param::integer("seed", 1, "Seed of the waves and of uneven times.").range(0, 4294967294.0),
    };
    add_grid_params(type.params, {32, 32, 32});
    type.method =
        R"(Each step is a phantom of its own, computed where it is read. The mapping to stored values is the
same for all times. `moving-sphere` is the distance to a sphere on a tilted orbit, `rotating-waves` a
sum of plane waves that turns about z, `pulsating-shells` concentric waves that run outwards, and
`linear-in-time` runs straight from one sum of plane waves to another, so that linear interpolation
between steps is exact.

Use it to test what interpolates, predicts or previews in time; uneven times catch what assumes a
constant step.)";
    type.describe = [](Description& d) {
        try {
            Grid grid;
            SeriesDesc desc = series_of(d.params(), grid);
            d.output("series", desc);
        } catch (const Error& e) {
            d.problem(e.what());
        }
    };
    type.evaluate = [](Evaluation& e) {
        Grid grid;
        SeriesDesc desc = series_of(e.params(), grid);
        e.output("series",
                 std::make_shared<const PhantomSeries>(std::move(desc), e.params(), grid));
    };
    return type;
}

}  // namespace

void add_phantoms(Registry& registry) {
    registry.add(phantom_type());
    registry.add(series_type());
}

}  // namespace voxloom
