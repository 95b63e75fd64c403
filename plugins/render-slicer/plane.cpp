#include "plugins/render-slicer/plane.h"

#include <algorithm>
#include <cmath>

#include "core/base/meter.h"
#include "core/data/selection.h"
#include "core/gpu/thread.h"
#include "plugins/render-slicer/brick_scene.h"
#include "plugins/render-slicer/decoding.h"
#include "plugins/render-slicer/keep.h"
#include "plugins/render-slicer/modules.h"
#include "plugins/render-slicer/picture.h"
#include "plugins/render-slicer/tables.h"

namespace voxloom::slicer {

namespace {

constexpr const char* kMethod = R"(
Draws a plane through bricks: each pixel's ray meets the plane in a point, the brick that lies there is
read, and the value gets the colour of the transfer function. With a selection of `lod.plane` the bricks
are fine about its point of interest and coarse away from it, and the plane is the selection's. Behind
`lod.balance` bricks blend into coarser neighbours, by ratios that are trilinear between their corners, so
there are no cracks whichever way the plane goes. Without a selection every brick that the plane meets is
drawn at the finest level.

`blend: one-pass` mixes the values of a brick and its parent, then classifies; `two-pass` classifies both,
and adds them with their weights, as LaMar et al. do. The two differ where colours are not linear in the
value. Where somebody looks, what is decoded is shown after `first_picture` seconds, coarse where the fine bricks are
still missing, and finer as they come, the ones of coarse levels first. `borders` shows the bricks: black, red, green and yellow from the finest level on.

**Use it** to look into a volume, whatever its size. **Do not use it** for slices along an axis of a volume in
memory, which a crop shows as well.

LaMar, Duchaineau, Hamann, Joy: *Multiresolution techniques for interactive texture-based rendering of
arbitrarily oriented cutting planes*, 2000.
)";

constexpr int kBins = 4096;

struct KeptTable {
    gpu::TexturePtr texture;
};

gpu::TexturePtr colours(const TransferPtr& transfer, ValueRange range) {
    const Hash key = Hasher().text("plane").hash(hash_of(*transfer)).value(range.min).value(range.max).finish();
    return Keep::instance().get<KeptTable>(transfer, key, [&](std::uint64_t& bytes) {
        const std::vector<glm::vec4> table = emission_table(transfer->one, range, kBins, transfer->reference_length);
        auto t = std::make_shared<gpu::Texture>(gpu::make_texture(GL_TEXTURE_1D, GL_RGBA32F, {kBins, 1, 1}, GL_LINEAR,
                                                                  "the table of the transfer function"));
        gpu::upload(*t, {0, 0, 0}, {kBins, 1, 1}, GL_RGBA, GL_FLOAT, table.data());
        bytes += t->bytes;
        return std::make_shared<KeptTable>(KeptTable{t});
    })->texture;
}

// Everything that the plane meets, at the finest level.
SelectionPtr finest_on(const BricksDesc& desc, const glm::dvec4& plane) {
    auto selection = std::make_shared<Selection>();
    selection->of = std::make_shared<BricksDesc>(desc);
    selection->policy = "slicer.plane";
    selection->plane = plane;
    const glm::dvec4 cut = plane * desc.volume.index_to_world;
    const glm::ivec3 n = desc.levels[0].bricks;
    for (int z = 0; z < n.z; ++z)
        for (int y = 0; y < n.y; ++y)
            for (int x = 0; x < n.x; ++x) {
                const Box box = desc.box_of({0, {x, y, z}});
                const glm::dvec3 half = 0.5 * glm::dvec3(box.dims()), centre = glm::dvec3(box.lo) + half;
                // A voxel more on either side: what is in doubt is drawn.
                if (std::abs(glm::dot(glm::dvec3(cut), centre) + cut.w) >
                    glm::dot(glm::abs(glm::dvec3(cut)), half + 1.0))
                    continue;
                SelectedBrick b;
                b.id = {0, {x, y, z}};
                selection->bricks.push_back(b);
            }
    return selection;
}

struct Cut {
    glm::ivec2 size;
    bool nearest = false, two_pass = false, opaque = true;
    double borders = 0;
    int component = 0;
    glm::dvec4 background;
    std::uint64_t gpu_bytes = 0;
    double first_picture = 0, bytes_per_second = 0;
};

gpu::ProgramPtr assemble(const BrickScene& scene, const Cut& cut) {
    const gpu::VoxelSource& voxels = scene.field->voxels;
    std::string choices;
    if (voxels.color) choices += "#define COLOR\n";
    if (voxels.has_validity) choices += "#define VALIDITY\n";
    if (scene.blended) choices += "#define BLENDED\n";
    return gpu::program({module("proxy-screen")},
                        {{"choices", choices},
                         voxels.glsl,
                         over(module("texels-in-slots"), "brick"),
                         over(module(cut.nearest ? "reconstruction-nearest" : "reconstruction-trilinear"), "brick"),
                         with(module("at-point"), "TEXELS", "brick"),
                         module("reconstruction-bricks"),
                         module("scalar"),
                         module("emission"),
                         module("plane")});
}

void set_rays(const gpu::Program& program, const Camera& camera, const VolumeDesc& desc, glm::ivec2 size,
              const glm::dvec4& plane) {
    const glm::dmat4 to_index = glm::inverse(desc.index_to_world);
    const double pixel = camera.unit_height() / size.y;
    const glm::dvec3 x = camera.right() * pixel, y = camera.true_up() * -pixel;
    const glm::dvec3 corner = camera.right() * (-0.5 * size.x * pixel) + camera.true_up() * (0.5 * size.y * pixel);
    const bool perspective = camera.projection == Camera::Projection::perspective;
    auto direction = [&](glm::dvec3 v) { return glm::vec3(glm::dmat3(to_index) * v); };
    const glm::dvec3 none(0.0);
    const glm::dvec3 from = camera.eye + (perspective ? none : corner);
    program.set("origin_0", glm::vec3(glm::dvec3(to_index * glm::dvec4(from, 1.0))));
    program.set("origin_x", direction(perspective ? none : x));
    program.set("origin_y", direction(perspective ? none : y));
    program.set("along_0", direction(camera.forward() + (perspective ? corner : none)));
    program.set("along_x", direction(perspective ? x : none));
    program.set("along_y", direction(perspective ? y : none));
    // Scaled to unit length, so that floats hold it whatever the world's unit.
    glm::dvec4 cut = plane * desc.index_to_world;
    program.set("cut", glm::vec4(cut / glm::length(glm::dvec3(cut))));
    program.set("nearest", float(std::max(camera.near, 0.0)));
    const SamplingBox box = sampling_box(desc);
    program.set("box_lo", glm::vec3(box.lo));
    program.set("box_hi", glm::vec3(box.hi));
}

std::shared_ptr<Image> draw(const gpu::Program& program, const Cut& cut, Evaluation& ev) {
    const std::int64_t begin = wall_ns();
    const Target& target = target_of(cut.size);
    glBindFramebuffer(GL_FRAMEBUFFER, target.framebuffer.name());
    glBindVertexArray(target.vertices.name());
    glUseProgram(program.name());
    glViewport(0, 0, cut.size.x, cut.size.y);
    glDisable(GL_DEPTH_TEST);
    glDisable(GL_SCISSOR_TEST);
    const glm::vec4 nothing(0.0f);
    glClearNamedFramebufferfv(target.framebuffer.name(), GL_COLOR, 0, &nothing[0]);
    glEnable(GL_BLEND);
    glBlendFunc(GL_ONE, GL_ONE);
    for (float part : cut.two_pass ? std::vector<float>{1, 2} : std::vector<float>{0}) {
        program.set("part", part);
        glDrawArrays(GL_TRIANGLES, 0, 3);
    }
    glDisable(GL_BLEND);
    glFinish();
    gpu::check_errors("drawing a cutting plane");
    ev.add_draw_seconds(double(wall_ns() - begin) * 1e-9);
    return read_back(target);
}

std::shared_ptr<Image> draw_scene(const BrickScene& scene, const VolumeDesc& desc, const glm::dvec4& plane, const Cut& cut,
                                  Evaluation& ev) {
    const gpu::ProgramPtr program = assemble(scene, cut);
    scene.set(*program);
    set_rays(*program, *ev.input<Camera>("camera"), desc, cut.size, plane);
    ValueRange range = scene.range;
    const gpu::VoxelSource& voxels = scene.field->voxels;
    if (range.min == range.max) range = {range.min - 1, range.max + 1};
    program->set("table_map", glm::vec2(voxels.scale / range.extent(), (voxels.offset - range.min) / range.extent()));
    int unit = 0;
    for (const gpu::SourceTexture& t : voxels.textures) program->bind(t.sampler.c_str(), unit++, *t.texture);
    const gpu::TexturePtr table = colours(ev.input<TransferFunction>("transfer"), range);
    program->bind("emission_table", unit++, *table);
    program->set("emission_bins", float(kBins));
    program->set("opaque", cut.opaque ? 1.0f : 0.0f);
    program->set("borders", float(cut.borders));
    std::shared_ptr<Image> image = draw(*program, cut, ev);
    for (glm::vec4& c : image->rgba32f()) c += (1.0f - c.a) * glm::vec4(cut.background);
    return image;
}

std::shared_ptr<Image> draw_bricks(const BricksPtr& bricks, const Selection& selection, const Cut& cut, Evaluation& ev) {
    const VolumeDesc& desc = bricks->desc().volume;
    BrickRequest request;
    request.component = cut.component;
    request.gpu_bytes = cut.gpu_bytes;
    request.table_bytes = kBins * sizeof(glm::vec4);
    request.visible = [](double, double, double) { return true; };
    BrickPlan plan;
    if (desc.voxels() > 0) plan = plan_bricks(bricks, &selection, request, ev);
    if (plan.pages.empty()) {
        auto image = std::make_shared<Image>(cut.size, Image::Format::rgba32f);
        std::ranges::fill(image->rgba32f(), glm::vec4(cut.background));
        return image;
    }
    if (const std::vector<BrickId> missing = plan.missing(); !missing.empty() && ev.wants_provisional() && cut.first_picture > 0) {
        Decoding decoding(bricks, missing, kAround, cut.bytes_per_second);
        while (!decoding.wait(cut.first_picture, ev.stop())) {
            ev.provisional("image", ImagePtr(draw_scene(load_bricks(plan, request, ev, true), desc, *selection.plane, cut, ev)));
            ev.count("provisional pictures");
        }
    }
    return draw_scene(load_bricks(plan, request, ev), desc, *selection.plane, cut, ev);
}

void describe(Description& d) {
    const Params& p = d.params();
    d.output("image", ImageDesc{p.size2("size")});
    if (glm::length(p.vec3("normal")) == 0) d.problem("a normal must have a length", "normal");
    const ValueDesc* source = d.input("source");
    const VolumeDesc* volume = source ? source->volume() : nullptr;
    if (volume && !volume->color && p.integer("component") >= volume->components)
        d.problem(fmt::format("the volume has {} component{}, counted from 0", volume->components,
                              volume->components == 1 ? "" : "s"), "component");
}

void evaluate(Evaluation& ev) {
    gpu::require_context();
    const BricksPtr bricks = ev.input<Bricks>("source");
    const Params& p = ev.params();
    Cut cut;
    cut.size = p.size2("size");
    cut.nearest = p.text("filter") == "nearest";
    cut.two_pass = p.text("blend") == "two-pass";
    cut.opaque = p.text("opacity") == "opaque";
    cut.borders = p.real("borders");
    cut.component = int(p.integer("component"));
    cut.gpu_bytes = std::uint64_t(p.integer("gpu_memory")) << 20;
    cut.first_picture = p.real("first_picture");
    cut.bytes_per_second = p.real("bandwidth") * 1048576.0;
    const std::vector<double>& b = p.numbers("background");
    cut.background = glm::dvec4(glm::dvec3(b[0], b[1], b[2]) * b[3], b[3]);

    const VolumeDesc& desc = bricks->desc().volume;
    SelectionPtr selection = ev.input<Selection>("selection");
    if (!selection || !selection->plane) {
        const glm::dvec4 plane = plane_through(point_in_box(desc, p.vec3("origin")), p.vec3("normal"));
        if (selection) {
            auto on_plane = std::make_shared<Selection>(*selection);
            on_plane->plane = plane;
            selection = on_plane;
        } else {
            selection = finest_on(bricks->desc(), plane);
        }
    }
    Keep::instance().begin(cut.gpu_bytes);
    const ImagePtr image = draw_bricks(bricks, *selection, cut, ev);
    ev.measure("GPU memory", double(Keep::instance().peak()), "bytes");
    Keep::instance().shrink(cut.gpu_bytes);
    ev.output("image", image);
}

}  // namespace

NodeType plane_node() {
    NodeType t;
    t.id = "slicer.plane";
    t.title = "Cutting plane";
    t.doc = "Draws a plane through bricks, at the detail that a selection says.";
    t.keywords = {"slice", "cross section", "MPR", "oblique", "level of detail", "OpenGL", "picture"};
    t.thread = NodeType::Thread::opengl;
    t.inputs = {{"source", PortType::bricks, "What is cut."},
                {"transfer", PortType::transfer, "Colour and opacity of its values."},
                {"camera", PortType::camera, "Where it is seen from."},
                {"selection", PortType::selection, "Which bricks are drawn, at which level; its plane, if it has one, is "
                                                   "the one that is drawn.", true}};
    t.outputs = {{"image", PortType::image, "The picture, premultiplied linear RGBA."}};
    ParamSpec size = param::vector("size", {512, 512}, "Width and height of the picture.");
    ParamSpec origin = param::vector("origin", {0.5, 0.5, 0.5},
                                     "A point of the plane: 0 to 1 from the first to the last voxel along x, y, z.");
    ParamSpec normal = param::vector("normal", {0, 0, 1}, "Normal of the plane in the world, of any length.");
    ParamSpec background = param::vector("background", {0, 0, 0, 1}, "Red, green, blue and alpha behind the picture.");
    size.length = 2;
    origin.length = normal.length = 3;
    background.length = 4;
    t.params = {
        size.range(1, 8192).slider(64, 2048).whole().in_unit("pixels").in_group("picture").is_quality(),
        background.range(0, 1).in_group("picture"),
        normal.range(-1e30, 1e30).slider(-1, 1).in_group("plane"),
        origin.range(-10, 10).slider(0, 1).in_group("plane"),
        param::integer("component", 0, "Component that is classified, for volumes that are not colour.")
            .range(0, 3).in_group("picture"),
        param::choice("opacity", {"opaque", "transfer"}, "opaque",
                      "The colour of every value that has one, or as opaque as a reference length of it is.")
            .in_group("picture"),
        param::choice("filter", {"linear", "nearest"}, "linear", "Between the voxels: linear, or the nearest one.")
            .in_group("sampling"),
        param::choice("blend", {"one-pass", "two-pass"}, "one-pass",
                      "Towards coarser bricks: mix values, then classify, or classify both, then add.")
            .in_group("sampling"),
        param::real("borders", 0, "Width of the lines around bricks; 0: none.")
            .range(0, 64).slider(0, 4).in_unit("pixels").in_group("picture"),
        param::integer("gpu_memory", 2048, "Textures kept between two pictures; of bricks, all that there is of them and their tables at any time.")
            .range(0, 1 << 20).in_unit("MiB").in_group("speed").for_experts().changes(Affects::cost),
        first_picture_param(),
        param::real("bandwidth", 0, "Compressed bricks decoded a second while somebody looks on, so that other readers of a "
                                    "slow disk or network have their share; 0: no limit.")
            .range(0, 1e6).slider(0, 100).in_unit("MiB/s").in_group("speed").for_experts().changes(Affects::cost),
    };
    t.method = kMethod;
    t.describe = describe;
    t.evaluate = evaluate;
    return t;
}

}  // namespace voxloom::slicer
