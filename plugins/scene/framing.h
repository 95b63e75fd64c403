// Where to stand so that a volume fills the picture.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <string_view>

#include "core/data/camera.h"
#include "core/data/value.h"

namespace voxloom::scene {

// What is looked at, in world coordinates. The sphere about the centre holds all corners.
struct Subject {
    glm::dvec3 center{0.0};
    double radius = 1;  // above 0
    std::array<glm::dvec3, 8> corners;
};
// The world box of a volume's samples, oriented as the volume is. An empty volume, or one whose
// spacing is 0, is a point; it is given the radius of its spacing, or else 1.
// Throws Error when the volume's place in the world is not finite.
Subject subject_of(const VolumeDesc& volume);
// Without a volume: the cube that the unit sphere about the origin holds.
Subject unit_subject();
// The volume behind a value, whatever it is; the unit cube where there is none. Throws Error where the
// value does not say where its voxels lie.
Subject subject_in(const Value& fit);

enum class UpAxis { x, y, z, minus_x, minus_y, minus_z };
UpAxis up_axis_of(std::string_view name);  // "x", "-x", ...
// From a frame with z upwards, seen from -y, to the world.
glm::dmat3 frame_of(UpAxis up);

// Angles in radians. With azimuth and elevation 0 the eye stands at -y of the subject (at +z where
// up is along y). Azimuth turns it counterclockwise as seen from above, elevation lifts it, roll
// turns the camera clockwise about its axis.
struct Orbit {
    UpAxis up = UpAxis::z;
    double azimuth = 0, elevation = 0, roll = 0;
    double distance = 1;         // times the distance at which the subject just fits
    double zoom = 1;             // magnifies the picture about its centre
    glm::dvec3 offset{0.0};      // of the point looked at, in radii of the subject
    bool tight = false;          // fit the box as seen from here instead of the sphere
    double aspect = 1;           // width over height of the picture that is fitted
    Camera::Projection projection = Camera::Projection::perspective;
    double vertical_fov = 0.5;   // radians
};
Camera orbit_camera(const Subject& subject, const Orbit& orbit);

}  // namespace voxloom::scene
