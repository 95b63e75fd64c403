// The node reference.raycast: ports, parameters, messages.
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/data/dense_pyramid.h"
#include "plugins/render-reference/tests/scenes.h"
#include "tests/support/linked_plugin.h"
#include "tests/support/run_node.h"

namespace voxloom::reference {
namespace {

using namespace testing;
using voxloom::testing::linked_plugin;
using voxloom::testing::NodeInputs;
using voxloom::testing::run_node;

NodeInputs inputs(Value source) {
    return {{"source", {std::move(source)}},
            {"transfer", {bumps()}},
            {"camera", {look({30, 17, 22}, {5, 5, 5})}}};
}

std::vector<std::byte> bytes(const ImagePtr& image) {
    return {image->bytes().begin(), image->bytes().end()};
}

TEST(ReferenceNode, DrawsAPictureOfTheSizeAskedFor) {
    const auto run =
        run_node(linked_plugin(), "reference.raycast", "{size: [20, 10]}", inputs(waves_volume()));
    EXPECT_EQ(run.image()->size(), glm::ivec2(20, 10));
    float brightest = 0;
    for (const glm::vec4& pixel : run.image()->rgba32f()) {
        EXPECT_EQ(pixel.a, 1.0f);  // the opaque background is under it
        brightest = std::max(brightest, pixel.b);
    }
    EXPECT_GT(brightest, 0.1f);
    EXPECT_FALSE(run.progress.empty());
    EXPECT_EQ(run.progress.back(), 1.0);
}

TEST(ReferenceNode, BricksShowWhatTheirVolumeShows) {
    const VolumePtr volume = waves_volume();
    const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(4), PyramidFilter::average);
    for (const char* params : {"{size: [16, 16]}", "{size: [16, 16], shading: true, mode: steps}"})
        EXPECT_EQ(bytes(run_node(linked_plugin(), "reference.raycast", params, inputs(volume)).image()),
                  bytes(run_node(linked_plugin(), "reference.raycast", params, inputs(bricks)).image()));
}

TEST(ReferenceNode, LightsReplaceTheHeadlight) {
    auto dark = std::make_shared<Lights>();
    dark->lights.clear();
    dark->ambient = 1;
    NodeInputs lit = inputs(waves_volume());
    lit["lights"] = {LightsPtr(dark)};
    // Without lights and with full ambient light a shaded picture is the unshaded one.
    const auto shaded =
        run_node(linked_plugin(), "reference.raycast", "{size: [16, 16], shading: true}", lit).image();
    const auto plain = run_node(linked_plugin(), "reference.raycast", "{size: [16, 16]}", lit).image();
    for (int y = 0; y < 16; ++y)
        for (int x = 0; x < 16; ++x)
            EXPECT_LT(glm::length(shaded->at(x, y) - plain->at(x, y)), 1e-6f);
}

TEST(ReferenceNode, WrongCombinationsAreNamedBeforeAnythingIsDrawn) {
    auto message = [](const std::string& params) -> std::string {
        try {
            run_node(linked_plugin(), "reference.raycast", params, inputs(waves_volume()));
        } catch (const Error& e) {
            return e.what();
        }
        return "";
    };
    EXPECT_NE(message("{mode: cells, reconstruction: tricubic}").find("steps or auto"),
              std::string::npos);
    EXPECT_NE(message("{component: 1}").find("component 1 is not there"), std::string::npos);
    EXPECT_NE(message("{gradient_modulation: [2, 1]}").find("must not exceed"), std::string::npos);
    EXPECT_NE(message("{field: closed-form}").find("no closed form"), std::string::npos);
}

}  // namespace
}  // namespace voxloom::reference
