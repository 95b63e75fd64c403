// Small scenes for the tests of the reference ray caster.
#pragma once

#include <cmath>
#include <vector>

#include "plugins/render-reference/raycast.h"
#include "tests/support/volumes.h"

namespace voxloom::reference::testing {

using Point = TransferFunction1D::Point;

inline TransferPtr transfer(std::vector<Point> points) {
    auto t = std::make_shared<TransferFunction>();
    t->one.points = std::move(points);
    return t;
}

// tau * c, tau
inline Emission glow(double tau, glm::dvec3 color = glm::dvec3(1.0)) {
    return Emission(tau * color, tau);
}

inline CameraPtr look(glm::dvec3 eye, glm::dvec3 target, glm::dvec3 up = {0, 1, 0}) {
    Camera c;
    c.eye = eye;
    c.target = target;
    c.up = up;
    return std::make_shared<Camera>(c);
}

inline VolumePtr with_matrix(const VolumePtr& volume, const glm::dmat4& index_to_world) {
    VolumeDesc desc = volume->desc();
    desc.index_to_world = index_to_world;
    Buffer voxels(desc.dense_bytes());
    volume->read(Box::of(desc.dims), voxels.bytes());
    return std::make_shared<DenseVolume>(desc, std::move(voxels));
}

// A smooth field with curvature in every direction, values about 0 to 1.
inline double waves(glm::dvec3 p) {
    return 0.5 + 0.25 * std::sin(0.7 * p.x + 0.3 * p.y) +
           0.25 * std::cos(0.5 * p.z - 0.4 * p.x * p.y / 8);
}

inline VolumePtr waves_volume(Index3 dims = {12, 11, 10}) {
    return voxloom::testing::make_volume(dims, ScalarType::f64, [](auto x, auto y, auto z) {
        return waves({double(x), double(y), double(z)});
    });
}

// Several bumps with colours of their own: kinks, jumps and smooth stretches.
inline TransferPtr bumps() {
    return transfer({{0.1, glow(0)},
                     {0.2, glow(0.8, {1, 0.2, 0.1})},
                     {0.3, glow(0)},
                     {0.55, glow(0.1, {0, 1, 0})},
                     {0.6, glow(2.0, {0.2, 0.3, 1})},
                     {0.65, glow(0)},
                     {0.8, glow(0.4, {1, 1, 0})}});
}

inline RaycastScene scene_of(VolumePtr volume, TransferPtr transfer, CameraPtr camera) {
    RaycastScene scene;
    scene.volume = std::move(volume);
    scene.transfer = std::move(transfer);
    scene.camera = std::move(camera);
    scene.size = {16, 16};
    return scene;
}

inline double largest_difference(const glm::dvec4& a, const glm::dvec4& b) {
    const glm::dvec4 d = glm::abs(a - b);
    return std::max({d.x, d.y, d.z, d.w});
}

}  // namespace voxloom::reference::testing
