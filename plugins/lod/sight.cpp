#include "plugins/lod/sight.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/base/error.h"

namespace voxloom::lod {

Region region_of(const VolumeDesc& volume, const Box& box) {
    Region r{glm::dvec3(box.lo), glm::min(glm::dvec3(box.hi), glm::dvec3(volume.dims - Index3(1)))};
    for (int a = 0; a < 3; ++a)
        if (volume.dims[a] == 1) {
            r.lo[a] = -0.5;
            r.hi[a] = 0.5;
        }
    return r;
}

glm::dvec4 in_index_space(const glm::dvec4& plane, const VolumeDesc& volume) {
    return plane * volume.index_to_world;  // row times matrix: the plane of the points it maps onto it
}

Reach reach(const Region& region, const glm::dvec4& plane) {
    const glm::dvec3 n(plane);
    return {glm::dot(n, region.centre()) + plane.w, glm::dot(glm::abs(n), region.half())};
}

Sight::Sight(const Camera& camera, glm::ivec2 size, const BricksDesc& bricks) {
    const VolumeDesc& volume = bricks.volume;
    perspective_ = camera.projection == Camera::Projection::perspective;
    const glm::dvec3 f = camera.forward(), r = camera.right(), u = camera.true_up();
    const double half_height = 0.5 * camera.unit_height();
    const double half_width = half_height * size.x / size.y;
    pixels_per_length_ = size.y / camera.unit_height();
    near_ = std::max(camera.near, 0.0);

    auto world_plane = [&](glm::dvec3 n, double offset) {
        return in_index_space(glm::dvec4(n, offset - glm::dot(n, camera.eye)), volume);
    };
    const double along = perspective_ ? 1 : 0, offset = perspective_ ? 0 : 1;
    depth_ = world_plane(f, 0);
    planes_ = {world_plane(r + along * half_width * f, offset * half_width),
               world_plane(-r + along * half_width * f, offset * half_width),
               world_plane(u + along * half_height * f, offset * half_height),
               world_plane(-u + along * half_height * f, offset * half_height), depth_};
    planes_[4].w -= near_;

    const SamplingBox box = sampling_box(volume);
    diagonal_ = 0;
    const glm::dmat3 to_world(volume.index_to_world);
    for (int corner = 0; corner < 4; ++corner) {
        glm::dvec3 d = box.hi - box.lo;
        if (corner & 1) d.x = -d.x;
        if (corner & 2) d.y = -d.y;
        diagonal_ = std::max(diagonal_, glm::length(to_world * d));
    }
    for (const LevelDesc& level : bricks.levels) {
        const glm::dvec3 s = volume.spacing() * glm::dvec3(level.stride);
        double widest = 0;
        for (int a = 0; a < 3; ++a)
            if (volume.dims[a] > 1) widest = std::max(widest, s[a]);
        spacing_.push_back(widest);
    }
    const glm::dmat4 to_index = glm::inverse(volume.index_to_world);
    eye_ = perspective_ ? glm::dvec3(to_index * glm::dvec4(camera.eye, 1.0))
                        : glm::dvec3(to_index * glm::dvec4(-f, 0.0));
    if (!std::isfinite(glm::dot(eye_, glm::dvec3(1))))
        fail("the volume's index_to_world matrix cannot be inverted; correct its spacing or orientation");
}

bool Sight::sees(const Region& region) const {
    return std::ranges::all_of(planes_, [&](const glm::dvec4& plane) {
        const Reach r = reach(region, plane);
        return r.centre + r.half > 1e-9 * r.half;
    });
}

double Sight::depth(const Region& region) const {
    const Reach r = reach(region, depth_);
    return std::max({r.centre - r.half, near_, 0.0});
}

double Sight::nearness(double depth) const { return perspective_ ? diagonal_ / depth : 1.0; }

double Sight::pixels(int level, double depth) const {
    const double spacing = spacing_[std::size_t(level)];
    if (spacing == 0) return 0;  // a single voxel
    return spacing * pixels_per_length_ / (perspective_ ? depth : 1.0);
}

int Sight::octant_of_eye(glm::dvec3 split) const {
    const glm::bvec3 upper = glm::greaterThan(eye_, perspective_ ? split : glm::dvec3(0));
    return int(upper.x) | int(upper.y) << 1 | int(upper.z) << 2;
}

std::vector<int> Sight::back_to_front(int axis, int n, double thickness) const {
    std::vector<int> order(std::size_t(n), 0);
    std::iota(order.begin(), order.end(), 0);
    auto away = [&](int i) {
        if (!perspective_) return eye_[axis] > 0 ? double(-i) : double(i);
        return std::max({i * thickness - eye_[axis], eye_[axis] - (i + 1) * thickness, 0.0});
    };
    std::ranges::stable_sort(order, [&](int a, int b) { return away(a) > away(b); });
    return order;
}

}  // namespace voxloom::lod
