#include "core/data/camera.h"

#include <cmath>

namespace voxloom {

glm::dvec3 Camera::forward() const {
    glm::dvec3 d = target - eye;
    double length = glm::length(d);
    return length > 0 ? d / length : glm::dvec3(0, 0, -1);
}

glm::dvec3 Camera::right() const {
    glm::dvec3 f = forward();
    glm::dvec3 r = glm::cross(f, up);
    if (glm::length(r) <= 1e-9 * glm::length(up)) {
        // `up` is along the view: take the world axis that is most across it.
        glm::dvec3 a = glm::abs(f);
        glm::dvec3 other = a.x <= a.y && a.x <= a.z ? glm::dvec3(1, 0, 0)
                           : a.y <= a.z             ? glm::dvec3(0, 1, 0)
                                                    : glm::dvec3(0, 0, 1);
        r = glm::cross(f, other);
    }
    return glm::normalize(r);
}

glm::dvec3 Camera::true_up() const { return glm::cross(right(), forward()); }

glm::dmat4 Camera::view() const {
    glm::dvec3 r = right(), u = true_up(), f = forward();
    glm::dmat4 m(1.0);
    for (int c = 0; c < 3; ++c) {
        m[c][0] = r[c];
        m[c][1] = u[c];
        m[c][2] = -f[c];
    }
    m[3] = glm::dvec4(-glm::dot(r, eye), -glm::dot(u, eye), glm::dot(f, eye), 1.0);
    return m;
}

double Camera::unit_height() const {
    return projection == Projection::perspective ? 2 * std::tan(vertical_fov / 2) : height;
}

Ray Camera::ray(double x, double y, int w, int h) const {
    double pixel = unit_height() / h;
    glm::dvec3 across = right() * ((x - w * 0.5) * pixel) + true_up() * ((h * 0.5 - y) * pixel);
    if (projection == Projection::orthographic) return {eye + across, forward()};
    return {eye, glm::normalize(forward() + across)};
}

}  // namespace voxloom
