#include <cmath>
#include <glm/gtc/constants.hpp>

#include "plugins/scene/framing.h"
#include "plugins/scene/nodes.h"

namespace voxloom::scene {

namespace {

constexpr const char* kMethod = R"(
A pinhole or a parallel camera in world coordinates, in double precision.

**Orbit** looks at the centre of the volume wired to `fit`. The eye stands at `distance` times the
distance at which the volume just fits the picture, so 1 shows all of it and small values go inside.
With `framing: sphere` that distance is the same from every side: r/sin(fov/2) for the sphere of
radius r about the box, and an animation does not pump. With `framing: box` the eight corners of the
box just touch the picture's edge from where the camera stands. Without a volume the unit sphere
about the origin takes its place.

In patient coordinates (LPS: x to the left, y to the back, z to the head) `up_axis: z` stands the
patient upright and azimuth 0 looks into the face. For data whose rows run downwards use `-y`.

**Look-at** takes eye, target and up as they are.

Perspective shows depth; orthographic keeps parallel lines parallel and sizes comparable, which is
what measuring and comparing pictures needs. `zoom` magnifies without moving the eye.
)";

double radians(const Params& p, std::string_view key) {
    return p.real(key) * glm::pi<double>() / 180;
}

Camera::Projection projection_of(const Params& p) {
    return p.text("projection") == "perspective" ? Camera::Projection::perspective
                                                 : Camera::Projection::orthographic;
}

Camera orbit(const Params& p, const Value& fit) {
    Orbit o;
    o.up = up_axis_of(p.text("up_axis"));
    o.azimuth = radians(p, "azimuth");
    o.elevation = radians(p, "elevation");
    o.roll = radians(p, "roll");
    o.distance = p.real("distance");
    o.zoom = p.real("zoom");
    o.offset = p.vec3("offset");
    o.tight = p.text("framing") == "box";
    o.aspect = p.real("aspect");
    o.projection = projection_of(p);
    o.vertical_fov = radians(p, "fov");
    return orbit_camera(subject_in(fit), o);
}

Camera look_at(const Params& p, const Value& fit) {
    Camera camera;
    camera.projection = projection_of(p);
    camera.eye = p.vec3("eye");
    camera.target = p.vec3("target");
    camera.up = p.vec3("up");
    camera.vertical_fov = 2 * std::atan(std::tan(radians(p, "fov") / 2) / p.real("zoom"));
    camera.height = 2 * subject_in(fit).radius / p.real("zoom");
    return camera;
}

void describe_camera(Description& d) {
    const Params& p = d.params();
    if (p.text("mode") == "look-at" && p.vec3("eye") == p.vec3("target"))
        d.problem("eye and target are the same point; move one of them", "target");
}

void evaluate_camera(Evaluation& ev) {
    const Params& p = ev.params();
    Camera camera = p.text("mode") == "orbit" ? orbit(p, ev.value("fit"))
                                              : look_at(p, ev.value("fit"));
    if (p.real("height") > 0) camera.height = p.real("height") / p.real("zoom");
    camera.near = p.real("near");
    ev.output("camera", std::make_shared<Camera>(camera));
}

}  // namespace

NodeType camera_node() {
    NodeType node;
    node.id = "scene.camera";
    node.title = "Camera";
    node.doc = "Places a camera around a volume, or anywhere in the world.";
    node.keywords = {"view", "orbit", "look at", "perspective", "orthographic", "fit", "zoom"};
    node.inputs = {{"fit", {PortType::volume, PortType::bricks, PortType::series, PortType::lattice},
                    "What the camera is fitted to; no voxel of it is read.", true}};
    node.outputs = {{"camera", PortType::camera, "The camera."}};
    node.params = {
        param::choice("mode", {"orbit", "look-at"}, "orbit",
                      "Whether the camera goes around the fitted volume or stands where it is told."),
        param::real("azimuth", 30, "Turns the eye around the up axis, counterclockwise from above.")
            .range(-36000, 36000).slider(-180, 180).in_unit("degrees").in_group("Orbit")
            .shown_if("mode", {"orbit"}),
        param::real("elevation", 20, "Lifts the eye above the plane across the up axis.")
            .range(-36000, 36000).slider(-90, 90).in_unit("degrees").in_group("Orbit")
            .shown_if("mode", {"orbit"}),
        param::real("roll", 0, "Turns the camera clockwise about its own axis.")
            .range(-36000, 36000).slider(-180, 180).in_unit("degrees").in_group("Orbit")
            .shown_if("mode", {"orbit"}),
        param::real("distance", 1,
                    "Distance of the eye, as a multiple of that at which the volume just fits.")
            .range(0, 1e6).slider(0.1, 4, Scale::logarithmic).in_group("Orbit")
            .shown_if("mode", {"orbit"}),
        param::vector("offset", {0, 0, 0},
                      "Moves the point looked at away from the volume's centre, in radii of the "
                      "fitted sphere.")
            .range(-1e6, 1e6).slider(-1, 1).in_group("Orbit").shown_if("mode", {"orbit"}),
        param::choice("up_axis", {"z", "y", "x", "-z", "-y", "-x"}, "z",
                      "World axis that points up in the picture; z is the patient's head.")
            .in_group("Orbit").shown_if("mode", {"orbit"}),
        param::choice("framing", {"sphere", "box"}, "sphere",
                      "What just fits at distance 1: the sphere about the volume, the same from every "
                      "side, or its box as seen from here.")
            .in_group("Orbit").shown_if("mode", {"orbit"}),
        param::real("aspect", 1, "Width over height of the picture that the volume is fitted to.")
            .range(1e-3, 1e3).slider(0.5, 2, Scale::logarithmic).in_group("Orbit")
            .shown_if("mode", {"orbit"}),
        param::vector("eye", {0, -3, 0}, "Where the camera stands, in world coordinates.")
            .range(-1e30, 1e30).in_group("Look at").shown_if("mode", {"look-at"}),
        param::vector("target", {0, 0, 0}, "The point that it looks at, in world coordinates.")
            .range(-1e30, 1e30).in_group("Look at").shown_if("mode", {"look-at"}),
        param::vector("up", {0, 0, 1}, "What points up in the picture; need not be normal to the view.")
            .range(-1e30, 1e30).in_group("Look at").shown_if("mode", {"look-at"}),
        param::choice("projection", {"perspective", "orthographic"}, "perspective",
                      "Whether what is further away is smaller.").in_group("Lens"),
        param::real("fov", 30, "Angle of view from the bottom to the top of the picture, at zoom 1.")
            .range(0.1, 170).slider(5, 120).in_unit("degrees").in_group("Lens")
            .shown_if("projection", {"perspective"}),
        param::real("height", 0,
                    "Height of the view in world units at zoom 1; 0 takes what fits the volume.")
            .range(0, 1e30).in_unit("world").in_group("Lens")
            .shown_if("projection", {"orthographic"}),
        param::real("zoom", 1, "Magnifies the picture about its centre without moving the eye.")
            .range(1e-3, 1e6).slider(0.1, 20, Scale::logarithmic).in_group("Lens"),
        param::real("near", 0, "Nothing nearer than this along the view is drawn; 0 draws all of it.")
            .range(0, 1e30).in_unit("world").in_group("Lens"),
    };
    node.method = kMethod;
    node.describe = describe_camera;
    node.evaluate = evaluate_camera;
    return node;
}

}  // namespace voxloom::scene
