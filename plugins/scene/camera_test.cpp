// Cameras: what is fitted is in the picture, and nothing is ever not finite.
#include <gtest/gtest.h>

#include <cmath>

#include "core/data/dense_pyramid.h"
#include "plugins/scene/framing.h"
#include "plugins/scene/nodes.h"
#include "tests/support/run_node.h"
#include "tests/support/volumes.h"

namespace voxloom::scene {
namespace {

using testing::describe_node;
using testing::make_volume;
using testing::params_from_yaml;
using testing::run_node;

VolumePtr box_volume(Index3 dims, glm::dvec3 spacing = glm::dvec3(1.0)) {
    return make_volume(dims, ScalarType::u8, [](auto...) { return 0; }, spacing);
}

Camera camera(const std::string& yaml, VolumePtr fit = nullptr) {
    NodeType node = camera_node();
    testing::NodeInputs inputs;
    if (fit) inputs["fit"] = {fit};
    return *run_node(node, params_from_yaml(node, yaml), inputs).output<Camera>("camera");
}

// Place in the picture, -1 to 1 across and up.
glm::dvec2 projected(const Camera& c, glm::dvec3 world, double aspect = 1) {
    glm::dvec4 eye = c.view() * glm::dvec4(world, 1.0);
    double half = c.unit_height() / 2;
    if (c.projection == Camera::Projection::perspective) half *= -eye.z;
    return {eye.x / (half * aspect), eye.y / half};
}

double extreme(const Camera& c, const VolumeDesc& volume, double aspect = 1) {
    double most = 0;
    for (glm::dvec3 corner : subject_of(volume).corners) {
        glm::dvec2 p = glm::abs(projected(c, corner, aspect));
        most = std::max({most, p.x, p.y});
    }
    return most;
}

bool finite(const Camera& c) {
    for (glm::dvec3 v : {c.eye, c.target, c.right(), c.true_up(), c.forward()})
        for (int a = 0; a < 3; ++a)
            if (!std::isfinite(v[a])) return false;
    return std::isfinite(c.height) && c.height > 0 && c.vertical_fov > 0 && c.eye != c.target;
}

TEST(Camera, KeepsTheWholeVolumeInThePictureFromEverySide) {
    VolumePtr v = box_volume({40, 20, 7}, {1, 2, 5});
    for (const char* projection : {"perspective", "orthographic"})
        for (int azimuth = -180; azimuth < 180; azimuth += 25)
            for (int elevation = -90; elevation <= 90; elevation += 30) {
                Camera c = camera(fmt::format("{{azimuth: {}, elevation: {}, projection: {}}}",
                                              azimuth, elevation, projection), v);
                EXPECT_LE(extreme(c, v->desc()), 1 + 1e-12);
            }
}

TEST(Camera, FramesTheBoxTightly) {
    VolumePtr v = box_volume({40, 20, 7}, {1, 2, 5});
    for (const char* projection : {"perspective", "orthographic"})
        for (double aspect : {1.0, 1.7, 0.4})
            for (int azimuth : {0, 30, 135}) {
                Camera c = camera(fmt::format("{{azimuth: {}, roll: 20, projection: {}, framing: box, "
                                              "aspect: {}}}", azimuth, projection, aspect), v);
                EXPECT_NEAR(extreme(c, v->desc(), aspect), 1, 1e-9);
            }
}

TEST(Camera, StandsAtTheSameDistanceOnTheWholeOrbit) {
    VolumePtr v = box_volume({9, 30, 4});
    glm::dvec3 center = subject_of(v->desc()).center;
    double first = glm::distance(camera("{azimuth: 0, elevation: 0}", v).eye, center);
    EXPECT_NEAR(glm::distance(camera("{azimuth: 77, elevation: 33}", v).eye, center), first,
                1e-12 * first);
    EXPECT_NEAR(glm::distance(camera("{distance: 0.25}", v).eye, center), first / 4, 1e-12 * first);
    // The sphere of radius r just fits at r / sin(fov/2).
    EXPECT_NEAR(first, subject_of(v->desc()).radius / std::sin(glm::radians(15.0)), 1e-12 * first);
}

TEST(Camera, LooksIntoThePatientsFaceWithTheHeadUp) {
    Camera c = camera("{azimuth: 0, elevation: 0}", box_volume({9, 9, 9}));
    EXPECT_LT(glm::distance(c.forward(), glm::dvec3(0, 1, 0)), 1e-12);
    EXPECT_LT(glm::distance(c.true_up(), glm::dvec3(0, 0, 1)), 1e-12);
    // The patient's left (+x in LPS) is on the right of the picture, as when standing face to face.
    EXPECT_LT(glm::distance(c.right(), glm::dvec3(1, 0, 0)), 1e-12);
    // Azimuth goes counterclockwise as seen from above.
    EXPECT_LT(glm::distance(camera("{azimuth: 90, elevation: 0}").forward(), glm::dvec3(-1, 0, 0)),
              1e-12);
    EXPECT_LT(glm::distance(camera("{elevation: 90}").forward(), glm::dvec3(0, 0, -1)), 1e-12);
}

TEST(Camera, PutsTheChosenAxisUp) {
    const std::pair<const char*, glm::dvec3> axes[] = {
        {"x", {1, 0, 0}}, {"y", {0, 1, 0}}, {"z", {0, 0, 1}},
        {"-x", {-1, 0, 0}}, {"-y", {0, -1, 0}}, {"-z", {0, 0, -1}}};
    for (auto [name, axis] : axes) {
        Camera c = camera(fmt::format("{{up_axis: '{}', elevation: 0, azimuth: 40}}", name));
        EXPECT_LT(glm::distance(c.true_up(), axis), 1e-12) << name;
        c = camera(fmt::format("{{up_axis: '{}', elevation: 90, azimuth: 40}}", name));
        EXPECT_LT(glm::distance(c.forward(), -axis), 1e-12) << name;
        EXPECT_TRUE(finite(c)) << name;
    }
}

TEST(Camera, RollsClockwise) {
    Camera level = camera("{}"), rolled = camera("{roll: 90}");
    EXPECT_LT(glm::distance(rolled.true_up(), level.right()), 1e-12);
    EXPECT_LT(glm::distance(rolled.forward(), level.forward()), 1e-12);
}

TEST(Camera, ZoomsAboutTheCentreWithoutMoving) {
    VolumePtr v = box_volume({9, 9, 9});
    for (const char* projection : {"perspective", "orthographic"}) {
        Camera one = camera(fmt::format("{{projection: {}}}", projection), v);
        Camera two = camera(fmt::format("{{projection: {}, zoom: 2}}", projection), v);
        EXPECT_EQ(one.eye, two.eye);
        glm::dvec3 corner(8, 8, 8);
        EXPECT_LT(glm::distance(2.0 * projected(one, corner), projected(two, corner)), 1e-12);
    }
}

TEST(Camera, IsFiniteForEverySizeAndScale) {
    for (Index3 dims : {Index3(0), Index3(1), Index3(0, 5, 5), Index3(1, 1, 9), Index3(1, 9, 9),
                        Index3(64, 1, 3)})
        for (double scale : {1e-9, 1.0, 1e9, 0.0})
            for (const char* set : {"{}", "{projection: orthographic}", "{framing: box}",
                                    "{framing: box, projection: orthographic, elevation: 90}",
                                    "{distance: 0}", "{elevation: 90}", "{elevation: -90}"})
                EXPECT_TRUE(finite(camera(set, box_volume(dims, glm::dvec3(scale)))))
                    << dims.x << " " << dims.y << " " << dims.z << " scale " << scale << " " << set;
}

TEST(Camera, FitsAnythingThatKnowsItsPlace) {
    VolumePtr v = box_volume({9, 30, 4});
    NodeType node = camera_node();
    auto eye = [&](Value fit) {
        return run_node(node, params_from_yaml(node, "{}"), {{"fit", {fit}}}).output<Camera>("camera")->eye;
    };
    class OneStep final : public Series {
      public:
        using Series::Series;
        Value fetch(std::size_t, const std::stop_token&) const override { fail("fetched"); }
    };
    SeriesDesc series;
    series.times = {0};
    series.step = ValueDesc(v->desc());
    LatticeDesc lattice;
    lattice.grids = {{ValueDesc(v->desc()), {}, 0}};
    EXPECT_EQ(eye(make_dense_pyramid(v, glm::ivec3(8), PyramidFilter::average)), eye(v));
    EXPECT_EQ(eye(SeriesPtr(std::make_shared<OneStep>(series))), eye(v));
    EXPECT_EQ(eye(LatticePtr(std::make_shared<Lattice>(lattice, std::vector<Value>{v}))), eye(v));
    EXPECT_THROW(eye(LatticePtr(std::make_shared<Lattice>(LatticeDesc{}, std::vector<Value>{}))), Error);
}

TEST(Camera, KeepsItsDirectionInsideTheVolume) {
    VolumePtr v = box_volume({9, 9, 9});
    glm::dvec3 far = camera("{}", v).forward();
    EXPECT_LT(glm::distance(camera("{distance: 0}", v).forward(), far), 1e-12);
    EXPECT_LT(glm::distance(camera("{distance: 0.01}", v).forward(), far), 1e-12);
    EXPECT_LT(glm::distance(camera("{distance: 0}", v).eye, glm::dvec3(4.0)), 1e-12);
}

TEST(Camera, LooksWhereItIsTold) {
    Camera c = camera("{mode: look-at, eye: [1, 2, 3], target: [1, 2, -5], up: [1, 0, 0], "
                      "projection: orthographic, height: 8, zoom: 2, near: 0.5}");
    EXPECT_EQ(c.eye, glm::dvec3(1, 2, 3));
    EXPECT_EQ(c.forward(), glm::dvec3(0, 0, -1));
    EXPECT_LT(glm::distance(c.true_up(), glm::dvec3(1, 0, 0)), 1e-12);
    EXPECT_EQ(c.height, 4);
    EXPECT_EQ(c.near, 0.5);
    EXPECT_TRUE(finite(camera("{mode: look-at, eye: [0, 0, 9], up: [0, 0, 0]}")));
}

TEST(Camera, RefusesToLookAtItself) {
    NodeType node = camera_node();
    auto described = describe_node(
        node, params_from_yaml(node, "{mode: look-at, eye: [1, 1, 1], target: [1, 1, 1]}"), {});
    ASSERT_EQ(described.problems.size(), 1u);
    EXPECT_EQ(described.problems[0], "target: eye and target are the same point; move one of them");
}

TEST(Camera, RefusesAVolumeThatIsNowhere) {
    VolumeDesc desc;
    desc.dims = Index3(2);
    desc.index_to_world[3].x = std::nan("");
    EXPECT_THROW(subject_of(desc), Error);
}

}  // namespace
}  // namespace voxloom::scene
