#include "app/editor/model/plane_control.h"

#include <algorithm>
#include <cmath>

#include "app/editor/model/param_values.h"
#include "app/editor/model/ports.h"
#include "app/editor/model/upstream.h"

namespace voxloom::editor {

namespace {

bool is_vector(const NodeType& type, const char* key) {
    const ParamSpec* spec = type.find_param(key);
    return spec && spec->kind == ParamKind::vector && spec->length == 3;
}

glm::dvec3 vector_of(const GraphNode& node, const NodeType& type, const char* key) {
    const ParamValue value = value_of(node, *type.find_param(key));
    const auto* v = std::get_if<std::vector<double>>(&value);
    return v && v->size() == 3 ? glm::dvec3((*v)[0], (*v)[1], (*v)[2]) : glm::dvec3(0.0);
}

void set_vector(Workspace& workspace, const std::string& node, const char* key, glm::dvec3 v) {
    workspace.document.set_param(node, key, std::vector<double>{short_number(v.x), short_number(v.y), short_number(v.z)});
}

}  // namespace

std::optional<std::string> plane_of(const Graph& graph, const Registry& registry, const std::string& start) {
    std::optional<std::string> found;
    for (const GraphNode* node : upstream(graph, start)) {
        const NodeType* type = registry.find(node->type);
        if (!type || !is_vector(*type, "normal") || !is_vector(*type, "origin")) continue;
        const bool selects = std::ranges::any_of(type->outputs, [](const PortSpec& port) { return type_of(port) == PortType::selection; });
        if (selects) return node->id;
        if (!found) found = node->id;
    }
    return found;
}

std::optional<Plane> plane_now(const Graph& graph, const Registry& registry, const std::string& id, const Evaluator::State& state) {
    const GraphNode* node = graph.find(id);
    const NodeType* type = node ? registry.find(node->type) : nullptr;
    if (!type) return {};
    const glm::dvec3 normal = vector_of(*node, *type, "normal");
    const double length = glm::length(normal);
    if (!(length > 0) || !std::isfinite(length)) return {};
    for (const GraphInput& input : node->inputs)
        for (const WireEnd& end : input.from) {
            auto status = state.nodes.find(end.node);
            if (status == state.nodes.end()) continue;
            for (const ValueDesc& desc : status->second.outputs) {
                const VolumeDesc* volume = desc.volume();
                if (!volume || volume->voxels() == 0) continue;
                const glm::dvec3 at = vector_of(*node, *type, "origin") * volume->extent();
                return Plane{glm::dvec3(volume->index_to_world * glm::dvec4(at, 1)), normal / length, volume->index_to_world, volume->extent()};
            }
        }
    return {};
}

void move_plane(Workspace& workspace, const std::string& node, const Plane& plane, double distance) {
    const glm::dvec3 index(glm::inverse(plane.index_to_world) * glm::dvec4(plane.point + plane.normal * distance, 1));
    const glm::dvec3 share = index / glm::max(plane.extent, glm::dvec3(1));
    set_vector(workspace, node, "origin", glm::clamp(share, 0.0, 1.0));
}

void turn_plane(Workspace& workspace, const std::string& node, glm::dvec3 normal) {
    const double length = glm::length(normal);
    if (length > 0 && std::isfinite(length)) set_vector(workspace, node, "normal", normal / length);
}

}  // namespace voxloom::editor
