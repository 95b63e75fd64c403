#include "core/data/bricks.h"

#include <gtest/gtest.h>

#include "core/base/error.h"

namespace voxloom {
namespace {

VolumeDesc volume(Index3 dims, glm::dvec3 spacing = glm::dvec3(1)) {
    VolumeDesc desc;
    desc.dims = dims;
    desc.set_spacing_origin(spacing, {5, -3, 7});
    return desc;
}

BricksDesc bricks(Index3 dims, int brick, glm::dvec3 spacing = glm::dvec3(1)) {
    BricksDesc desc;
    desc.volume = volume(dims, spacing);
    desc.brick = glm::ivec3(brick);
    desc.levels = pyramid_levels(desc.volume, desc.brick);
    return desc;
}

const Index3 kSizes[] = {{1, 1, 1},    {2, 1, 1},    {15, 16, 17}, {31, 32, 33}, {1, 7, 129},
                         {64, 64, 64}, {65, 64, 63}, {13, 1, 1},   {100, 3, 41}, {257, 2, 9}};

std::vector<BrickId> all_of(const BricksDesc& desc, int level) {
    std::vector<BrickId> all;
    const glm::ivec3 n = desc.levels[std::size_t(level)].bricks;
    for (int z = 0; z < n.z; ++z)
        for (int y = 0; y < n.y; ++y)
            for (int x = 0; x < n.x; ++x) all.push_back({level, {x, y, z}});
    return all;
}

TEST(PyramidLevels, EndWithOneBrickThatHoldsEverything) {
    for (Index3 dims : kSizes)
        for (int brick : {1, 2, 7, 8, 16}) {
            const BricksDesc desc = bricks(dims, brick);
            EXPECT_EQ(desc.levels.back().bricks, glm::ivec3(1));
            EXPECT_EQ(desc.levels.front().dims, dims);
        }
}

TEST(PyramidLevels, EverySampleOfALevelSitsOnAVoxelAndTheLastOneCannotBeFollowedByAnother) {
    for (Index3 dims : kSizes)
        for (const LevelDesc& level : bricks(dims, 8).levels)
            for (int a = 0; a < 3; ++a) {
                EXPECT_LT((level.dims[a] - 1) * level.stride[a], dims[a]);
                EXPECT_GE(level.dims[a] * level.stride[a], dims[a]);
            }
}

TEST(PyramidLevels, WideSlicesAreHalvedInPlaneUntilTheirSpacingIsThatOfTheStack) {
    // 0.5 x 0.5 x 5 mm: x and y are halved three times (0.5, 1, 2, 4), then z takes part.
    const BricksDesc desc = bricks({512, 512, 512}, 16, {0.5, 0.5, 5});
    ASSERT_GE(desc.levels.size(), 5u);
    EXPECT_EQ(desc.levels[1].stride, glm::ivec3(2, 2, 1));
    EXPECT_EQ(desc.levels[3].stride, glm::ivec3(8, 8, 1));
    EXPECT_EQ(desc.levels[4].stride, glm::ivec3(16, 16, 2));
}

TEST(PyramidLevels, AnImageOfOneSliceIsAQuadtree) {
    const BricksDesc desc = bricks({512, 512, 1}, 32, {1, 1, 1e-9});
    EXPECT_EQ(desc.levels.size(), 5u);
    EXPECT_EQ(desc.levels.back().stride, glm::ivec3(16, 16, 1));
    EXPECT_EQ(desc.finer({1, {0, 0, 0}}).size(), 4u);
}

TEST(PyramidLevels, AnAxisWithFarSpacingIsHalvedOnceTheOthersFitInABrick) {
    const BricksDesc desc = bricks({64, 64, 1000}, 32, {1, 1, 100});
    EXPECT_EQ(desc.levels.back().bricks, glm::ivec3(1));
    EXPECT_EQ(desc.levels[1].dims, Index3(32, 32, 1000));
    EXPECT_EQ(desc.levels[2].dims, Index3(32, 32, 500));
}

TEST(PyramidLevels, SpacingsThatAreNoNumbersStillEnd) {
    VolumeDesc desc = volume({100, 100, 100}, {NAN, NAN, NAN});
    EXPECT_EQ(pyramid_levels(desc, glm::ivec3(8)).back().bricks, glm::ivec3(1));
    desc = volume({100, 100, 100}, {0, 0, 1});
    EXPECT_EQ(pyramid_levels(desc, glm::ivec3(8)).back().bricks, glm::ivec3(1));
}

TEST(PyramidLevels, EmptyVolumesHaveOneLevelWithoutBricks) {
    for (Index3 dims : {Index3(0, 0, 0), Index3(100, 0, 100)}) {
        const auto levels = pyramid_levels(volume(dims), glm::ivec3(8));
        ASSERT_EQ(levels.size(), 1u);
        EXPECT_EQ(levels[0].bricks.x * levels[0].bricks.y * levels[0].bricks.z, 0);
    }
}

TEST(PyramidLevels, FlatMeansOneLevel) {
    EXPECT_EQ(pyramid_levels(volume({100, 100, 100}), glm::ivec3(8), true).size(), 1u);
}

TEST(PyramidLevels, ImpossibleBricksAreRefused) {
    EXPECT_THROW(pyramid_levels(volume({8, 8, 8}), {8, 0, 8}), Error);
    EXPECT_THROW(pyramid_levels(volume({std::int64_t(1) << 40, 1, 1}), glm::ivec3(1)), Error);
}

TEST(BricksDesc, BoxesTileTheirLevelAndFineBoxesTileLevelZero) {
    for (Index3 dims : kSizes) {
        const BricksDesc desc = bricks(dims, 7);
        for (int l = 0; l < int(desc.levels.size()); ++l) {
            std::uint64_t own = 0, fine = 0;
            for (BrickId id : all_of(desc, l)) {
                EXPECT_TRUE(Box::of(desc.levels[std::size_t(l)].dims).contains(desc.box_of(id)));
                EXPECT_TRUE(Box::of(dims).contains(desc.fine_box_of(id)));
                EXPECT_FALSE(desc.box_of(id).empty());
                own += desc.box_of(id).voxels();
                fine += desc.fine_box_of(id).voxels();
            }
            EXPECT_EQ(own, Box::of(desc.levels[std::size_t(l)].dims).voxels());
            EXPECT_EQ(fine, Box::of(dims).voxels());
        }
    }
}

TEST(BricksDesc, FinerAndCoarserAreInversesAndFineBoxesNest) {
    for (Index3 dims : kSizes)
        for (glm::dvec3 spacing : {glm::dvec3(1), glm::dvec3(1, 1, 3)}) {
            const BricksDesc desc = bricks(dims, 4, spacing);
            for (int l = 0; l < int(desc.levels.size()); ++l)
                for (BrickId id : all_of(desc, l)) {
                    std::uint64_t voxels = 0;
                    int last_octant = -1;
                    for (BrickId finer : desc.finer(id)) {
                        EXPECT_EQ(desc.coarser(finer), id);
                        EXPECT_TRUE(desc.fine_box_of(id).contains(desc.fine_box_of(finer)));
                        EXPECT_GT(desc.octant_of(finer), last_octant);
                        last_octant = desc.octant_of(finer);
                        voxels += desc.fine_box_of(finer).voxels();
                    }
                    EXPECT_EQ(voxels, l > 0 ? desc.fine_box_of(id).voxels() : 0);
                }
            EXPECT_FALSE(desc.coarser({int(desc.levels.size()) - 1, {0, 0, 0}}));
        }
}

TEST(BricksDesc, WorldPositionsOfSamplesAreThoseOfTheirVoxels) {
    BricksDesc desc = bricks({100, 90, 20}, 8, {0.5, 0.5, 2});
    desc.volume.index_to_world = glm::dmat4{{0, 2, 0, 0}, {-2, 0, 0.5, 0}, {0, 0, -3, 0}, {4, 5, 6, 1}};
    for (int l = 0; l < int(desc.levels.size()); ++l) {
        const LevelDesc& level = desc.levels[std::size_t(l)];
        const glm::dvec3 last(level.dims - Index3(1));
        const glm::dvec4 world = desc.level_to_world(l) * glm::dvec4(last, 1);
        const glm::dvec4 fine = desc.volume.index_to_world * glm::dvec4(last * glm::dvec3(level.stride), 1);
        EXPECT_EQ(world, fine);
    }
}

TEST(BricksDesc, HasRefusesWhatIsOutside) {
    const BricksDesc desc = bricks({64, 64, 64}, 32);
    EXPECT_TRUE(desc.has({0, {1, 1, 1}}));
    EXPECT_FALSE(desc.has({0, {2, 0, 0}}));
    EXPECT_FALSE(desc.has({0, {-1, 0, 0}}));
    EXPECT_FALSE(desc.has({2, {0, 0, 0}}));
    EXPECT_FALSE(desc.has({-1, {0, 0, 0}}));
}

}  // namespace
}  // namespace voxloom
