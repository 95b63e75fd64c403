// Turning what is seen in a picture, by the parameters of the camera node that the picture is made with.
//
// A camera node is any node that gives a Camera and has the parameters azimuth and elevation. What a
// control needs beyond that and the node lacks, it does not do.
#pragma once

#include <optional>
#include <string>

#include "app/editor/model/workspace.h"
#include "core/data/camera.h"

namespace voxloom::editor {

// The camera nearest upstream of an output, or nothing.
std::optional<std::string> camera_of(const Graph& graph, const Registry& registry, const std::string& node);

// Degrees; the object follows the hand, so to the right is a smaller azimuth and down a larger elevation.
void orbit(Workspace& workspace, const Registry& registry, const std::string& camera, glm::dvec2 degrees);
// By a share of the picture's height, to the right and down; `now` is the camera as it was evaluated.
void pan(Workspace& workspace, const Registry& registry, const std::string& camera, glm::dvec2 by, const Camera& now);
void magnify(Workspace& workspace, const Registry& registry, const std::string& camera, double factor);
// Looks from these angles, upright.
void look_from(Workspace& workspace, const Registry& registry, const std::string& camera, double azimuth, double elevation);
void reset_camera(Workspace& workspace, const Registry& registry, const std::string& camera);
void toggle_projection(Workspace& workspace, const Registry& registry, const std::string& camera);

}  // namespace voxloom::editor
