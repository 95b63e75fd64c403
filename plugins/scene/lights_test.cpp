// Lights and material.
#include <gtest/gtest.h>

#include "plugins/scene/nodes.h"
#include "tests/support/run_node.h"

namespace voxloom::scene {
namespace {

using testing::params_from_yaml;

Lights lights(const std::string& yaml) {
    NodeType node = lights_node();
    return *testing::run_node(node, params_from_yaml(node, yaml)).output<Lights>("lights");
}

std::vector<std::string> problems(const std::string& yaml) {
    NodeType node = lights_node();
    return testing::describe_node(node, params_from_yaml(node, yaml), {}).problems;
}

TEST(Lights, AreAHeadlightUnlessAskedOtherwise) {
    Lights l = lights("{}");
    ASSERT_EQ(l.lights.size(), 1u);
    EXPECT_EQ(l.lights[0].kind, Light::Kind::headlight);
    EXPECT_EQ(l.ambient, Lights{}.ambient);
    EXPECT_TRUE(lights("{headlight: 0}").lights.empty());
    EXPECT_EQ(lights("{headlight: 0.5}").lights[0].color, glm::dvec3(0.5));
}

TEST(Lights, ShineFromWhereTheyAreTold) {
    Lights l = lights("{headlight: 0, directional: [[0, 0, 5], [0, -2, 0, 1, 0.5, 0]], "
                      "point: [[1, 2, 3]], ambient: 0.1, shininess: 7}");
    ASSERT_EQ(l.lights.size(), 3u);
    EXPECT_EQ(l.lights[0].position, glm::dvec3(0, 0, 1));
    EXPECT_EQ(l.lights[0].color, glm::dvec3(1.0));
    EXPECT_EQ(l.lights[1].position, glm::dvec3(0, -1, 0));
    EXPECT_EQ(l.lights[1].color, glm::dvec3(1, 0.5, 0));
    EXPECT_EQ(l.lights[2].kind, Light::Kind::point);
    EXPECT_EQ(l.lights[2].position, glm::dvec3(1, 2, 3));
    EXPECT_EQ(l.ambient, 0.1);
    EXPECT_EQ(l.shininess, 7);
}

TEST(Lights, HaveADirectionHoweverShort) {
    EXPECT_EQ(lights("{directional: [[1e-200, 0, 0]]}").lights[1].position, glm::dvec3(1, 0, 0));
}

TEST(Lights, SayWhichRowIsWrong) {
    EXPECT_EQ(problems("{directional: [[0, 0, 1], [1, 2]]}").at(0),
              "directional: row 2 has 2 numbers; write [x, y, z] or [x, y, z, r, g, b]");
    EXPECT_EQ(problems("{directional: [[0, 0, 0]]}").at(0),
              "directional: row 1 has no direction; write where the light comes from");
    EXPECT_EQ(problems("{point: [[0, 0, 0, -1, 0, 0]]}").size(), 1u);
    EXPECT_EQ(problems("{point: [[0,0,1],[0,0,2],[0,0,3],[0,0,4],[0,0,5],[0,0,6],[0,0,7],[0,0,8]]}")
                  .size(), 1u);
}

}  // namespace
}  // namespace voxloom::scene
