// Camera and lights, in world coordinates and double precision.
#pragma once

#include <glm/glm.hpp>
#include <memory>
#include <vector>

namespace voxloom {

struct Ray {
    glm::dvec3 origin;
    glm::dvec3 direction;  // unit length
};

struct Camera {
    enum class Projection { perspective, orthographic };
    Projection projection = Projection::perspective;
    glm::dvec3 eye{0, 0, 1};
    glm::dvec3 target{0, 0, 0};
    glm::dvec3 up{0, 1, 0};      // any direction; a parallel one is replaced
    double vertical_fov = 0.7;   // radians, perspective
    double height = 1;           // of the view in world units, orthographic
    double near = 0;             // smallest distance along the axis that is drawn; 0: the eye itself

    glm::dvec3 forward() const;  // unit, from eye to target
    glm::dvec3 right() const;    // unit
    glm::dvec3 true_up() const;  // unit, normal to forward and right
    // World to eye space: x right, y up, z towards the viewer (looking down -z).
    glm::dmat4 view() const;
    // Height of the view at distance 1 along the axis (perspective), or anywhere (orthographic).
    double unit_height() const;
    // The ray through the point (x, y) of an image of width x height pixels; pixel centres are at
    // +1/2, y points down. Orthographic rays start on the plane through the eye.
    Ray ray(double x, double y, int width, int height) const;
};
using CameraPtr = std::shared_ptr<const Camera>;

struct Light {
    enum class Kind { headlight, directional, point };
    Kind kind = Kind::headlight;       // headlight: from the eye along the view
    glm::dvec3 position{0, 0, 1};      // directional: towards the light; point: where it is (world)
    glm::dvec3 color{1, 1, 1};
};

// Blinn-Phong: colour * (ambient + sum diffuse*max(0,n.l)) + light * specular*max(0,n.h)^shininess,
// two-sided (|n.l|) because a gradient has no outside.
struct Lights {
    std::vector<Light> lights{Light{}};
    double ambient = 0.3;
    double diffuse = 0.6;
    double specular = 0.3;
    double shininess = 30;
};
using LightsPtr = std::shared_ptr<const Lights>;

}  // namespace voxloom
