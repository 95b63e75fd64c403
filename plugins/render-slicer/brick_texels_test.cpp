// Texels with the parent mixed in: closed forms of the mixture, on its faces and in between.
#include "plugins/render-slicer/brick_texels.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/data/dense_pyramid.h"
#include "tests/support/volumes.h"

using namespace voxloom;
using namespace voxloom::slicer;
using namespace voxloom::testing;

namespace {

struct Filled {
    glm::ivec3 side;
    int channels;
    std::vector<double> values;         // of texels, in the volume's values
    std::vector<std::int16_t> gradients;
    FilledBrick brick;
    gpu::TexelLayout layout;
    double at(glm::ivec3 p, int channel = 0) const {
        return values[std::size_t(((p.z + 1) * side.y + p.y + 1) * side.x + p.x + 1) * std::size_t(channels) + std::size_t(channel)];
    }
    glm::vec3 gradient(glm::ivec3 p) const {
        const std::int16_t* g = gradients.data() + std::size_t(((p.z + 1) * side.y + p.y + 1) * side.x + p.x + 1) * 4;
        return {g[0], g[1], g[2]};
    }
};

// With an apron of one voxel before and behind; at() counts from the brick's first own one.
Filled fill(const BricksPtr& bricks, BrickId id, const CornerBlend& blend, ValueRange range, bool validity = false) {
    Texels texels;
    texels.mixed = true;
    texels.layout = gpu::texel_layout(bricks->desc().volume, 0, range, validity, true);
    texels.gradient_side = 0;
    texels.gradient_scale = float(0.5 * range.extent() / texels.layout.scale);
    Filled out;
    out.layout = texels.layout;
    out.side = bricks->desc().brick + 2;
    out.channels = texels.layout.channels;
    const std::size_t count = std::size_t(out.side.x) * std::size_t(out.side.y) * std::size_t(out.side.z);
    Buffer values(count * texels.layout.bytes(), "test");
    out.gradients.resize(count * 4);
    std::array<CornerBlend, 8> blends;
    for (int o = 0; o < 8; ++o) blends[std::size_t(o)] = continued(blend, o);
    out.brick = fill_texels(bricks, id, blends, texels, {1, 1}, bricks->desc().brick / 2, {values.data(), out.gradients.data(), nullptr}, {});
    for (std::size_t i = 0; i < count * std::size_t(out.channels); ++i) {
        const double unit = texels.layout.wide ? double(values.as<float>()[i]) : values.as<std::uint16_t>()[i] / 65535.0;
        out.values.push_back(validity ? unit : texels.layout.offset + texels.layout.scale * unit);
    }
    return out;
}

// What a level shows at a voxel of level 0's, interpolated linearly.
double shown(const BricksPtr& bricks, int level, glm::dvec3 at) {
    const glm::dvec3 p = at / glm::dvec3(bricks->desc().levels[std::size_t(level)].stride), low = glm::floor(p), way = p - low;
    const Box box{Index3(low), Index3(low) + Index3(2)};
    const std::size_t size = bricks->desc().volume.voxel_bytes();
    Buffer voxels(8 * size, "test");
    read_region(bricks, level, box, voxels.bytes(), BrickCache::global());
    VolumeDesc desc = bricks->desc().volume;
    desc.dims = Index3(2);
    const DenseVolume cell(desc, std::move(voxels));
    double sum = 0;
    for (int c = 0; c < 8; ++c) {
        const glm::ivec3 o(c & 1, c >> 1 & 1, c >> 2);
        double weight = 1;
        for (int a = 0; a < 3; ++a) weight *= o[a] ? way[a] : 1 - way[a];
        sum += weight * voxel(cell, Index3(o));
    }
    return sum;
}

double noise(std::int64_t x, std::int64_t y, std::int64_t z) { return double((x * 7919 + y * 104729 + z * 1299709) % 4093); }

constexpr CornerBlend kAll{1, 1, 1, 1, 1, 1, 1, 1};

}  // namespace

TEST(BrickTexels, SharesAreTrilinearBetweenOwnAndParent) {
    const CornerBlend some{0, 1, 0, 1, 0.25f, 1, 0.5f, 1};
    for (ScalarType type : {ScalarType::u8, ScalarType::i16, ScalarType::u16, ScalarType::f32})
        for (glm::dvec3 spacing : {glm::dvec3(1), glm::dvec3(1, 1, 2)}) {  // where the parent has all voxels along an axis
            const double most = type == ScalarType::u8 ? 255 : 4092;
            const VolumePtr volume = make_volume({40, 32, 24}, type, [most](auto x, auto y, auto z) { return noise(x, y, z) * most / 4092; }, spacing);
            const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(8), PyramidFilter::average);
            const BrickId id{0, {2, 1, 1}};
            for (const CornerBlend& blend : {CornerBlend{}, kAll, some}) {
                const Filled filled = fill(bricks, id, blend, {0, most});
                for (int z = 0; z <= 8; ++z)
                    for (int y = 0; y <= 8; ++y)
                        for (int x = 0; x <= 8; ++x) {
                            double share = 0;
                            for (int c = 0; c < 8; ++c)
                                share += double(blend[std::size_t(c)]) * (c & 1 ? x : 8 - x) * (c & 2 ? y : 8 - y) * (c & 4 ? z : 8 - z) / 512.0;
                            const glm::dvec3 at = glm::dvec3(id.index * 8 + glm::ivec3(x, y, z));
                            const double expected = (1 - share) * shown(bricks, 0, at) + share * shown(bricks, 1, at);
                            ASSERT_NEAR(filled.at({x, y, z}), expected, 1e-5 * most) << name_of(type) << " " << x << " " << y << " " << z;
                        }
            }
        }
}

TEST(BrickTexels, IntegersThatAreNotMixedStayWhatTheyAre) {
    for (double most : {1.0, 255.0, 3071.0, 40000.0, 65535.0}) {
        const VolumePtr volume = make_volume({16, 16, 16}, ScalarType::u16, [most](auto x, auto y, auto z) { return std::floor(noise(x, y, z) * most / 4092); });
        const Filled filled = fill(make_dense_pyramid(volume, glm::ivec3(8), PyramidFilter::average), {0, {1, 1, 0}}, {}, {0, most});
        for (int i = 0; i < 8; ++i) EXPECT_NEAR(filled.at({i, 7 - i, i}), voxel(*volume, {8 + i, 15 - i, i}), most * 1e-7);
    }
}

TEST(BrickTexels, AMixedInParentsGradientIsPerStepOfTheBrick) {
    // A ramp has the same gradient on every level.
    const VolumePtr volume = make_volume({32, 32, 32}, ScalarType::u16, [](auto x, auto y, auto z) { return double(40 * x + 20 * y + 10 * z); });
    const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(8), PyramidFilter::subsample);
    const Filled own = fill(bricks, {0, {1, 1, 1}}, {}, {0, 2200}), mixed = fill(bricks, {0, {1, 1, 1}}, kAll, {0, 2200});
    for (int i = 0; i <= 8; ++i) {
        EXPECT_GT(own.gradient({i, 3, 8 - i}).x, 1000);
        EXPECT_LE(glm::distance(own.gradient({i, 3, 8 - i}), mixed.gradient({i, 3, 8 - i})), 2) << i;
    }
}

TEST(BrickTexels, WhatIsNotANumberHasNoWeightInTheMixture) {
    const VolumePtr volume = make_volume({32, 32, 32}, ScalarType::f32, [](auto x, auto y, auto z) { return x == 12 && y % 3 == 0 ? std::nan("") : double(z); });
    const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(8), PyramidFilter::average);
    const Filled filled = fill(bricks, {0, {1, 1, 1}}, kAll, {0, 31}, true);
    for (int z = 0; z <= 8; ++z)
        for (int x = 0; x <= 8; ++x)
            if (filled.at({x, 4, z}, 1) > 0.1) {
                const double value = filled.at({x, 4, z}, 0) / filled.at({x, 4, z}, 1);
                EXPECT_NEAR(filled.layout.offset + filled.layout.scale * value, 8 + z, 1.01) << x;
            }
    EXPECT_TRUE(filled.brick.found_invalid);
    EXPECT_FALSE(fill(bricks, {0, {2, 2, 2}}, kAll, {0, 31}).brick.found_invalid);
}

TEST(BrickTexels, RangesAreOfTheVoxelsAroundABlockAndNoOthers) {
    const VolumePtr volume = make_volume({40, 40, 40}, ScalarType::i16, [](auto x, auto y, auto z) { return noise(x, y, z) - 2000; });
    const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(8), PyramidFilter::subsample);
    for (int level : {0, 1}) {
        const glm::ivec3 brick(1, 2, 1), stride = bricks->desc().levels[std::size_t(level)].stride;
        const Index3 last = bricks->desc().levels[std::size_t(level)].dims - Index3(1);
        const int reach = level == 0 ? 3 : 2;  // of two voxels of level 0, rounded up, and one more
        const Filled filled = fill(bricks, {level, brick}, {}, {-2000, 2093});
        for (int b = 0; b < 8; ++b) {
            const Index3 lo = Index3(brick * 8 + glm::ivec3(b & 1, b >> 1 & 1, b >> 2) * 4) - Index3(reach);
            const Index3 hi = lo + Index3(4 + 2 * reach);
            double least = 1e9, most = -1e9;
            for (std::int64_t z = lo.z; z <= hi.z; ++z)
                for (std::int64_t y = lo.y; y <= hi.y; ++y)
                    for (std::int64_t x = lo.x; x <= hi.x; ++x) {
                        const double v = voxel(*volume, glm::clamp(Index3(x, y, z), Index3(0), last) * Index3(stride));
                        least = std::min(least, v);
                        most = std::max(most, v);
                    }
            EXPECT_EQ(filled.brick.ranges[std::size_t(b)].x, float(least)) << level << " " << b;
            EXPECT_EQ(filled.brick.ranges[std::size_t(b)].y, float(most)) << level << " " << b;
        }
    }
}

TEST(BrickTexels, RangesHoldTheMixture) {
    // An impulse of the parent's that the brick has not, as filters that overshoot give it: the ranges of the blocks
    // must hold both.
    const VolumePtr volume = make_volume({32, 32, 32}, ScalarType::u16, [](auto x, auto y, auto z) { return noise(x, y, z) > 4000 ? 60000.0 : 100.0; });
    const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(8), PyramidFilter::lifting53);
    for (const CornerBlend& blend : {CornerBlend{}, kAll, CornerBlend{0, 1, 0, 1, 0, 1, 0, 1}}) {
        const Filled filled = fill(bricks, {0, {2, 1, 1}}, blend, {0, 65535});
        for (int z = 0; z <= 8; ++z)
            for (int y = 0; y <= 8; ++y)
                for (int x = 0; x <= 8; ++x) {
                    const glm::ivec3 block = glm::min(glm::ivec3(x, y, z) / 4, glm::ivec3(1));
                    const glm::vec2 r = filled.brick.ranges[std::size_t((block.z * 2 + block.y) * 2 + block.x)];
                    EXPECT_GE(filled.at({x, y, z}), double(r.x) - 1e-9);
                    EXPECT_LE(filled.at({x, y, z}), double(r.y) + 1e-9);
                }
    }
}
