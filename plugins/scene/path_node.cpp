#include <glm/gtc/constants.hpp>

#include "plugins/scene/framing.h"
#include "plugins/scene/nodes.h"
#include "plugins/scene/path.h"

namespace voxloom::scene {

namespace {

constexpr const char* kMethod = R"(
A camera on a path, at time `t` from 0 to 1: `voxloom run GRAPH --sweep path.t=0..1..0.02` draws a picture a
step. Everything is measured from the centre of the volume wired to `fit`, in radii of the sphere about it,
with the axis `up_axis` upwards, so a path fits any volume.

- **turntable** goes around at an even pace, `turn` degrees in all, and always sees the whole volume. With
  360 degrees the last picture is the first one again.
- **keyframes** goes through the given points with continuous velocity (cubic Hermite; at a keyframe the
  velocity of the parabola through it and its neighbours).
- **walkthrough** comes from outside, flies through the volume past its centre, looks back, and returns to
  where it began: near and far, slow and fast, which is what caches and levels of detail are tried with.

**Use it** for animations and for measurements over many views. **Do not use it** for one picture:
`scene.camera` is simpler.
)";

// Time, eye and target, with z upwards and the first view from -y.
const std::vector<Keyframe>& walkthrough() {
    static const std::vector<Keyframe> keys = {
        {0.00, {0.0, -3.2, 0.6}, {0.0, 0.0, 0.0}},     {0.18, {0.5, -1.5, 0.4}, {0.0, 0.0, 0.0}},
        {0.32, {0.35, -0.6, 0.2}, {-0.1, 0.5, 0.0}},   {0.45, {-0.1, -0.1, 0.1}, {-0.4, 0.8, 0.1}},
        {0.58, {-0.6, 0.4, 0.2}, {-0.2, 0.0, -0.1}},   {0.72, {-1.4, 0.6, 0.5}, {0.0, 0.0, 0.0}},
        {0.86, {-1.9, -1.4, 0.7}, {0.0, 0.0, 0.0}},    {1.00, {0.0, -3.2, 0.6}, {0.0, 0.0, 0.0}}};
    return keys;
}

std::vector<Keyframe> keyframes_of(const Params& p) {
    std::vector<Keyframe> keys;
    for (const std::vector<double>& r : p.rows("keyframes")) keys.push_back({r[0], {r[1], r[2], r[3]}, {r[4], r[5], r[6]}});
    return keys;
}

std::string problem_with_keyframes(const std::vector<Keyframe>& keys) {
    if (keys.empty()) return "a path needs a keyframe at least";
    for (std::size_t i = 0; i < keys.size(); ++i) {
        if (i > 0 && !(keys[i].time > keys[i - 1].time))
            return fmt::format("times must increase, but {} comes after {}", keys[i].time, keys[i - 1].time);
        if (keys[i].eye == keys[i].target)
            return fmt::format("at time {} eye and target are the same point; move one of them", keys[i].time);
    }
    return {};
}

void describe(Description& d) {
    d.output("camera", PortType::camera);
    if (d.params().text("mode") != "keyframes") return;
    if (const std::string problem = problem_with_keyframes(keyframes_of(d.params())); !problem.empty())
        d.problem(problem, "keyframes");
}

void evaluate(Evaluation& ev) {
    const Params& p = ev.params();
    const std::string& mode = p.text("mode");
    const Subject subject = subject_in(ev.value("fit"));
    const double t = p.real("t"), degree = glm::pi<double>() / 180;
    const UpAxis up = up_axis_of(p.text("up_axis"));
    const glm::dmat3 frame = frame_of(up);
    auto camera = std::make_shared<Camera>();
    if (mode == "turntable") {
        Orbit o;
        o.up = up;
        o.azimuth = (p.real("azimuth") + t * p.real("turn")) * degree;
        o.elevation = p.real("elevation") * degree;
        o.distance = p.real("distance");
        o.aspect = p.real("aspect");
        o.vertical_fov = p.real("fov") * degree;
        *camera = orbit_camera(subject, o);
    } else {
        const Keyframe k = mode == "walkthrough" ? at_time(walkthrough(), t) : at_time(keyframes_of(p), t);
        camera->eye = subject.center + subject.radius * (frame * k.eye);
        camera->target = subject.center + subject.radius * (frame * k.target);
        camera->up = frame[2];
        camera->vertical_fov = p.real("fov") * degree;
        camera->height = 2 * subject.radius;
    }
    ev.output("camera", CameraPtr(camera));
}

}  // namespace

NodeType path_node() {
    NodeType node;
    node.id = "scene.path";
    node.title = "Camera path";
    node.doc = "Moves a camera around a volume, or through it.";
    node.keywords = {"animation", "turntable", "keyframes", "walkthrough", "flight", "sweep", "camera"};
    node.inputs = {{"fit", {PortType::volume, PortType::bricks, PortType::series, PortType::lattice},
                    "What the path is fitted to; no voxel of it is read.", true}};
    node.outputs = {{"camera", PortType::camera, "The camera at time t."}};
    node.params = {
        param::choice("mode", {"turntable", "keyframes", "walkthrough"}, "turntable",
                      "Around the volume, through given points, or a flight through it."),
        param::real("t", 0, "Time on the path, from 0 to 1.").range(0, 1).slider(0, 1),
        param::choice("up_axis", {"x", "y", "z", "-x", "-y", "-z"}, "z", "World axis that points up in the picture."),
        param::real("fov", 30, "Angle of view from the bottom to the top of the picture.")
            .range(0.1, 170).slider(5, 120).in_unit("degrees"),
        param::real("azimuth", 0, "Where it begins, counterclockwise from above.")
            .range(-36000, 36000).slider(-180, 180).in_unit("degrees").in_group("Turntable").shown_if("mode", {"turntable"}),
        param::real("turn", 360, "How far it goes in all.")
            .range(-36000, 36000).slider(-720, 720).in_unit("degrees").in_group("Turntable").shown_if("mode", {"turntable"}),
        param::real("elevation", 20, "Height of the eye above the plane across the up axis.")
            .range(-90, 90).slider(-90, 90).in_unit("degrees").in_group("Turntable").shown_if("mode", {"turntable"}),
        param::real("distance", 1, "Distance of the eye, as a multiple of that at which the volume just fits.")
            .range(0.001, 1e6).slider(0.1, 4, Scale::logarithmic).in_group("Turntable").shown_if("mode", {"turntable"}),
        param::real("aspect", 1, "Width over height of the picture that the volume is fitted to.")
            .range(1e-3, 1e3).slider(0.5, 2, Scale::logarithmic).in_group("Turntable").shown_if("mode", {"turntable"}),
        param::rows("keyframes", 7, {{0, 0, -3, 0, 0, 0, 0}, {1, 0, -1.5, 0, 0, 0, 0}},
                    "Time, eye x, y, z and target x, y, z, in radii of the fitted sphere from its centre, z upwards.")
            .range(-1e6, 1e6).in_group("Keyframes").shown_if("mode", {"keyframes"})};
    node.method = kMethod;
    node.describe = describe;
    node.evaluate = evaluate;
    return node;
}

}  // namespace voxloom::scene
