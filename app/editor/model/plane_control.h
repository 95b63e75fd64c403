// Moving and turning a cutting plane by the parameters of the node that says where it is: any node with
// `normal`, a vector, and `origin`, a point that counts from 0 to 1 from the first to the last voxel.
#pragma once

#include <optional>
#include <string>

#include "app/editor/model/evaluator.h"
#include "app/editor/model/workspace.h"

namespace voxloom::editor {

// The node whose plane a picture shows: the nearest at or upstream of it; one that selects bricks goes
// first, for what draws a selection draws the selection's plane.
std::optional<std::string> plane_of(const Graph& graph, const Registry& registry, const std::string& node);

struct Plane {
    glm::dvec3 point, normal;  // in the world; the normal is of unit length
    glm::dmat4 index_to_world{1.0};
    glm::dvec3 extent{0.0};    // of the volume, in index units
};
// As the document has it; nothing where the volume is not known, or the normal is zero.
std::optional<Plane> plane_now(const Graph& graph, const Registry& registry, const std::string& node, const Evaluator::State& state);

// Along its normal, by a world length; the point stays within the volume's box.
void move_plane(Workspace& workspace, const std::string& node, const Plane& plane, double distance);
void turn_plane(Workspace& workspace, const std::string& node, glm::dvec3 normal);

}  // namespace voxloom::editor
