// The node reference.raycast.
#include <algorithm>

#include "core/data/brick_cache.h"
#include "core/plugin/plugin.h"
#include "plugins/render-reference/raycast.h"

namespace voxloom::reference {

namespace {

const std::vector<std::string> kReconstructions = {"nearest", "trilinear", "tricubic"};
const std::vector<std::string> kCompositings = {"emission-absorption", "mip", "x-ray",
                                                "isosurface"};
const std::vector<std::string> kGradients = {"central", "sobel", "isotropic"};
const std::vector<std::string> kModes = {"auto", "cells", "steps"};

// The choices stand in the order of the enumerations.
template <class Enum>
Enum chosen(const Params& params, std::string_view key, const std::vector<std::string>& choices) {
    const auto at = std::find(choices.begin(), choices.end(), params.text(key));
    return Enum(at - choices.begin());
}

RaycastScene scene_of(const Params& params) {
    RaycastScene scene;
    scene.size = params.size2("size");
    scene.reconstruction = chosen<Reconstruction>(params, "reconstruction", kReconstructions);
    scene.compositing = chosen<Compositing>(params, "compositing", kCompositings);
    scene.iso_value = params.real("iso_value");
    scene.shading = params.boolean("shading");
    scene.gradient = chosen<GradientStencil>(params, "gradient", kGradients);
    const std::vector<double>& modulation = params.numbers("gradient_modulation");
    scene.gradient_modulation = {modulation[0], modulation[1]};
    scene.component = int(params.integer("component"));
    const std::vector<double>& background = params.numbers("background");
    scene.background = {background[0], background[1], background[2], background[3]};
    scene.closed_form = params.text("field") == "closed-form";
    scene.step = params.real("step");
    scene.mode = chosen<Mode>(params, "mode", kModes);
    return scene;
}

void describe(Description& node) {
    const RaycastScene scene = scene_of(node.params());
    node.output("image", ImageDesc{scene.size});
    if (scene.gradient_modulation.y < scene.gradient_modulation.x)
        node.problem("the first gradient magnitude must not exceed the second one",
                     "gradient_modulation");
    if (const char* why = cells_problem(scene); why && scene.mode == Mode::cells)
        node.problem(fmt::format("{}; choose steps or auto instead of cells", why), "mode");

    const ValueDesc* source = node.input("source");
    const VolumeDesc* volume = source ? source->volume() : nullptr;
    if (scene.closed_form && source && source->type == PortType::bricks)
        node.problem("Bricks have no closed form; wire the phantom itself or choose voxels",
                     "field");
    if (!volume) return;
    if (!volume->color && scene.component >= volume->components)
        node.problem(fmt::format("component {} is not there: the volume has {}, counted from 0",
                                 scene.component, volume->components), "component");
    node.working_memory(volume->dense_bytes() + (volume->has_mask ? 2 * volume->voxels() : 0));
}

void evaluate(Evaluation& node) {
    RaycastScene scene = scene_of(node.params());
    if (const BricksPtr bricks = node.input<Bricks>("source"))
        scene.volume = level_as_volume(bricks, 0, BrickCache::global());
    else
        scene.volume = node.input<Volume>("source");
    const VolumeDesc& desc = scene.volume->desc();
    if (!desc.color && scene.component >= desc.components)
        fail("component {} is not there: the volume has {}, counted from 0", scene.component,
             desc.components);
    scene.transfer = node.input<TransferFunction>("transfer");
    scene.camera = node.input<Camera>("camera");
    if (const LightsPtr lights = node.input<Lights>("lights")) scene.lights = *lights;

    // Reading takes a small part of the time.
    const double reading = 0.05;
    const Raycaster caster(std::move(scene), node.stop(), [&](double fraction) {
        node.progress(reading * fraction, "reading the volume");
    });
    node.output("image", std::make_shared<Image>(caster.image(node.stop(), [&](double fraction) {
        node.progress(reading + (1 - reading) * fraction, "tracing rays");
    })));
    node.measure("piecewise analytic", caster.uses_cells() ? 1 : 0);
}

NodeType raycast() {
    NodeType type;
    type.id = "reference.raycast";
    type.title = "Reference ray caster";
    type.doc = "Draws a volume slowly, in double precision and as exactly as it can be: the "
               "picture that errors are measured against.";
    type.keywords = {"render", "ray casting", "truth", "ground truth", "CPU", "double", "error"};
    type.inputs = {
        {"source", {PortType::volume, PortType::bricks}, "What is drawn; of Bricks, the finest."},
        {"transfer", PortType::transfer, "What the values look like."},
        {"camera", PortType::camera, "Where it is seen from."},
        {"lights", PortType::lights, "What shines on it with shading; by default a headlight.",
         true},
    };
    type.outputs = {{"image", PortType::image, "The picture, background under it."}};
    type.params = {
        param::vector("size", {512, 512}, "Width and height of the picture.")
            .range(1, 16384).slider(64, 2048, Scale::logarithmic).whole().in_unit("pixels"),
        param::choice("compositing", kCompositings, "emission-absorption",
                      "What a ray makes of the values that it meets."),
        param::real("iso_value", 0, "The value whose surface is drawn.")
            .shown_if("compositing", {"isosurface"}),
        param::vector("background", {0, 0, 0, 1}, "Colour and opacity under the picture.")
            .range(0, 1),
        param::choice("reconstruction", kReconstructions, "trilinear",
                      "How values between voxels are made; tricubic is Catmull-Rom.")
            .in_group("Field"),
        param::integer("component", 0,
                       "Which component of the voxels is drawn, of volumes that are not colours.")
            .range(0, 3).slider(0, 3).in_group("Field"),
        param::choice("field", {"voxels", "closed-form"}, "voxels",
                      "What is integrated: the voxels, or the formula of an analytic phantom.")
            .in_group("Field"),
        param::boolean("shading", false, "Light the samples by their gradient (Blinn-Phong).")
            .in_group("Gradient"),
        param::choice("gradient", kGradients, "isotropic", "Stencil of the gradient at the voxels.")
            .in_group("Gradient"),
        param::vector("gradient_modulation", {0, 0},
                      "Gradient magnitudes from which on samples begin to show and show in full; "
                      "both 0: all of them show.")
            .range(0, std::numeric_limits<double>::infinity())
            .in_unit("value per length").in_group("Gradient"),
        param::choice("mode", kModes, "auto",
                      "Exact integration cell by cell, sampling at steps, or cells where possible.")
            .in_group("Accuracy").is_quality(),
        param::real("step", 0.1, "Distance of samples where steps are used.")
            .range(1e-4, 16).slider(0.01, 2, Scale::logarithmic).in_unit("voxels")
            .in_group("Accuracy").shown_if("mode", {"auto", "steps"}).is_quality(),
    };
    type.method =
        R"(**Method.** Inside one cell a trilinear field is a cubic of the way along a ray. In mode
`cells` each ray is walked cell by cell. The cubic is cut where it turns and where it meets a control
point of the transfer function; on a piece the extinction is a cubic again, its optical depth is
integrated exactly, and the colour in closed form where the piece has one colour, else by an
eight-point Gauss rule on stretches of optical depth below 1/2. Transfer functions with steps and
peaks of any sharpness are therefore met exactly. With shading a 15-point Gauss-Kronrod rule
halves the stretches until it errs by less than 1e-7. Maximum intensity takes the largest value of
the cubics, isosurface the first crossing.

In mode `steps` the ray is sampled at the middles of equal steps of at most `step` times the
smallest spacing, each with its exact absorption; the error falls with the square of the step
where field and transfer function are continuous, with the step where the transfer function jumps.
It serves what is no cubic: tricubic reconstruction, 2-D transfer functions, gradient-magnitude
modulation, colour volumes, and `field: closed-form`, which integrates the formula of an analytic
phantom and so shows the error of sampling itself.

Masked voxels and those that are not finite are left out, the weights of their neighbours
renormalised (beside them tricubic falls back to trilinear); where no neighbour is left the volume
is transparent. Gradient stencils replicate the border.

**When to use.** As the second input of `metrics.image`, to state the error of any other renderer.

**When not.** To look around: a picture takes seconds to minutes.

**Reference.** Cubic along the ray: S. Parker et al., *Interactive Ray Tracing for Isosurface
Rendering*, IEEE Visualization 1998. Optical model: N. Max, *Optical Models for Direct Volume
Rendering*, IEEE TVCG 1(2), 1995.)";
    type.describe = describe;
    type.evaluate = evaluate;
    return type;
}

void add_nodes(Registry& registry) { registry.add(raycast()); }

}  // namespace

}  // namespace voxloom::reference

VOXLOOM_PLUGIN("render-reference", voxloom::reference::add_nodes)
