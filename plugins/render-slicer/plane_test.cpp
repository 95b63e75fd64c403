// Cutting planes: against closed forms, whatever the levels, the plane and the blending.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/data/dense_pyramid.h"
#include "core/data/selection.h"
#include "tests/support/linked_plugin.h"
#include "tests/support/run_node.h"
#include "tests/support/volumes.h"

using namespace voxloom;
using namespace voxloom::testing;

namespace {

NodeRun cut(const BricksPtr& bricks, const SelectionPtr& selection, const Camera& camera, double most,
            const std::string& params) {
    // Red says the value, and everything is as dense.
    auto tf = std::make_shared<TransferFunction>();
    tf->one = {{{0, Emission(0, 1, 0, 1)}, {most, Emission(1, 1, 0, 1)}}};
    NodeInputs inputs{{"source", {bricks}}, {"transfer", {TransferPtr(tf)}}, {"camera", {CameraPtr(std::make_shared<Camera>(camera))}}};
    if (selection) inputs["selection"] = {selection};
    return run_node(linked_plugin(), "slicer.plane", "{size: [48, 40], background: [0, 0, 0, 0], " + params + "}", inputs);
}

Camera camera_over(const VolumeDesc& desc, glm::dvec3 from, Camera::Projection projection) {
    Camera c;
    c.projection = projection;
    c.target = point_in_box(desc, glm::dvec3(0.5));
    const double size = glm::distance(point_in_box(desc, glm::dvec3(0)), point_in_box(desc, glm::dvec3(1)));
    c.eye = c.target + glm::normalize(from) * size;
    c.up = {0.1, 0.9, 0.2};
    c.vertical_fov = 0.6;
    c.height = 0.7 * size;
    return c;
}

// Levels in all places: the coarsest brick, but for one octant, and so on downwards.
SelectionPtr nested(const BricksDesc& desc) {
    auto s = std::make_shared<Selection>();
    s->of = std::make_shared<BricksDesc>(desc);
    s->policy = "test";
    BrickId id{int(desc.levels.size()) - 1, {0, 0, 0}};
    for (;; id = desc.finer(id).front()) {
        SelectedBrick b;
        b.id = id;
        if (id.level > 0) b.octants = 0xfe;
        s->bricks.push_back(b);
        if (id.level == 0) return s;
    }
}

double ramp(glm::dvec3 p) { return 3 * p.x + 2 * p.y + p.z; }
BricksPtr ramp_bricks(int brick = 8) {
    // 2^n + 1 voxels, so that the last one is a sample of every level.
    return make_dense_pyramid(make_volume({65, 33, 33}, ScalarType::f32, [](auto x, auto y, auto z) { return ramp(glm::dvec3(x, y, z)); }),
                              glm::ivec3(brick), PyramidFilter::average);
}
constexpr double kMost = 3 * 64 + 2 * 32 + 32;

struct Plane {
    glm::dvec3 normal, origin{0.5};
    std::string text() const {
        return fmt::format("normal: [{}, {}, {}], origin: [{}, {}, {}]", normal.x, normal.y, normal.z, origin.x, origin.y,
                           origin.z);
    }
};
// On faces of bricks, in faces of the volume, on diagonals, and anywhere.
const Plane kPlanes[] = {{{0, 0, 1}, {0.3, 0.4, 0.6}}, {{1, 0.001, 0}, {0.25, 0.5, 0.5}}, {{1, 0, 0}, {0.25, 0.5, 0.5}},
                         {{0, -1, 0}, {0, 1, 0}}, {{1, 1, 0}}, {{1, -1, 1}}, {{-0.3, 0.7, 0.2}, {0.4, 0.6, 0.3}}};

}  // namespace

TEST(SlicerPlane, ShowsTheValueWhereTheRayMeetsThePlaneFromEveryLevel) {
    const BricksPtr bricks = ramp_bricks();
    const VolumeDesc& desc = bricks->desc().volume;
    for (auto projection : {Camera::Projection::perspective, Camera::Projection::orthographic})
        for (const Plane& plane : kPlanes)
            for (const SelectionPtr& s : {SelectionPtr(), nested(bricks->desc())}) {
                const Camera camera = camera_over(desc, {1, 0.8, 0.7}, projection);
                const ImagePtr image = cut(bricks, s, camera, kMost, plane.text()).image();
                const glm::dvec4 world = plane_through(point_in_box(desc, plane.origin), plane.normal);
                int drawn = 0;
                for (int y = 0; y < 40; ++y)
                    for (int x = 0; x < 48; ++x) {
                        const Ray ray = camera.ray(x + 0.5, y + 0.5, 48, 40);
                        const double t = -(glm::dot(glm::dvec3(world), ray.origin) + world.w) / glm::dot(glm::dvec3(world), ray.direction);
                        const glm::dvec3 p = ray.origin + t * ray.direction;
                        // The border of the volume may fall on either side.
                        const glm::dvec3 slack(0.01), end = desc.extent();
                        const bool in = t > 0 && glm::all(glm::greaterThan(p, slack)) && glm::all(glm::lessThan(p, end - slack));
                        const bool out = t < 0 || glm::any(glm::lessThan(p, -slack)) || glm::any(glm::greaterThan(p, end + slack));
                        const glm::vec4 c = image->at(x, y);
                        drawn += c.a > 0;
                        if (in) {
                            EXPECT_NEAR(c.r, ramp(p) / kMost, 2e-4) << plane.text();
                            EXPECT_NEAR(c.a, 1, 1e-6);
                        } else if (out) {
                            EXPECT_EQ(c.a, 0) << plane.text();
                        }
                    }
                EXPECT_GT(drawn, 100) << plane.text();
            }
}

TEST(SlicerPlane, TwoPassesAreOneWhereColoursAreLinear) {
    const BricksPtr bricks = ramp_bricks();
    auto s = std::make_shared<Selection>(*nested(bricks->desc()));
    for (SelectedBrick& b : s->bricks)
        if (b.id.level + 1 < int(bricks->desc().levels.size())) b.corner_blend = {0, 1, 0.5f, 1, 0, 1, 1, 0.25f};
    const Camera camera = camera_over(bricks->desc().volume, {1, 0.8, 0.7}, Camera::Projection::perspective);
    for (const Plane& plane : kPlanes) {
        const ImagePtr one = cut(bricks, s, camera, kMost, plane.text() + ", blend: one-pass").image();
        const ImagePtr two = cut(bricks, s, camera, kMost, plane.text() + ", blend: two-pass").image();
        for (std::size_t i = 0; i < one->rgba32f().size(); ++i)
            EXPECT_LT(glm::distance(one->rgba32f()[i], two->rgba32f()[i]), 1e-4);
    }
}

TEST(SlicerPlane, DecodesOnlyWhatThePlaneMeets) {
    const BricksPtr bricks = ramp_bricks();
    const Camera camera = camera_over(bricks->desc().volume, {1, 0.8, 0.7}, Camera::Projection::perspective);
    NodeRun run = cut(bricks, nullptr, camera, kMost, "normal: [0, 0, 1], origin: [0.5, 0.5, 0.4]");
    EXPECT_GE(run.counters["bricks drawn"], 9 * 5);
    EXPECT_LE(run.counters["bricks drawn"], 9 * 5 * 2);
}

TEST(SlicerPlane, NearestShowsVoxelsAndBordersShowBricks) {
    const BricksPtr bricks = ramp_bricks();
    const Camera camera = camera_over(bricks->desc().volume, {0.1, 0.2, 1}, Camera::Projection::orthographic);
    const ImagePtr nearest = cut(bricks, nullptr, camera, kMost, "filter: nearest").image();
    for (glm::vec4 c : nearest->rgba32f()) {
        if (c.a == 0) continue;
        const double value = double(c.r) * kMost;
        EXPECT_NEAR(value, std::round(value), 1e-2);
    }
    const ImagePtr plain = cut(bricks, nullptr, camera, kMost, "borders: 0").image();
    const ImagePtr lines = cut(bricks, nullptr, camera, kMost, "borders: 1.5").image();
    int black = 0, same = 0;
    for (std::size_t i = 0; i < plain->rgba32f().size(); ++i) {
        if (plain->rgba32f()[i].a == 0) continue;
        black += lines->rgba32f()[i].g < 0.2f;
        same += lines->rgba32f()[i] == plain->rgba32f()[i];
    }
    EXPECT_GT(black, 20);
    EXPECT_GT(same, 100);
}

TEST(SlicerPlane, TakesThePlaneOfItsSelection) {
    const BricksPtr bricks = ramp_bricks();
    const Camera camera = camera_over(bricks->desc().volume, {1, 0.8, 0.7}, Camera::Projection::perspective);
    auto s = std::make_shared<Selection>(*nested(bricks->desc()));
    s->plane = plane_through({32, 16, 10}, {0, 0, 2});
    const ImagePtr a = cut(bricks, s, camera, kMost, "normal: [1, 0, 0]").image();
    s = std::make_shared<Selection>(*s);
    s->plane.reset();
    const ImagePtr b = cut(bricks, s, camera, kMost, "normal: [0, 0, 1], origin: [0.5, 0.5, 0.3125]").image();
    for (std::size_t i = 0; i < a->rgba32f().size(); ++i) EXPECT_LT(glm::distance(a->rgba32f()[i], b->rgba32f()[i]), 1e-4);
}
