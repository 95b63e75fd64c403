#include "app/editor/model/camera_control.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/constants.hpp>

#include "app/editor/model/param_values.h"
#include "app/editor/model/ports.h"
#include "app/editor/model/upstream.h"

namespace voxloom::editor {

namespace {

// A node and its description, for reading and writing parameters by key.
class Knobs {
  public:
    Knobs(Workspace& workspace, const Registry& registry, const std::string& id) : work_(workspace), id_(id) {
        const GraphNode* node = workspace.graph().find(id);
        type_ = node ? registry.find(node->type) : nullptr;
    }
    const ParamSpec* spec(const char* key) const { return type_ ? type_->find_param(key) : nullptr; }
    double real(const char* key, double otherwise) const {
        const ParamValue v = value(key);
        if (auto* d = std::get_if<double>(&v)) return *d;
        if (auto* i = std::get_if<std::int64_t>(&v)) return double(*i);
        return otherwise;
    }
    std::string text(const char* key) const {
        const ParamValue v = value(key);
        auto* s = std::get_if<std::string>(&v);
        return s ? *s : "";
    }
    std::optional<glm::dvec3> vec3(const char* key) const {
        const ParamValue v = value(key);
        auto* n = std::get_if<std::vector<double>>(&v);
        if (!n || n->size() != 3) return {};
        return glm::dvec3((*n)[0], (*n)[1], (*n)[2]);
    }
    // Within the parameter's range, and no longer than people can read.
    void set(const char* key, double v) const {
        if (const ParamSpec* s = spec(key)) work_.document.set_param(id_, key, std::clamp(short_number(v), s->min, s->max));
    }
    void set(const char* key, glm::dvec3 v) const {
        if (spec(key)) work_.document.set_param(id_, key, std::vector<double>{short_number(v.x), short_number(v.y), short_number(v.z)});
    }
    void set(const char* key, const std::string& v) const {
        if (spec(key)) work_.document.set_param(id_, key, v);
    }
    void reset(const char* key) const { work_.document.reset_param(id_, key); }

  private:
    ParamValue value(const char* key) const {
        const GraphNode* node = work_.graph().find(id_);
        const ParamSpec* s = spec(key);
        return node && s ? value_of(*node, *s) : ParamValue(false);
    }
    Workspace& work_;
    std::string id_;
    const NodeType* type_ = nullptr;
};

double wrapped(double degrees) { return degrees - 360 * std::round(degrees / 360); }

glm::dvec3 rotated(glm::dvec3 v, glm::dvec3 axis, double radians) {
    return v * std::cos(radians) + glm::cross(axis, v) * std::sin(radians) + axis * glm::dot(axis, v) * (1 - std::cos(radians));
}

// A camera that stands where it is told goes around its target.
void orbit_eye(const Knobs& k, glm::dvec2 degrees) {
    const auto eye = k.vec3("eye"), target = k.vec3("target"), up = k.vec3("up");
    if (!eye || !target || !up || *eye == *target || glm::length(*up) == 0) return;
    const glm::dvec3 axis = glm::normalize(*up);
    glm::dvec3 from = rotated(*eye - *target, axis, -glm::radians(degrees.x));
    const double now = glm::degrees(std::asin(std::clamp(glm::dot(glm::normalize(from), axis), -1.0, 1.0)));
    const double wanted = std::clamp(now + degrees.y, -89.0, 89.0);
    const glm::dvec3 side = glm::cross(from, axis);
    if (glm::length(side) > 0) from = rotated(from, glm::normalize(side), glm::radians(wanted - now));
    k.set("eye", *target + from);
}

}  // namespace

std::optional<std::string> camera_of(const Graph& graph, const Registry& registry, const std::string& node) {
    for (const GraphNode* here : upstream(graph, node)) {
        const NodeType* type = registry.find(here->type);
        if (!type) continue;
        const bool gives = std::any_of(type->outputs.begin(), type->outputs.end(),
                                       [](const PortSpec& port) { return type_of(port) == PortType::camera; });
        if (gives && type->find_param("azimuth") && type->find_param("elevation")) return here->id;
    }
    return {};
}

void orbit(Workspace& workspace, const Registry& registry, const std::string& camera, glm::dvec2 degrees) {
    const Knobs k(workspace, registry, camera);
    Document::Step step(workspace.document);
    if (k.text("mode") == "look-at") return orbit_eye(k, degrees);
    k.set("azimuth", wrapped(k.real("azimuth", 0) - degrees.x));
    k.set("elevation", std::clamp(k.real("elevation", 0) + degrees.y, -90.0, 90.0));
}

void pan(Workspace& workspace, const Registry& registry, const std::string& camera, glm::dvec2 by, const Camera& now) {
    const Knobs k(workspace, registry, camera);
    const bool perspective = now.projection == Camera::Projection::perspective;
    const double distance = glm::distance(now.eye, now.target);
    const double height = now.unit_height() * (perspective ? distance : 1);
    const glm::dvec3 shift = (-by.x * now.right() + by.y * now.true_up()) * height;
    Document::Step step(workspace.document);
    if (k.text("mode") == "look-at") {
        const auto eye = k.vec3("eye"), target = k.vec3("target");
        if (!eye || !target) return;
        k.set("eye", *eye + shift);
        k.set("target", *target + shift);
        return;
    }
    // The offset counts radii of what the camera is fitted to: it stands where a sphere of that radius
    // just fits, times `distance`.
    const double radius = perspective ? distance * std::sin(glm::radians(k.real("fov", 30)) / 2) / std::max(k.real("distance", 1), 1e-6)
                                      : now.height * k.real("zoom", 1) / 2;
    if (const auto offset = k.vec3("offset"); offset && radius > 0) k.set("offset", *offset + shift / radius);
}

void magnify(Workspace& workspace, const Registry& registry, const std::string& camera, double factor) {
    const Knobs k(workspace, registry, camera);
    k.set("zoom", k.real("zoom", 1) * factor);
}

void look_from(Workspace& workspace, const Registry& registry, const std::string& camera, double azimuth, double elevation) {
    const Knobs k(workspace, registry, camera);
    Document::Step step(workspace.document);
    if (k.text("mode") == "look-at") k.set("mode", std::string("orbit"));
    k.set("azimuth", azimuth);
    k.set("elevation", elevation);
    k.reset("roll");
}

void reset_camera(Workspace& workspace, const Registry& registry, const std::string& camera) {
    const Knobs k(workspace, registry, camera);
    Document::Step step(workspace.document);
    for (const char* key : {"azimuth", "elevation", "roll", "distance", "offset", "zoom"})
        if (k.spec(key)) k.reset(key);
}

void toggle_projection(Workspace& workspace, const Registry& registry, const std::string& camera) {
    const Knobs k(workspace, registry, camera);
    k.set("projection", std::string(k.text("projection") == "orthographic" ? "perspective" : "orthographic"));
}

}  // namespace voxloom::editor
