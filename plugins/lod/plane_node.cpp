#include <cmath>

#include "plugins/lod/error_model.h"
#include "plugins/lod/nodes.h"
#include "plugins/lod/plane_cut.h"
#include "plugins/lod/priority.h"

namespace voxloom::lod {

namespace {

constexpr const char* kMethod = R"(
Selects the bricks that a cutting plane meets, fine near a point of interest and coarser away from it: a
brick is good enough when its centre is further from the point than `distance_factor` times its diagonal.
So each level covers a ring about the point, and the number of bricks grows with the logarithm of the
volume's side instead of its square.

The point is fixed, or picked in the picture, or follows the camera's axis. Where the picked ray misses the
plane, the point of the plane nearest to the eye is taken. A plane on a face between bricks meets the one
behind it, so nothing is drawn twice.

**Use it** in front of `slicer.plane`, with `lod.balance` between them so that the rings blend into each
other. **Do not use it** for volumes that are drawn as a whole.

LaMar, Duchaineau, Hamann, Joy: *Multiresolution techniques for interactive texture-based rendering of
arbitrarily oriented cutting planes*, 2000. (Its section 4.1 says "smaller" where section 3.2 and figure 3
say "greater"; greater it is.)
)";

glm::dvec3 point_of_interest(const Params& p, const VolumeDesc& volume, const glm::dvec4& plane,
                             const Camera* camera, glm::ivec2 size) {
    const std::string& kind = p.text("interest");
    if (kind == "fixed" || !camera) return point_in_box(volume, p.vec3("point"));
    glm::dvec2 at(0.5, 0.5);
    if (kind == "picked") at = {p.numbers("pick")[0], p.numbers("pick")[1]};
    const Ray ray = camera->ray(at.x * size.x, at.y * size.y, size.x, size.y);
    const glm::dvec3 n(plane);
    const double distance = glm::dot(n, ray.origin) + plane.w, approach = -glm::dot(n, ray.direction);
    const double t = distance / approach;
    return approach != 0 && std::isfinite(t) && t >= 0 ? ray.origin + t * ray.direction
                                                       : ray.origin - distance * n;
}

void describe(Description& d) {
    d.output("selection", PortType::selection);
    if (glm::length(d.params().vec3("normal")) == 0) d.problem("a normal must have a length", "normal");
    if (d.params().text("interest") != "fixed" && !d.input("camera"))
        d.problem("a point that is picked or follows the camera needs one; wire a camera", "interest");
}

void evaluate(Evaluation& ev) {
    const BricksPtr bricks = ev.input<Bricks>("bricks");
    const CameraPtr camera = ev.input<Camera>("camera");
    const Params& p = ev.params();
    const BricksDesc& desc = bricks->desc();
    const glm::ivec2 size = p.size2("size");
    auto selection = new_selection(desc, "lod.plane", camera, size);
    PlaneRule rule;
    rule.plane = plane_through(point_in_box(desc.volume, p.vec3("origin")), p.vec3("normal"));
    rule.interest = point_of_interest(p, desc.volume, rule.plane, camera.get(), size);
    rule.kappa = p.real("distance_factor");
    selection->plane = rule.plane;
    std::optional<Sight> sight;
    if (camera) sight.emplace(*camera, size, desc);
    const Sight* seen = sight ? &*sight : nullptr;
    Cut cut = select_on_plane(desc, rule, seen, ev.stop());
    predict_errors(cut, desc, value_errors(bricks), seen);
    list_bricks(cut, desc, seen, *selection);
    output_selection(ev, selection);
}

}  // namespace

NodeType plane_node() {
    NodeType node;
    node.id = "lod.plane";
    node.title = "Detail on a plane";
    node.doc = "Selects the bricks that a cutting plane meets, finest about a point of interest.";
    node.keywords = {"level of detail", "LOD", "cutting plane", "slice", "point of interest", "selection"};
    node.inputs = {bricks_input(), camera_input(true)};
    node.outputs = {selection_output()};
    ParamSpec origin = param::vector("origin", {0.5, 0.5, 0.5},
                                     "A point of the plane: 0 to 1 from the first to the last voxel along x, y, z.");
    ParamSpec point = param::vector("point", {0.5, 0.5, 0.5},
                                    "The point of interest: 0 to 1 from the first to the last voxel along x, y, z.");
    ParamSpec normal = param::vector("normal", {0, 0, 1}, "Normal of the plane in the world, of any length.");
    ParamSpec pick = param::vector("pick", {0.5, 0.5}, "Where the picture was clicked: 0 to 1 from its left and its top.");
    origin.length = point.length = normal.length = 3;
    pick.length = 2;
    node.params = {
        normal.range(-1e30, 1e30).slider(-1, 1).in_group("plane"),
        origin.range(-10, 10).slider(0, 1).in_group("plane"),
        param::real("distance_factor", 1, "Diagonals of a brick from which on it is far enough away; 0: the coarsest "
                                          "bricks everywhere.")
            .range(0, 1e9).slider(0, 8).in_group("detail").is_quality(),
        param::choice("interest", {"fixed", "picked", "camera"}, "fixed",
                      "Where the finest bricks are: at a point of the volume, under a point of the picture, or in its "
                      "middle.")
            .in_group("detail"),
        point.range(-10, 10).slider(0, 1).in_group("detail").shown_if("interest", {"fixed"}),
        pick.range(0, 1).slider(0, 1).in_group("detail").shown_if("interest", {"picked"}),
        size_param()};
    node.method = kMethod;
    node.describe = describe;
    node.evaluate = evaluate;
    return node;
}

}  // namespace voxloom::lod
