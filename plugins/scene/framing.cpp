#include "plugins/scene/framing.h"

#include <algorithm>
#include <cmath>

#include "core/base/error.h"

namespace voxloom::scene {

namespace {

bool finite(glm::dvec3 v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

glm::dvec3 direction_of(UpAxis axis) {
    switch (axis) {
        case UpAxis::x: return {1, 0, 0};
        case UpAxis::y: return {0, 1, 0};
        case UpAxis::z: return {0, 0, 1};
        case UpAxis::minus_x: return {-1, 0, 0};
        case UpAxis::minus_y: return {0, -1, 0};
        case UpAxis::minus_z: break;
    }
    return {0, 0, -1};
}

// How far along its axis a camera must stand from the subject's centre, and how high its view must
// be where it is orthographic, for everything to be in the picture.
struct Fit {
    double distance, height;
};

Fit fit_sphere(double radius, double tan_v, double tan_h) {
    double half_angle = std::atan(std::min(tan_v, tan_h));
    return {radius / std::sin(half_angle), 2 * radius * std::max(1.0, tan_v / tan_h)};
}

Fit fit_box(const Subject& subject, const Camera& camera, double tan_v, double tan_h) {
    const glm::dvec3 right = camera.right(), up = camera.true_up(), back = -camera.forward();
    Fit fit{0, 0};
    for (glm::dvec3 corner : subject.corners) {
        glm::dvec3 d = corner - subject.center;
        double x = std::abs(glm::dot(d, right)), y = std::abs(glm::dot(d, up));
        fit.distance = std::max(fit.distance, glm::dot(d, back) + std::max(x / tan_h, y / tan_v));
        fit.height = std::max(fit.height, 2 * std::max(y, x * tan_v / tan_h));
    }
    // A subject without extent across the view would be infinitely large in the picture.
    double least = 1e-6 * subject.radius;
    return {std::max(fit.distance, least), std::max(fit.height, least)};
}

}  // namespace

Subject subject_of(const VolumeDesc& volume) {
    SamplingBox box = sampling_box(volume);
    box.hi = glm::max(box.hi, box.lo);
    auto to_world = [&](glm::dvec3 index) {
        return glm::dvec3(volume.index_to_world * glm::dvec4(index, 1.0));
    };
    Subject subject;
    subject.center = to_world(0.5 * (box.lo + box.hi));
    subject.radius = 0;
    for (int i = 0; i < 8; ++i) {
        subject.corners[std::size_t(i)] = to_world({i & 1 ? box.hi.x : box.lo.x,
                                                    i & 2 ? box.hi.y : box.lo.y,
                                                    i & 4 ? box.hi.z : box.lo.z});
        subject.radius = std::max(
            subject.radius, glm::distance(subject.center, subject.corners[std::size_t(i)]));
        if (!finite(subject.corners[std::size_t(i)]))
            fail("a camera cannot be fitted to the volume, whose corners in the world are not "
                 "finite; give it a finite spacing and origin");
    }
    if (subject.radius == 0) {
        glm::dvec3 s = volume.spacing();
        subject.radius = std::max({s.x, s.y, s.z});
    }
    if (!(subject.radius > 0) || !std::isfinite(subject.radius)) subject.radius = 1;
    return subject;
}

Subject unit_subject() {
    Subject subject;
    for (int i = 0; i < 8; ++i)
        subject.corners[std::size_t(i)] =
            glm::dvec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1) / std::sqrt(3.0);
    return subject;
}

UpAxis up_axis_of(std::string_view name) {
    if (name == "x") return UpAxis::x;
    if (name == "y") return UpAxis::y;
    if (name == "-x") return UpAxis::minus_x;
    if (name == "-y") return UpAxis::minus_y;
    return name == "z" ? UpAxis::z : UpAxis::minus_z;
}

Subject subject_in(const Value& fit) {
    if (is_empty(fit)) return unit_subject();
    ValueDesc desc = describe(fit);
    const VolumeDesc* volume = desc.volume();
    if (!volume) fail("input 'fit' does not say where its voxels lie; wire a Volume to it");
    return subject_of(*volume);
}

glm::dmat3 frame_of(UpAxis up) {
    const glm::dvec3 axis = direction_of(up);
    const glm::dvec3 front = axis.y == 0 ? glm::dvec3(0, -1, 0) : glm::dvec3(0, 0, 1);
    return {glm::cross(axis, front), -front, axis};
}

Camera orbit_camera(const Subject& subject, const Orbit& orbit) {
    const glm::dmat3 frame = frame_of(orbit.up);
    const glm::dvec3 side = frame[0], front = -frame[1], axis = frame[2];
    const glm::dvec3 around = front * std::cos(orbit.azimuth) + side * std::sin(orbit.azimuth);
    const double c = std::cos(orbit.elevation), s = std::sin(orbit.elevation);
    const glm::dvec3 to_eye = around * c + axis * s;
    const glm::dvec3 up = axis * c - around * s;  // across the view at the poles too
    const glm::dvec3 right = glm::cross(up, to_eye);

    Camera camera;
    camera.projection = orbit.projection;
    camera.up = up * std::cos(orbit.roll) + right * std::sin(orbit.roll);
    camera.eye = to_eye;  // only the direction, for fit_box
    camera.target = glm::dvec3(0.0);

    const double tan_v = std::tan(orbit.vertical_fov / 2), tan_h = tan_v * orbit.aspect;
    const Fit fit = orbit.tight ? fit_box(subject, camera, tan_v, tan_h)
                                : fit_sphere(subject.radius, tan_v, tan_h);
    camera.vertical_fov = 2 * std::atan(tan_v / orbit.zoom);
    camera.height = fit.height / orbit.zoom;
    // An orthographic picture is the same from any distance: stand clear of the subject.
    const double distance =
        orbit.projection == Camera::Projection::perspective ? fit.distance : 2 * subject.radius;
    const double away = distance * orbit.distance;
    camera.eye = subject.center + orbit.offset * subject.radius + to_eye * away;
    // The point looked at; further on where the eye has come so near that its direction would suffer.
    camera.target = camera.eye - to_eye * std::max(away, subject.radius);
    return camera;
}

}  // namespace voxloom::scene
