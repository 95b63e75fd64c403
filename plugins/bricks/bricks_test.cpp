#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/data/dense_pyramid.h"
#include "plugins/bricks/nodes.h"
#include "tests/support/run_node.h"
#include "tests/support/volumes.h"

namespace voxloom::bricks {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using voxloom::testing::describe_node;
using voxloom::testing::make_volume;
using voxloom::testing::NodeRun;
using voxloom::testing::params_from_yaml;
using voxloom::testing::run_node;
using voxloom::testing::voxel;

NodeRun pyramid(const VolumePtr& volume, const std::string& params = "{}") {
    const NodeType node = pyramid_node();
    return run_node(node, params_from_yaml(node, params), {{"volume", {volume}}});
}
NodeRun decode(const BricksPtr& bricks, const std::string& params = "{}") {
    const NodeType node = decode_node();
    return run_node(node, params_from_yaml(node, params), {{"bricks", {bricks}}});
}
std::vector<std::string> problems_of_decoding(const BricksPtr& bricks, const std::string& params) {
    const NodeType node = decode_node();
    return describe_node(node, params_from_yaml(node, params), {{"bricks", {describe(bricks)}}}).problems;
}

VolumePtr ramp(Index3 dims = {40, 30, 20}) {
    return make_volume(dims, ScalarType::u16, [](auto x, auto y, auto z) { return double(x + 40 * y + 1200 * z); },
                       {1, 2, 3});
}

TEST(PyramidNode, BuildsWhatItsDescriptionPromisesAndMeasuresEveryLevel) {
    for (const char* filter : {"average", "lifting53", "subsample"}) {
        const NodeRun run = pyramid(ramp(), std::string("{brick: [8, 8, 8], filter: ") + filter + "}");
        const auto bricks = run.output<Bricks>("bricks");
        EXPECT_EQ(run.measured("levels"), double(bricks->desc().levels.size()));
        EXPECT_EQ(run.progress.back(), 1);
        // Only what lies beyond the last even sample is not the ramp.
        EXPECT_LT(run.measured("rmse of level 1"), 1200);
    }
}

TEST(PyramidNode, AFinerFilterIsTheBetterOneOnASmoothVolume) {
    const VolumePtr smooth = make_volume({65, 65, 65}, ScalarType::f32, [](auto x, auto y, auto z) {
        return std::sin(0.3 * double(x)) + std::sin(0.25 * double(y)) + std::cos(0.2 * double(z));
    });
    const double average = pyramid(smooth, "{filter: average}").measured("rmse of level 1");
    const double lifting = pyramid(smooth, "{filter: lifting53}").measured("rmse of level 1");
    EXPECT_LT(lifting, average);
}

TEST(PyramidNode, TakesEmptyAndSingleVoxelVolumes) {
    for (Index3 dims : {Index3(0), Index3(1)}) {
        const auto bricks = pyramid(ramp(dims)).output<Bricks>("bricks");
        EXPECT_EQ(decode(bricks).volume()->desc().dims, dims);
    }
}

TEST(PyramidNode, RefusesBricksThatCannotBeBeforeAnyWork) {
    const NodeType node = pyramid_node();
    VolumeDesc huge;
    huge.dims = {std::int64_t(1) << 40, 1, 1};
    const auto described = describe_node(node, params_from_yaml(node, "{brick: [1, 1, 1]}"), {{"volume", {huge}}});
    ASSERT_EQ(described.problems.size(), 1u);
    EXPECT_THAT(described.problems[0], HasSubstr("take larger bricks"));
}

TEST(DecodeNode, LevelZeroIsTheVolumeDenseOrStreamed) {
    const VolumePtr volume = ramp();
    const auto bricks = pyramid(volume, "{brick: [8, 8, 8]}").output<Bricks>("bricks");
    for (const char* access : {"{access: dense}", "{access: stream}"}) {
        const VolumePtr decoded = decode(bricks, access).volume();
        EXPECT_EQ(decoded->desc().index_to_world, volume->desc().index_to_world);
        Buffer a(volume->desc().dense_bytes()), b(volume->desc().dense_bytes());
        volume->read(Box::of(volume->desc().dims), a.bytes(), {});
        decoded->read(Box::of(volume->desc().dims), b.bytes(), {});
        EXPECT_TRUE(std::ranges::equal(a.bytes(), b.bytes()));
    }
}

TEST(DecodeNode, ARegionOfALevelKeepsItsPlaceInTheWorld) {
    const auto bricks = pyramid(ramp(), "{brick: [8, 8, 8], filter: lifting53}").output<Bricks>("bricks");
    for (const char* access : {"dense", "stream"}) {
        const VolumePtr region =
            decode(bricks, std::string("{level: 1, region: [3, 2, 1, 11, 9, 20], access: ") + access + "}").volume();
        EXPECT_EQ(region->desc().dims, Index3(8, 7, 19));
        // 40 x 30 x 20 of 1 x 2 x 3 mm with bricks of 8: level 1 halves x alone.
        ASSERT_EQ(bricks->desc().levels[1].stride, glm::ivec3(2, 1, 1));
        for (Index3 i : {Index3(0), Index3(7, 6, 18), Index3(2, 3, 4)}) {
            const glm::dvec4 world = region->desc().index_to_world * glm::dvec4(glm::dvec3(i), 1);
            EXPECT_EQ(voxel(*region, i), world.x / 1 + 40 * world.y / 2 + 1200 * world.z / 3);
        }
    }
}

TEST(DecodeNode, SaysWhichLevelsAndRegionsThereAre) {
    const auto bricks = pyramid(ramp(), "{brick: [8, 8, 8]}").output<Bricks>("bricks");
    const std::string last = std::to_string(bricks->desc().levels.size() - 1);
    EXPECT_THAT(problems_of_decoding(bricks, "{level: 9}"), ElementsAre(HasSubstr("have levels 0 to " + last)));
    for (const char* region : {"[0, 0, 0, 41, 30, 20]", "[5, 5, 5, 5, 9, 9]", "[9, 9, 9, 3, 12, 12]"})
        EXPECT_THAT(problems_of_decoding(bricks, std::string("{region: ") + region + "}"),
                    ElementsAre(HasSubstr("up to at most [40, 30, 20]")));
    const auto flat = pyramid(ramp()).output<Bricks>("bricks");
    EXPECT_TRUE(problems_of_decoding(flat, "{region: [39, 29, 19, 40, 30, 20]}").empty());
    EXPECT_THAT(problems_of_decoding(pyramid(ramp({5, 5, 5})).output<Bricks>("bricks"), "{level: 1}"),
                ElementsAre(HasSubstr("only level 0")));
}

TEST(DecodeNode, CancelsPromptly) {
    const auto bricks = pyramid(make_volume({64, 64, 64}, ScalarType::u8, [](auto x, auto, auto) { return double(x); }),
                                "{filter: lifting53, brick: [8, 8, 8]}").output<Bricks>("bricks");
    std::stop_source stop;
    stop.request_stop();
    const NodeType node = decode_node();
    voxloom::testing::RunNodeOptions options;
    options.stop = stop.get_token();
    EXPECT_THROW(run_node(node, params_from_yaml(node, "{}"), {{"bricks", {bricks}}}, options), Cancelled);
}

}  // namespace
}  // namespace voxloom::bricks
