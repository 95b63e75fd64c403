// The analysis in the appendix of Guthe et al. 2002, to its digits, and what a simulation says of it.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "plugins/lod/nodes.h"
#include "plugins/lod/synthetic_bricks.h"
#include "tests/support/run_node.h"

namespace voxloom::lod {
namespace {

using voxloom::testing::params_from_yaml;
using voxloom::testing::run_node;

double radians(double degrees) { return degrees * std::numbers::pi / 180; }

// Voxels in blocks of k cubed over those of the view alone: (rho^2 + rho + 1)/3 with rho the growth of
// a voxel over a block's diagonal; h pixels, view of alpha.
double overhead_of_blocks(double k, double h, double alpha) {
    const double rho = 1 + std::sqrt(3.0) * 2 * k * std::tan(alpha / 2) / h;
    return (rho * rho + rho + 1) / 3 - 1;
}

double layers(double near, double far, double h, double alpha) {
    return std::log(far / near) / std::log1p(std::tan(alpha / 2) / (h / 2));
}

double rounded(double x, double to) { return std::round(x / to) * to; }

TEST(Appendix, TheOverheadOfBlocksIsThePrintedTable) {
    const double k[] = {8, 16, 32, 64, 128}, printed[] = {4.6, 9.2, 19.0, 40.2, 88.9};
    for (int i = 0; i < 5; ++i)
        EXPECT_NEAR(rounded(100 * overhead_of_blocks(k[i], 256, radians(45)), 0.1), printed[i], 1e-9);
    // With the 90 degrees of the paper's example it would be more.
    const double wide[] = {11.2, 23.2, 49.6, 111.6, 273.2};
    for (int i = 0; i < 5; ++i)
        EXPECT_NEAR(rounded(100 * overhead_of_blocks(k[i], 256, radians(90)), 0.1), wide[i], 1e-9);
}

TEST(Appendix, TheExampleMixesTwoAngles) {
    const double mixed = layers(128, 2048, 256, radians(45));  // 858, 56 million, 230 million
    EXPECT_EQ(std::round(mixed), 858);
    EXPECT_EQ(std::round(mixed * 65536 / 1e6), 56);
    EXPECT_EQ(std::round(mixed * 65536 * 3.75 * (1 + overhead_of_blocks(16, 256, radians(45))) / 1e6), 230);
    const double wide = layers(128, 2048, 256, radians(90));
    EXPECT_NEAR(wide, 356.3, 0.05);
    EXPECT_NEAR(wide * 65536 * 3.75 * (1 + overhead_of_blocks(16, 256, radians(90))) / 1e6, 107.9, 0.1);
}

// Voxels that lod.projective selects of N cubed from the middle of a face, in millions.
double selected(std::int64_t n, double degrees) {
    const BricksPtr bricks = std::make_shared<SyntheticBricks>(Index3(n), glm::ivec3(16), [](int, glm::dvec3) { return 0.0; });
    auto camera = std::make_shared<Camera>();
    camera->eye = {0.5 * double(n), 0.5 * double(n), 0};
    camera->target = {0.5 * double(n), 0.5 * double(n), double(n)};
    camera->up = {0, 1, 0};
    camera->vertical_fov = radians(degrees);
    const NodeType node = projective_node();
    return run_node(node, params_from_yaml(node, "{size: [256, 256]}"), {{"bricks", {bricks}}, {"camera", {CameraPtr(camera)}}})
               .measured("bricks") * 4096 / 1e6;
}

TEST(Appendix, WhatIsSelectedGrowsWithTheLogarithmOfTheSize) {
    const double want90[] = {11.7, 40.2, 70.1, 100.0, 129.9, 159.8};
    for (int i = 0; i < 4; ++i) EXPECT_NEAR(selected(std::int64_t(256) << i, 90), want90[i], 0.05) << i;
    const double want45[] = {5.1, 36.1, 94.6};
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(selected(std::int64_t(256) << i, 45), want45[i], 0.05) << i;
}

}  // namespace
}  // namespace voxloom::lod
