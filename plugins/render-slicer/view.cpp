#include "plugins/render-slicer/view.h"

#include <algorithm>
#include <cmath>

#include "core/base/error.h"

namespace voxloom::slicer {

View::View(const Camera& camera, const VolumeDesc& desc, glm::ivec2 pixels, double slice_distance)
    : size(pixels) {
    const glm::dmat3 to_world(desc.index_to_world);
    const glm::dvec3 spacing = desc.spacing();
    smallest_spacing = std::min({spacing.x, spacing.y, spacing.z});
    // Scaled columns: the determinant then says how far the axes are from a plane, whatever the unit.
    glm::dmat3 directions = to_world;
    for (int a = 0; a < 3; ++a) directions[a] /= spacing[a];
    if (!(smallest_spacing > 0) || !std::isfinite(spacing.x + spacing.y + spacing.z) ||
        std::abs(glm::determinant(directions)) < 1e-9)
        fail("the volume's index_to_world matrix cannot be inverted: an axis has no length or lies in "
             "the plane of the other two; correct the spacing or the orientation of the file");
    // Inverse of M = directions * diag(spacing).
    glm::dmat3 to_index = glm::inverse(directions);
    for (int c = 0; c < 3; ++c)
        for (int a = 0; a < 3; ++a) to_index[c][a] /= spacing[a];

    box = sampling_box(desc);
    middle = 0.5 * (box.lo + box.hi);
    middle_world = glm::dvec3(desc.index_to_world * glm::dvec4(middle, 1.0));
    diagonal = 0;
    for (int corner = 0; corner < 4; ++corner) {
        glm::dvec3 half = 0.5 * (box.hi - box.lo);
        if (corner & 1) half.x = -half.x;
        if (corner & 2) half.y = -half.y;
        diagonal = std::max(diagonal, 2 * glm::length(to_world * half));
    }

    const glm::dvec3 f = camera.forward(), r = camera.right(), u = camera.true_up();
    perspective = camera.projection == Camera::Projection::perspective;
    plane_distance = slice_distance * smallest_spacing;
    // Half the extent of the box along the view.
    double half_depth = 0;
    for (int a = 0; a < 3; ++a)
        half_depth += 0.5 * (box.hi[a] - box.lo[a]) * std::abs(glm::dot(to_world[a], f));
    planes = 2 * half_depth / plane_distance;

    // A pixel is x r + y u across the axis at depth 1 (perspective), or anywhere.
    const double pixel = camera.unit_height() / size.y;
    const glm::dvec3 across_0 = r * (-0.5 * size.x * pixel) + u * (0.5 * size.y * pixel);
    const glm::dvec3 across_x = r * pixel, across_y = u * -pixel;
    const glm::dvec3 from_middle = camera.eye - middle_world;  // of the eye
    const double depth = -glm::dot(from_middle, f);            // of plane 0
    auto index = [&](glm::dvec3 world) { return to_index * world; };
    const double grow = perspective ? depth : 1.0;
    point_0 = middle + index(from_middle + depth * f + grow * across_0);
    point_x = index(grow * across_x);
    point_y = index(grow * across_y);
    step_0 = index(plane_distance * (perspective ? f + across_0 : f));
    step_x = perspective ? index(plane_distance * across_x) : glm::dvec3(0.0);
    step_y = perspective ? index(plane_distance * across_y) : glm::dvec3(0.0);
    if (perspective)
        slope = {-0.5 * size.x * pixel, pixel, 0.5 * size.y * pixel, -pixel};
    near_plane = (std::max(camera.near, 0.0) - depth) / plane_distance;

    // A few pixels more on each side, for squares that the picture's border cuts.
    const glm::dvec2 half = (0.5 * glm::dvec2(size) + 8.0) * pixel;
    auto coordinate = [&](glm::dvec3 axis) {  // along a world axis, from the eye
        const glm::dvec3 n = glm::transpose(to_world) * axis;
        return glm::dvec4(n, -glm::dot(n, middle) - glm::dot(axis, from_middle));
    };
    const glm::dvec4 right = coordinate(r), above = coordinate(u), away_of = coordinate(f);
    const glm::dvec4 depth_of = perspective ? away_of : glm::dvec4(0, 0, 0, 1);
    outside_ = {right - half.x * depth_of, -right - half.x * depth_of, above - half.y * depth_of, -above - half.y * depth_of,
                glm::dvec4(0, 0, 0, std::max(camera.near, 0.0)) - away_of};

    // The picture of the box is inside of that of its corners; all of it where one is behind the eye.
    glm::dvec2 lo(size), hi(0);
    for (int corner = 0; corner < 8; ++corner) {
        const glm::dvec3 at(corner & 1 ? box.hi.x : box.lo.x, corner & 2 ? box.hi.y : box.lo.y,
                            corner & 4 ? box.hi.z : box.lo.z);
        const glm::dvec3 from_eye = to_world * (at - middle) - from_middle;
        const double away = perspective ? glm::dot(from_eye, f) : 1.0;
        if (away < 1e-6 * diagonal) {
            lo = glm::dvec2(0);
            hi = glm::dvec2(size);
            break;
        }
        const glm::dvec2 at_pixel = 0.5 * glm::dvec2(size) + glm::dvec2(glm::dot(from_eye, r), -glm::dot(from_eye, u)) /
                                                                 (away * pixel);
        lo = glm::min(lo, at_pixel);
        hi = glm::max(hi, at_pixel);
    }
    // One pixel more, for rounding.
    lo = glm::clamp(lo - 1.0, glm::dvec2(0), glm::dvec2(size));
    hi = glm::clamp(hi + 1.0, lo, glm::dvec2(size));
    bounds = glm::ivec4(glm::floor(lo), glm::ceil(hi));

    for (int side : {4, 2}) {
        constexpr int kMostReach = 3;  // wider blocks would be seen too often
        double widest = 0;
        for (double m : {-0.5 * planes, 0.5 * planes}) {
            glm::dvec3 spread = glm::abs(point_x + m * step_x) + glm::abs(point_y + m * step_y);
            widest = std::max({widest, spread.x, spread.y, spread.z});
        }
        const double reach = std::ceil(0.5 * side * widest + 0.01);
        if (reach > kMostReach) continue;
        square = side;
        reach_ = int(reach);
        break;
    }

    index_to_place = to_world / diagonal;
    gradient_to_world = smallest_spacing * glm::transpose(to_index);
    eye_place = perspective ? glm::dvec4(from_middle / diagonal, 1.0) : glm::dvec4(-f, 0.0);
}

void View::widen_slices(int times) {
    plane_distance *= times;
    planes /= times;
    near_plane /= times;
    step_0 *= double(times);
    step_x *= double(times);
    step_y *= double(times);
}

bool View::may_meet(const Box& b) const {
    // Up to the first voxel behind it.
    const glm::dvec3 middle_of = 0.5 * glm::dvec3(b.lo + b.hi), half = 0.5 * glm::dvec3(b.hi - b.lo);
    for (const glm::dvec4& o : outside_)
        if (glm::dot(glm::dvec3(o), middle_of) + o.w > glm::dot(glm::abs(glm::dvec3(o)), half)) return false;
    return true;
}

void View::set(const gpu::Program& p) const {
    p.set("point_0", glm::vec3(point_0));
    p.set("point_x", glm::vec3(point_x));
    p.set("point_y", glm::vec3(point_y));
    p.set("step_0", glm::vec3(step_0));
    p.set("step_x", glm::vec3(step_x));
    p.set("step_y", glm::vec3(step_y));
    p.set("slope", glm::vec4(slope));
    p.set("near_plane", float(std::max(near_plane, -1e9)));
    p.set("box_lo", glm::vec3(box.lo));
    p.set("box_hi", glm::vec3(box.hi));
    p.set("middle", glm::vec3(middle));
    p.set("index_to_place", glm::mat3(index_to_place));
    p.set("gradient_to_world", glm::mat3(gradient_to_world));
}

}  // namespace voxloom::slicer
