// Smooth paths through given points.
#pragma once

#include <glm/glm.hpp>
#include <span>

namespace voxloom::scene {

// Where the camera is at a time: eye and target.
struct Keyframe {
    double time;
    glm::dvec3 eye, target;
};

// Through all keyframes (times increasing) with continuous velocity: cubic Hermite, the velocity at a
// keyframe being that of the parabola through it and its neighbours, so uneven times do not overshoot.
// Before the first and after the last it stands still. `keys` is not empty.
Keyframe at_time(std::span<const Keyframe> keys, double time);

}  // namespace voxloom::scene
