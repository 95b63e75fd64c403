#include <gtest/gtest.h>

#include <array>

#include "plugins/scene/nodes.h"
#include "plugins/scene/path.h"
#include "tests/support/run_node.h"
#include "tests/support/volumes.h"

namespace voxloom::scene {
namespace {

using voxloom::testing::describe_node;
using voxloom::testing::make_volume;
using voxloom::testing::params_from_yaml;
using voxloom::testing::run_node;

CameraPtr camera_of(const std::string& params, const VolumePtr& fit = nullptr) {
    const NodeType node = path_node();
    voxloom::testing::NodeInputs inputs;
    if (fit) inputs["fit"] = {fit};
    return run_node(node, params_from_yaml(node, params), inputs).output<Camera>("camera");
}

TEST(Path, GoesThroughItsKeyframesWithContinuousVelocity) {
    const std::array<Keyframe, 4> keys = {{{0, {0, 0, 0}, {1, 0, 0}}, {0.1, {1, 2, 0}, {1, 0, 0}}, {0.7, {3, -1, 2}, {0, 5, 0}}, {1, {0, 0, 1}, {0, 0, 0}}}};
    for (const Keyframe& k : keys) {
        EXPECT_LT(glm::distance(at_time(keys, k.time).eye, k.eye), 1e-12);
        EXPECT_LT(glm::distance(at_time(keys, k.time).target, k.target), 1e-12);
    }
    for (double t : {0.1, 0.7}) {
        constexpr double h = 1e-6;
        const glm::dvec3 before = (at_time(keys, t).eye - at_time(keys, t - h).eye) / h;
        const glm::dvec3 after = (at_time(keys, t + h).eye - at_time(keys, t).eye) / h;
        EXPECT_LT(glm::distance(before, after), 1e-3);
    }
    EXPECT_EQ(at_time(keys, -1).eye, keys.front().eye);
    EXPECT_EQ(at_time(keys, 2).eye, keys.back().eye);
    EXPECT_EQ(at_time(std::span(keys).first(1), 0.5).eye, keys.front().eye);
}

TEST(Path, AtAnEvenPaceAStraightLineIsFollowedEvenly) {
    const std::array<Keyframe, 3> keys = {{{0, {0, 0, 0}, {1, 0, 0}}, {0.2, {2, 0, 0}, {1, 0, 0}}, {1, {10, 0, 0}, {1, 0, 0}}}};
    for (double t : {0.05, 0.3, 0.9}) EXPECT_NEAR(at_time(keys, t).eye.x, 10 * t, 1e-12);
}

TEST(Path, ATurntableGoesAroundAtOneDistanceAndCloses) {
    const VolumePtr volume = make_volume({20, 10, 30}, ScalarType::u8, [](auto, auto, auto) { return 0.0; }, {1, 2, 0.5});
    const CameraPtr first = camera_of("{t: 0}", volume), last = camera_of("{t: 1}", volume);
    EXPECT_LT(glm::distance(first->eye, last->eye), 1e-9);
    const double distance = glm::distance(first->eye, first->target);
    glm::dvec3 sum(0);
    for (int i = 0; i < 8; ++i) {
        const CameraPtr c = camera_of("{t: " + std::to_string(i / 8.0) + "}", volume);
        EXPECT_NEAR(glm::distance(c->eye, c->target), distance, 1e-9 * distance);
        sum += c->eye - c->target;
    }
    EXPECT_LT(std::hypot(sum.x, sum.y), 1e-6 * distance);  // all around the axis
}

TEST(Path, KeyframesAreInRadiiOfTheVolumeAndTurnWithItsUpAxis) {
    const VolumePtr volume = make_volume({21, 21, 21}, ScalarType::u8, [](auto, auto, auto) { return 0.0; });
    const double radius = 10 * std::sqrt(3.0);
    const std::string keys = "mode: keyframes, keyframes: [[0, 0, -3, 1, 0, 0, 0], [1, 0, -2, 0, 0, 0, 0]]";
    EXPECT_LT(glm::distance(camera_of("{" + keys + "}", volume)->eye, glm::dvec3(10, 10 - 3 * radius, 10 + radius)), 1e-9);
    // With y upwards the first view is from +z.
    EXPECT_LT(glm::distance(camera_of("{up_axis: y, " + keys + "}", volume)->eye, glm::dvec3(10, 10 + radius, 10 + 3 * radius)), 1e-9);
}

TEST(Path, TheWalkthroughGoesInsideAndComesBack) {
    const VolumePtr volume = make_volume({41, 41, 41}, ScalarType::u8, [](auto, auto, auto) { return 0.0; });
    bool inside = false;
    for (int i = 0; i <= 100; ++i) {
        const CameraPtr c = camera_of("{mode: walkthrough, t: " + std::to_string(i / 100.0) + "}", volume);
        EXPECT_GT(glm::distance(c->eye, c->target), 1);
        inside = inside || (glm::all(glm::greaterThan(c->eye, glm::dvec3(0))) && glm::all(glm::lessThan(c->eye, glm::dvec3(40))));
    }
    EXPECT_TRUE(inside);
    EXPECT_EQ(camera_of("{mode: walkthrough, t: 0}", volume)->eye, camera_of("{mode: walkthrough, t: 1}", volume)->eye);
}

TEST(Path, RefusesKeyframesOutOfOrder) {
    const NodeType node = path_node();
    auto problems = [&](const std::string& rows) {
        return describe_node(node, params_from_yaml(node, "{mode: keyframes, keyframes: " + rows + "}"), {}).problems.size();
    };
    EXPECT_EQ(problems("[[0, 0, -3, 0, 0, 0, 0], [1, 0, -2, 0, 0, 0, 0]]"), 0u);
    EXPECT_EQ(problems("[[1, 0, -3, 0, 0, 0, 0], [0, 0, -2, 0, 0, 0, 0]]"), 1u);
    EXPECT_EQ(problems("[[0, 1, 1, 1, 1, 1, 1]]"), 1u);
    EXPECT_EQ(problems("[]"), 1u);
}

}  // namespace
}  // namespace voxloom::scene
