// slicer.render: the node, as its description and the way from parameters to settings.
#include "core/plugin/plugin.h"
#include "plugins/render-slicer/plane.h"
#include "plugins/render-slicer/renderer.h"

namespace voxloom::slicer {

namespace {

template <class Enum>
Enum choice_of(const Params& p, std::string_view key) {
    for (const ParamSpec& spec : p.specs())
        if (spec.key == key)
            for (std::size_t i = 0; i < spec.choices.size(); ++i)
                if (spec.choices[i] == p.text(key)) return Enum(i);
    return Enum(0);
}

Settings settings_of(const Params& p) {
    Settings s;
    s.size = p.size2("size");
    s.slice_distance = p.real("slice_distance");
    s.reconstruction = choice_of<Settings::Reconstruction>(p, "reconstruction");
    s.classification = choice_of<Settings::Classification>(p, "classification");
    s.compositing = choice_of<Settings::Compositing>(p, "compositing");
    s.gradient = choice_of<Settings::Gradient>(p, "gradient");
    s.gradient_stored = p.text("gradient_source") == "stored";
    s.shading = p.boolean("shading");
    s.modulation = {p.numbers("gradient_modulation")[0], p.numbers("gradient_modulation")[1]};
    s.iso_value = p.real("iso_value");
    s.component = int(p.integer("component"));
    s.ray_length = p.text("perspective_correction") == "exponent";
    s.table_size = int(p.integer("table_size"));
    s.early_termination = p.real("early_termination");
    s.skipping = p.boolean("skipping");
    s.block_size = int(p.integer("block_size"));
    const std::vector<double>& b = p.numbers("background");
    s.background = {b[0], b[1], b[2], b[3]};
    s.gpu_bytes = std::uint64_t(p.integer("gpu_memory")) << 20;
    s.first_picture = p.real("first_picture");
    return s;
}

void describe(Description& d) {
    const Params& p = d.params();
    d.output("image", ImageDesc{p.size2("size")});
    const std::vector<double>& m = p.numbers("gradient_modulation");
    if (m[1] < m[0]) d.problem("the upper end must not be below the lower one", "gradient_modulation");
    const ValueDesc* source = d.input("source");
    const VolumeDesc* volume = source ? source->volume() : nullptr;
    if (!volume) return;
    if (!volume->color && p.integer("component") >= volume->components)
        d.problem(fmt::format("the volume has {} component{}, counted from 0", volume->components,
                              volume->components == 1 ? "" : "s"), "component");
    std::uint64_t texel = bytes_of(volume->type) > 2 ? 4 : 2;
    if (volume->color) texel *= 4;
    if (p.boolean("shading")) texel += 8;
    if (p.text("classification") == "pre") texel += 16;
    if (d.input("selection")) {
        if (source->type != PortType::bricks)
            d.problem("a selection says which bricks are drawn, but the source has none; wire the bricks that it was "
                      "made of", "selection");
        return;  // as much as gpu_memory allows
    }
    d.working_memory(volume->voxels() * texel + (source->by_region ? volume->dense_bytes() : 0));
}

void evaluate(Evaluation& ev) {
    Scene scene;
    scene.source = ev.value("source");
    scene.selection = ev.input<Selection>("selection");
    scene.transfer = ev.input<TransferFunction>("transfer");
    scene.camera = ev.input<Camera>("camera");
    scene.lights = ev.input<Lights>("lights");
    scene.settings = settings_of(ev.params());
    ev.output("image", render(scene, ev));
}

NodeType render_node() {
    NodeType t;
    t.id = "slicer.render";
    t.title = "Slicing renderer";
    t.doc = "Draws a volume with OpenGL by slabs between view-aligned slices.";
    t.keywords = {"volume rendering", "texture slicing", "pre-integration", "OpenGL", "picture", "MIP",
                  "X-ray", "isosurface", "shading"};
    t.thread = NodeType::Thread::opengl;
    t.inputs = {{"source", {PortType::volume, PortType::bricks}, "What is drawn."},
                {"transfer", PortType::transfer, "Opacity and colour of its values."},
                {"camera", PortType::camera, "Where it is seen from."},
                {"selection", PortType::selection, "Which of the bricks are drawn, at which level; all at the finest one where none is wired.", true},
                {"lights", PortType::lights, "Lights for shading; a headlight where none is wired.", true}};
    t.outputs = {{"image", PortType::image, "The picture, premultiplied linear RGBA."}};

    const std::vector<std::string> slabs = {"emission-absorption", "x-ray"};
    auto size = param::vector("size", {512, 512}, "Width and height of the picture.");
    size.length = 2;
    auto modulation = param::vector("gradient_modulation", {0, 0},
                                    "Gradient magnitudes (value per world length) between which "
                                    "opacity rises from none to full; both 0: off.");
    modulation.length = 2;
    auto background = param::vector("background", {0, 0, 0, 1}, "Red, green, blue and alpha behind the picture.");
    background.length = 4;
    t.params = {
        size.range(1, 8192).slider(64, 2048).whole().in_unit("pixels").in_group("picture").is_quality(),
        background.range(0, 1).in_group("picture"),
        param::choice("compositing", {"emission-absorption", "mip", "x-ray", "isosurface"},
                      "emission-absorption", "How the samples of a ray become one colour.")
            .in_group("picture"),
        param::real("iso_value", 0, "Value of the surface.").in_group("picture")
            .shown_if("compositing", {"isosurface"}),
        param::integer("component", 0, "Component that is classified, for volumes that are not colour.")
            .range(0, 3).in_group("picture"),
        param::real("slice_distance", 1,
                    "Distance between slices, as a multiple of the smallest voxel spacing.")
            .range(0.01, 64).slider(0.1, 4, Scale::logarithmic).in_group("sampling").is_quality(),
        param::choice("reconstruction", {"nearest", "trilinear", "tricubic"}, "trilinear",
                      "Between the voxels: the nearest one, linear, or interpolating cubic (Catmull-Rom).")
            .in_group("sampling").is_quality(),
        param::choice("classification", {"pre", "post", "pre-integrated"}, "pre-integrated",
                      "Transfer function at the voxels, at the samples, or integrated between two samples; "
                      "a 2-D one is always applied at the samples.")
            .in_group("sampling").is_quality().shown_if("compositing", slabs),
        param::integer("table_size", 256, "Values on each side of the pre-integration table.")
            .range(2, 2048).slider(64, 1024).in_group("sampling").for_experts().is_quality()
            .shown_if("classification", {"pre-integrated"}),
        param::choice("perspective_correction", {"exponent", "none"}, "exponent",
                      "Opacity for the true length of a ray between two slices, or as on the view axis.")
            .in_group("sampling").for_experts(),
        param::boolean("shading", false, "Light the samples by their gradient.").in_group("shading"),
        param::choice("gradient", {"central", "sobel", "isotropic"}, "isotropic",
                      "Stencil of the gradient at the voxels.").in_group("shading"),
        param::choice("gradient_source", {"on-the-fly", "stored"}, "stored",
                      "Gradients computed for each sample, or once at the voxels (8 bytes a voxel, and "
                      "several times faster).").in_group("shading").for_experts(),
        modulation.range(0, std::numeric_limits<double>::max()).in_group("shading"),
        param::real("early_termination", 0.999, "Opacity at which a ray ends; 1: never before it is opaque.")
            .range(0.5, 1).slider(0.9, 1).in_group("speed").for_experts().is_quality()
            .shown_if("compositing", {"emission-absorption"}),
        param::boolean("skipping", true, "Leap over blocks that the transfer function leaves transparent; "
                       "the picture is the same.").in_group("speed").for_experts(),
        param::integer("block_size", 8, "Cells on each side of a block for skipping.")
            .range(2, 128).slider(4, 32).in_group("speed").for_experts(),
        param::integer("gpu_memory", 2048, "Textures kept between two pictures; of bricks, all that there is of them and their tables at any time.")
            .range(0, 1 << 20).in_unit("MiB").in_group("speed").for_experts().changes(Affects::cost),
    };
    t.params.push_back(first_picture_param());
    t.method = R"(**Method.** Planes normal to the view axis, anchored at the middle of the volume and common to all
blocks, cut every ray into slabs; the parts of a slab at the volume's faces, at the near plane and at the
eye count with their exact thickness. Slabs are composited front to back in 32-bit floats. With
pre-integration a slab takes its opacity and colour from a table over the values at its front and back,
so thin features of the transfer function are not missed between two slices. Under perspective a slab is
thicker away from the axis, and its opacity follows.

A fragment marches all slabs of its ray, so that the accumulated colour never leaves its registers; blocks
that the transfer function leaves transparent are leapt over (a chessboard distance field tells how far),
and a ray ends where it is saturated.

Of bricks with a selection only what is selected is decoded and uploaded, and stays from picture to picture.
Where `gpu_memory` has room for whole levels, bricks lie in one texture as they do in space,
and what is drawn of one level alone is drawn as a volume is. Else they lie in slots, least recently used out
first, and `gpu_memory` must hold the bricks of one picture. Between levels a ray goes from brick to brick, with
the slices and the table of each one's level; slabs are cut at the faces, so what a ray meets does not depend on
how the volume is cut. Where `lod.balance` says so a brick blends into its coarser neighbours. Where somebody looks,
what is decoded is shown after `first_picture` seconds, and better and better while other threads decode the rest;
the last picture does not depend on that.

**When to use.** For looking at volumes, from 8-bit scans to floats, at any quality: `slice_distance` trades
time for error, 2 for a quick look, 0.5 for a still.

**When not.** Where the truth is asked for: `reference.raycast`. Volumes larger than the largest 3-D texture
need bricks and a selection, or a crop.

**Reference.** Guthe, Wand, Gonser, Strasser: Interactive Rendering of Large Volume Data Sets, 2002; Engel,
Kraus, Ertl: High-Quality Pre-Integrated Volume Rendering, 2001; Lum, Wilson, Ma: High-Quality Lighting and
Efficient Pre-Integration, 2004.)";
    t.describe = describe;
    t.evaluate = evaluate;
    return t;
}

void add_nodes(Registry& registry) {
    registry.add(render_node());
    registry.add(plane_node());
}

}  // namespace

}  // namespace voxloom::slicer

VOXLOOM_PLUGIN("render-slicer", voxloom::slicer::add_nodes)
