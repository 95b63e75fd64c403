#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "core/data/brick_cache.h"
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

// A codec that rounds to multiples of 4 and counts what it decodes.
class Rounding final : public Bricks {
  public:
    explicit Rounding(VolumePtr volume) : Bricks(describe_flat(volume->desc())), volume_(std::move(volume)) {}
    BrickInfo info(BrickId) const override {
        BrickInfo info;
        info.range = {0, 65532};
        info.l2 = info.octant_l2[0] = 3;
        info.max_error = 2;
        info.compressed_bytes = 100;
        info.exact_error = true;
        return info;
    }
    std::optional<BrickId> parent(BrickId) const override { return std::nullopt; }
    std::vector<DecodedBrick> refine(BrickId id, const BrickVoxels*, const std::stop_token& stop) const override {
        ++decoded;
        const Box box = desc().box_of(id);
        auto brick = std::make_shared<BrickVoxels>();
        brick->stored = box.dims();
        brick->voxels = Buffer(box.voxels() * 2);
        volume_->read(box, brick->voxels.bytes(), stop);
        for (auto& v : brick->voxels.as<std::uint16_t>()) v = std::uint16_t((v + 2) / 4 * 4);
        return {{id, brick}};
    }
    mutable std::atomic<int> decoded{0};

  private:
    static BricksDesc describe_flat(const VolumeDesc& volume) {
        BricksDesc desc;
        desc.volume = volume;
        desc.volume.range.reset();
        desc.brick = glm::ivec3(8);
        desc.tree_type = volume.type;
        desc.levels = pyramid_levels(volume, desc.brick, true);
        desc.compressed_bytes = 1000;
        return desc;
    }
    VolumePtr volume_;
};

NodeRun pyramid_of(const BricksPtr& bricks, const std::string& params) {
    const NodeType node = pyramid_node();
    return run_node(node, params_from_yaml(node, params), {{"volume", {bricks}}});
}
std::vector<std::byte> level_bytes(const BricksPtr& bricks, int level) {
    BrickCache cache(64 << 20);
    const Index3 dims = bricks->desc().levels[std::size_t(level)].dims;
    std::vector<std::byte> bytes(Box::of(dims).voxels() * bricks->desc().volume.voxel_bytes());
    read_region(bricks, level, Box::of(dims), bytes, cache);
    return bytes;
}

TEST(PyramidNode, OverACodecItsLevelsAreThoseOfWhatTheCodecDecodesTo) {
    const auto codec = std::make_shared<const Rounding>(ramp());
    const VolumePtr rounded = make_volume({40, 30, 20}, ScalarType::u16, [](auto x, auto y, auto z) {
        return double((x + 40 * y + 1200 * z + 2) / 4 * 4);
    }, {1, 2, 3});
    for (const char* filter : {"average", "lifting53", "subsample"}) {  // lifting53 has wider voxels than the codec
        const auto over = pyramid_of(codec, std::string("{filter: ") + filter + "}").output<Bricks>("bricks");
        const auto dense = pyramid(rounded, std::string("{brick: [8, 8, 8], filter: ") + filter + "}").output<Bricks>("bricks");
        ASSERT_EQ(over->desc().levels.size(), dense->desc().levels.size());
        for (int l = 0; l < int(over->desc().levels.size()); ++l) EXPECT_EQ(level_bytes(over, l), level_bytes(dense, l));
        EXPECT_EQ(over->desc().compressed_bytes, dense->desc().compressed_bytes - rounded->desc().dense_bytes() + 1000);
    }
}

TEST(PyramidNode, OverACodecErrorsCountWhatTheCodecLost) {
    const auto codec = std::make_shared<const Rounding>(ramp());
    const auto over = pyramid_of(codec, "{}").output<Bricks>("bricks");
    EXPECT_EQ(over->info({0, {1, 2, 0}}).l2, 3);
    EXPECT_TRUE(over->info({0, {1, 2, 0}}).exact_error);
    const auto dense = make_dense_pyramid(level_as_volume(codec, 0, BrickCache::global()), glm::ivec3(8), PyramidFilter::average);
    // x alone is halved: two bricks of level 0 to one of level 1, an octant each.
    const BrickInfo joined = over->info({1, {0, 1, 1}}), alone = dense->info({1, {0, 1, 1}});
    EXPECT_NEAR(joined.l2, std::sqrt(alone.l2 * alone.l2 + 18), 1e-9);
    EXPECT_NEAR(joined.octant_l2[1], std::sqrt(alone.octant_l2[1] * alone.octant_l2[1] + 9), 1e-9);
    EXPECT_EQ(joined.octant_l2[2], 0);
    EXPECT_EQ(joined.max_error, alone.max_error + 2);
    EXPECT_FALSE(joined.exact_error);
}

TEST(PyramidNode, OverACodecABrickOfLevelZeroIsDecodedOnDemandAndNoneForCoarserOnes) {
    const auto codec = std::make_shared<const Rounding>(ramp());
    const auto over = pyramid_of(codec, "{}").output<Bricks>("bricks");
    const int before = codec->decoded;
    BrickCache cache(1 << 20);
    cache.get(over, {1, {0, 0, 0}});
    EXPECT_EQ(codec->decoded, before);
    cache.get(over, {0, {1, 1, 1}});
    EXPECT_EQ(codec->decoded, before + 1);
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
