#include "core/data/dense_pyramid.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "core/base/error.h"
#include "core/data/brick_cache.h"
#include "tests/support/volumes.h"

namespace voxloom {
namespace {

using testing::make_volume;
using testing::voxel;

constexpr PyramidFilter kFilters[] = {PyramidFilter::subsample, PyramidFilter::average, PyramidFilter::lifting53};
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

VolumePtr level(const BricksPtr& bricks, int l) { return level_as_volume(bricks, l, BrickCache::global()); }

// All values of a level as double, components interleaved.
std::vector<double> values(const BricksPtr& bricks, int l) {
    const VolumePtr volume = level(bricks, l);
    Buffer bytes(volume->desc().dense_bytes());
    volume->read(Box::of(volume->desc().dims), bytes.bytes(), {});
    return with_type(volume->desc().type, [&](auto t) {
        const auto v = bytes.as<decltype(t)>();
        return std::vector<double>(v.begin(), v.end());
    });
}

double mean(const std::vector<double>& v) {
    double sum = 0;
    for (double x : v) sum += x;
    return sum / double(v.size());
}

// A volume that is not in memory: a formula, read by region.
class Streamed final : public Volume {
  public:
    explicit Streamed(VolumePtr dense) : Volume(dense->desc()), dense_(std::move(dense)) {}
    void read(const Box& box, std::span<std::byte> out, const std::stop_token& stop) const override {
        dense_->read(box, out, stop);
    }
    void read_mask(const Box& box, std::span<std::uint8_t> out) const override { dense_->read_mask(box, out); }

  private:
    VolumePtr dense_;
};

VolumePtr masked(VolumePtr volume, const std::function<bool(Index3)>& valid) {
    VolumeDesc desc = volume->desc();
    desc.has_mask = true;
    Buffer voxels(desc.dense_bytes()), mask(desc.voxels());
    volume->read(Box::of(desc.dims), voxels.bytes(), {});
    std::size_t i = 0;
    for (std::int64_t z = 0; z < desc.dims.z; ++z)
        for (std::int64_t y = 0; y < desc.dims.y; ++y)
            for (std::int64_t x = 0; x < desc.dims.x; ++x) mask.as<std::uint8_t>()[i++] = valid({x, y, z});
    return std::make_shared<DenseVolume>(desc, std::move(voxels), std::move(mask));
}

VolumePtr noise(Index3 dims, ScalarType type, double lo, double hi, unsigned seed = 1) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(lo, hi);
    return make_volume(dims, type, [&](auto, auto, auto) { return uniform(random); });
}

TEST(DensePyramid, LevelZeroIsTheVolumeBitForBit) {
    for (int type = 0; type < kScalarTypes; ++type)
        for (PyramidFilter filter : kFilters) {
            const VolumePtr volume = noise({33, 20, 9}, ScalarType(type), -300, 70000);
            const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(8), filter);
            Buffer a(volume->desc().dense_bytes()), b(volume->desc().dense_bytes());
            volume->read(Box::of(volume->desc().dims), a.bytes(), {});
            level(bricks, 0)->read(Box::of(volume->desc().dims), b.bytes(), {});
            EXPECT_TRUE(std::ranges::equal(a.bytes(), b.bytes()));
        }
}

TEST(DensePyramid, SubsamplingKeepsTheEvenSamplesAsTheyAre) {
    const VolumePtr volume = noise({37, 22, 19}, ScalarType::i16, -3000, 3000);
    const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(4), PyramidFilter::subsample);
    for (int l = 1; l < int(bricks->desc().levels.size()); ++l) {
        const LevelDesc& desc = bricks->desc().levels[std::size_t(l)];
        for (Index3 i : {Index3(0), desc.dims - Index3(1), desc.dims / Index3(2)})
            EXPECT_EQ(voxel(*level(bricks, l), i), voxel(*volume, i * Index3(desc.stride)));
    }
}

TEST(DensePyramid, ALinearRampIsThatRampAtTheWorldPositionsOfEveryLevel) {
    for (ScalarType type : {ScalarType::u8, ScalarType::u16, ScalarType::i32, ScalarType::f32, ScalarType::f64})
        for (PyramidFilter filter : kFilters)
            for (Index3 dims : {Index3(33, 17, 26), Index3(40, 41, 2)}) {
                // One value a voxel, in whole numbers, so that integers represent it at every level.
                const VolumePtr ramp = make_volume(
                    dims, type, [](auto x, auto y, auto z) { return double(x + 2 * y + 3 * z); }, {0.5, 0.6, 0.7});
                const BricksPtr bricks = make_dense_pyramid(ramp, glm::ivec3(4), filter);
                ASSERT_GT(bricks->desc().levels.size(), 2u);
                for (int l = 0; l < int(bricks->desc().levels.size()); ++l) {
                    const LevelDesc& desc = bricks->desc().levels[std::size_t(l)];
                    const glm::dmat4 index_to_world = level(bricks, l)->desc().index_to_world;
                    const std::vector<double> all = values(bricks, l);
                    auto v = all.begin();
                    for (std::int64_t z = 0; z < desc.dims.z; ++z)
                        for (std::int64_t y = 0; y < desc.dims.y; ++y)
                            for (std::int64_t x = 0; x < desc.dims.x; ++x) {
                                const glm::dvec4 world = index_to_world * glm::dvec4(x, y, z, 1);
                                const double expected = world.x / 0.5 + 2 * world.y / 0.6 + 3 * world.z / 0.7;
                                ASSERT_NEAR(*v++, expected, 1e-4);
                            }
                }
            }
}

// (1 2 1)/4 of 0, 4, 0, 0, 8 around the even samples; ends stay (point reflection).
TEST(DensePyramid, AverageByHand) {
    const double line[] = {1, 4, 6, 0, 8, 2, 5};
    const VolumePtr volume = make_volume({7, 1, 1}, ScalarType::f32, [&](auto x, auto, auto) { return line[x]; });
    const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(4), PyramidFilter::average);
    EXPECT_EQ(values(bricks, 1), (std::vector<double>{1, (4 + 12 + 0) / 4.0, (0 + 16 + 2) / 4.0, 5}));
}

// s[i] = x[2i] + (d[i-1] + d[i])/4 with d[i] = x[2i+1] - (x[2i] + x[2i+2])/2.
TEST(DensePyramid, LiftingByHand) {
    const double line[] = {1, 4, 6, 0, 8, 2, 5, 3};
    const double d[] = {4 - 3.5, 0 - 7.0, 2 - 6.5};
    const VolumePtr volume = make_volume({8, 1, 1}, ScalarType::f64, [&](auto x, auto, auto) { return line[x]; });
    const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(4), PyramidFilter::lifting53);
    // The last one: the reflection of 5 about 3 makes its right-hand detail vanish.
    EXPECT_EQ(values(bricks, 1), (std::vector<double>{1, 6 + (d[0] + d[1]) / 4, 8 + (d[1] + d[2]) / 4, 5 + d[2] / 4}));
}

TEST(DensePyramid, MeanBrightnessDoesNotDriftWithLevel) {
    for (PyramidFilter filter : {PyramidFilter::average, PyramidFilter::lifting53})
        for (ScalarType type : {ScalarType::u8, ScalarType::i16, ScalarType::u32}) {
            // Two neighbouring values at random: every filtered sample has to be rounded.
            const VolumePtr volume = noise({96, 96, 96}, type, 99.5, 101.5);
            const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(8), filter);
            const double fine = mean(values(bricks, 0));
            for (int l = 1; l <= 2; ++l) {
                const std::vector<double> v = values(bricks, l);
                // Five sigma of the mean of so many independent samples of at most this variance.
                EXPECT_NEAR(mean(v), fine, 5 * 0.5 / std::sqrt(double(v.size()))) << l;
            }
        }
}

TEST(DensePyramid, OvershootIsKeptInTheTreeAndClampedWhereItIsDelivered) {
    const VolumePtr step = make_volume({33, 1, 1}, ScalarType::u8, [](auto x, auto, auto) { return x < 16 ? 0. : 255.; });
    const BricksPtr bricks = make_dense_pyramid(step, glm::ivec3(8), PyramidFilter::lifting53);
    EXPECT_EQ(bricks->desc().tree_type, ScalarType::i16);
    BrickCache cache(1 << 20);
    double least = 0, most = 0;
    for (int i = 0; i < 3; ++i) {
        const BrickVoxelsPtr brick = cache.get(bricks, {1, {i, 0, 0}});
        for (std::int16_t v : brick->voxels.as<std::int16_t>()) {
            least = std::min<double>(least, v);
            most = std::max<double>(most, v);
        }
    }
    EXPECT_LT(least, 0);
    EXPECT_GT(most, 255 - 1);
    for (double v : values(bricks, 1)) EXPECT_TRUE(v >= 0 && v <= 255);
    for (int i = 0; i < 3; ++i) {
        EXPECT_GE(bricks->info({1, {i, 0, 0}}).range.min, 0);
        EXPECT_LE(bricks->info({1, {i, 0, 0}}).range.max, 255);
    }
}

TEST(DensePyramid, AConstantIsExactAtEveryLevelForEveryTypeAndItsLimits) {
    for (int type = 0; type < kScalarTypes; ++type)
        for (PyramidFilter filter : kFilters)
            for (double constant : {0.0, limits_of(ScalarType(type)).first, limits_of(ScalarType(type)).second}) {
                const VolumePtr volume =
                    make_volume({19, 9, 11}, ScalarType(type), [&](auto, auto, auto) { return constant; });
                const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(4), filter);
                for (int l = 0; l < int(bricks->desc().levels.size()); ++l) {
                    for (double v : values(bricks, l)) ASSERT_EQ(v, constant) << name_of(ScalarType(type));
                    EXPECT_EQ(bricks->info({l, {0, 0, 0}}).l2, 0);
                    EXPECT_EQ(bricks->info({l, {0, 0, 0}}).max_error, 0);
                    EXPECT_EQ(bricks->info({l, {0, 0, 0}}).range, (ValueRange{constant, constant}));
                }
            }
}

TEST(DensePyramid, TheNyquistCheckerboardIsAveragedAwayAndAliasedBySubsampling) {
    const VolumePtr board = make_volume({33, 33, 33}, ScalarType::f32,
                                        [](auto x, auto y, auto z) { return (x + y + z) % 2 ? -100. : 100.; });
    const BricksPtr average = make_dense_pyramid(board, glm::ivec3(8), PyramidFilter::average);
    EXPECT_NEAR(voxel(*level(average, 1), {4, 5, 6}), 0, 1e-6);
    const BricksPtr subsample = make_dense_pyramid(board, glm::ivec3(8), PyramidFilter::subsample);
    for (double v : values(subsample, 1)) ASSERT_EQ(v, 100);
}

// --- what is not valid ---------------------------------------------------------------------------

TEST(DensePyramid, NanAndInfinityNeverEnterAFilter) {
    for (double bad : {kNan, kInf, -kInf}) {
        const VolumePtr volume = make_volume({9, 9, 9}, ScalarType::f32, [&](auto x, auto y, auto z) {
            return x == 4 && y == 4 && z == 4 ? bad : 7.0;
        });
        for (PyramidFilter filter : {PyramidFilter::average, PyramidFilter::lifting53}) {
            const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(4), filter);
            for (int l = 1; l < int(bricks->desc().levels.size()); ++l)
                for (double v : values(bricks, l)) ASSERT_NEAR(v, 7, 1e-6);
            EXPECT_EQ(bricks->info({0, {1, 1, 1}}).range, (ValueRange{7, 7}));
            EXPECT_NEAR(bricks->info({1, {0, 0, 0}}).l2, 0, 1e-5);
        }
    }
}

TEST(DensePyramid, ASampleWithoutAnyValidNeighbourIsNan) {
    const VolumePtr volume =
        make_volume({16, 3, 3}, ScalarType::f64, [&](auto x, auto, auto) { return x < 8 ? kNan : double(x); });
    const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(4), PyramidFilter::lifting53);
    EXPECT_TRUE(std::isnan(voxel(*level(bricks, 1), {2, 0, 0})));
    EXPECT_EQ(voxel(*level(bricks, 1), {4, 0, 0}), (8 * 2 + 9) / 3.0);  // average of what is there
    EXPECT_EQ(bricks->info({0, {0, 0, 0}}).range, ValueRange{});
    EXPECT_EQ(bricks->info({0, {1, 0, 0}}).range, (ValueRange{8, 8}));  // its neighbour's first voxel
    EXPECT_TRUE(std::isfinite(bricks->info({1, {0, 0, 0}}).l2));
}

TEST(DensePyramid, AVolumeOfNothingButNanSurvives) {
    const VolumePtr volume = make_volume({9, 9, 9}, ScalarType::f32, [](auto, auto, auto) { return kNan; });
    for (PyramidFilter filter : kFilters) {
        const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(4), filter);
        for (double v : values(bricks, 1)) EXPECT_TRUE(std::isnan(v));
        EXPECT_EQ(bricks->info({1, {0, 0, 0}}).range, ValueRange{});
        EXPECT_EQ(bricks->info({1, {0, 0, 0}}).l2, 0);
    }
}

TEST(DensePyramid, MaskedVoxelsNeverEnterAFilterAndTheMaskHasLevels) {
    const VolumePtr volume = masked(
        make_volume({16, 12, 9}, ScalarType::u8, [](auto x, auto, auto) { return x < 8 ? 255.0 : 10.0; }),
        [](Index3 i) { return i.x >= 8; });
    for (PyramidFilter filter : kFilters) {
        const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(4), filter);
        for (int l = 0; l < int(bricks->desc().levels.size()); ++l) {
            const VolumePtr here = level(bricks, l);
            ASSERT_TRUE(here->desc().has_mask);
            std::vector<std::uint8_t> mask(here->desc().voxels());
            here->read_mask(Box::of(here->desc().dims), mask);
            const std::vector<double> v = values(bricks, l);
            for (std::size_t i = 0; i < v.size(); ++i)
                ASSERT_TRUE(!mask[i] || v[i] == 10);
            EXPECT_EQ(mask[0], 0);
            EXPECT_EQ(mask.back(), 1);
        }
        EXPECT_EQ(bricks->info({0, {0, 0, 0}}).range, ValueRange{});
        EXPECT_EQ(bricks->info({0, {3, 0, 0}}).range, (ValueRange{10, 10}));
    }
}

TEST(DensePyramid, HugeAndTinyFloatsStayFinite) {
    for (ScalarType type : {ScalarType::f32, ScalarType::f64})
        for (PyramidFilter filter : kFilters) {
            const double most = limits_of(type).second;
            const VolumePtr volume = make_volume({17, 9, 9}, type, [&](auto x, auto y, auto z) {
                const double all[] = {most, -most, 1e-30, 0, -0.0, 1e-310, most};
                return all[(x * 5 + y * 3 + z) % 7];
            });
            const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(4), filter);
            for (int l = 1; l < int(bricks->desc().levels.size()); ++l)
                for (double v : values(bricks, l)) ASSERT_TRUE(std::isfinite(v));
        }
}

// --- errors and ranges ---------------------------------------------------------------------------

// The eight samples around a voxel of level 0, one at a time: slow and plain.
struct Truth {
    std::vector<double> fine, coarse;
    Index3 fine_dims, dims, stride;
    int components;
    double upsampled(Index3 i, int c, double& weights) const {
        double sum = 0;
        weights = 0;
        for (int corner = 0; corner < 8; ++corner) {
            Index3 at;
            double w = 1;
            for (int a = 0; a < 3; ++a) {
                const std::int64_t n = i[a] / stride[a];
                const double f = double(i[a] % stride[a]) / double(stride[a]);
                const bool upper = corner >> a & 1;
                at[a] = std::min(n + upper, dims[a] - 1);
                w *= upper ? f : 1 - f;
            }
            const double v = coarse[std::size_t(((at.z * dims.y + at.y) * dims.x + at.x) * components + c)];
            if (w == 0 || !std::isfinite(v)) continue;
            sum += w * v;
            weights += w;
        }
        return sum / weights;
    }
};

void expect_exact_errors(const VolumePtr& volume, const BricksPtr& bricks) {
    const BricksDesc& desc = bricks->desc();
    for (int l = 0; l < int(desc.levels.size()); ++l) {
        const Truth truth{values(bricks, 0), values(bricks, l), volume->desc().dims, desc.levels[std::size_t(l)].dims,
                          Index3(desc.levels[std::size_t(l)].stride), volume->desc().components};
        const Index3 grid(desc.levels[std::size_t(l)].bricks);
        for (std::int64_t b = 0; b < grid.x * grid.y * grid.z; ++b) {
            const BrickId id{l, glm::ivec3(b % grid.x, b / grid.x % grid.y, b / (grid.x * grid.y))};
            bool exact = true;
            auto measure = [&](const Box& box, double& largest) {
                double squares = 0;
                for (std::int64_t z = box.lo.z; z < box.hi.z; ++z)
                    for (std::int64_t y = box.lo.y; y < box.hi.y; ++y)
                        for (std::int64_t x = box.lo.x; x < box.hi.x; ++x)
                            for (int c = 0; c < truth.components; ++c) {
                                const double original =
                                    truth.fine[std::size_t(((z * truth.fine_dims.y + y) * truth.fine_dims.x + x) *
                                                               truth.components + c)];
                                double weights;
                                const double error = std::abs(truth.upsampled({x, y, z}, c, weights) - original);
                                if (!std::isfinite(original)) continue;
                                if (weights == 0) exact = false;  // nothing to compare with
                                if (weights == 0) continue;
                                squares += error * error;
                                largest = std::max(largest, error);
                            }
                return std::sqrt(squares);
            };
            const BrickInfo info = bricks->info(id);
            double largest = 0, ignored = 0;
            const double l2 = measure(desc.fine_box_of(id), largest);
            const double slack = 1e-9 * (1 + l2);
            ASSERT_NEAR(info.l2, l2, slack) << l << " " << b;
            ASSERT_NEAR(info.max_error, largest, 1e-9 * (1 + largest));
            std::array<double, 8> octants{};
            for (BrickId finer : desc.finer(id))
                octants[std::size_t(desc.octant_of(finer))] = measure(desc.fine_box_of(finer), ignored);
            for (std::size_t o = 0; o < 8; ++o) ASSERT_NEAR(info.octant_l2[o], octants[o], slack);
            EXPECT_EQ(info.exact_error, exact);
        }
    }
}

TEST(DensePyramid, ErrorsOfBricksAndOctantsAreThoseOfInterpolatingVoxelByVoxel) {
    for (PyramidFilter filter : kFilters)
        for (Index3 dims : {Index3(21, 18, 13), Index3(9, 1, 30), Index3(16, 16, 16)})
            for (ScalarType type : {ScalarType::u8, ScalarType::i16, ScalarType::u32, ScalarType::f32}) {
                const VolumePtr volume = noise(dims, type, 0, 255);
                expect_exact_errors(volume, make_dense_pyramid(volume, {4, 5, 3}, filter));
            }
}

TEST(DensePyramid, ErrorsLeaveOutWhatIsNotValid) {
    std::mt19937 random(5);
    const VolumePtr volume = make_volume({22, 15, 12}, ScalarType::f32, [&](auto, auto, auto) {
        return random() % 5 == 0 ? kNan : double(random() % 100);
    });
    for (PyramidFilter filter : {PyramidFilter::average, PyramidFilter::lifting53})
        expect_exact_errors(volume, make_dense_pyramid(volume, glm::ivec3(4), filter));
}

TEST(DensePyramid, ErrorsAndLevelsOfSeveralComponentsAreThoseOfEachTogether) {
    for (int components = 2; components <= 4; ++components) {
        VolumeDesc desc;
        desc.dims = {19, 11, 10};
        desc.type = ScalarType::u8;
        desc.components = components;
        Buffer voxels(desc.dense_bytes());
        std::mt19937 random(7);
        for (std::uint8_t& v : voxels.as<std::uint8_t>()) v = std::uint8_t(random());
        const auto volume = std::make_shared<DenseVolume>(desc, std::move(voxels));
        for (PyramidFilter filter : kFilters) {
            const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(4), filter);
            expect_exact_errors(volume, bricks);
            // Each component by itself gives the same level.
            for (int c = 0; c < components; ++c) {
                const VolumePtr one = make_volume(desc.dims, desc.type, [&](auto x, auto y, auto z) {
                    std::array<std::uint8_t, 4> v{};
                    volume->read({{x, y, z}, {x + 1, y + 1, z + 1}},
                                 std::as_writable_bytes(std::span(v.data(), std::size_t(components))), {});
                    return double(v[std::size_t(c)]);
                });
                const std::vector<double> all = values(bricks, 1);
                const std::vector<double> alone = values(make_dense_pyramid(one, glm::ivec3(4), filter), 1);
                for (std::size_t i = 0; i < alone.size(); ++i)
                    ASSERT_EQ(all[i * std::size_t(components) + std::size_t(c)], alone[i]);
            }
        }
    }
}

TEST(DensePyramid, RangesCoverWhateverIsInterpolatedInABrickAndNothingMore) {
    const VolumePtr volume = noise({21, 18, 13}, ScalarType::i16, -500, 500);
    for (PyramidFilter filter : kFilters) {
        const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(4), filter);
        for (int l = 0; l < int(bricks->desc().levels.size()); ++l) {
            const LevelDesc& desc = bricks->desc().levels[std::size_t(l)];
            const Index3 grid(desc.bricks);
            for (std::int64_t b = 0; b < grid.x * grid.y * grid.z; ++b) {
                const BrickId id{l, glm::ivec3(b % grid.x, b / grid.x % grid.y, b / (grid.x * grid.y))};
                const Box own = bricks->desc().box_of(id);
                const Box box{glm::max(own.lo - Index3(1), Index3(0)), glm::min(own.hi + Index3(1), desc.dims)};
                Buffer read(box.voxels() * 2);
                read_region(bricks, l, box, read.bytes(), BrickCache::global());
                const auto [lo, hi] = std::ranges::minmax(read.as<std::int16_t>());
                EXPECT_EQ(bricks->info(id).range, (ValueRange{double(lo), double(hi)}));
            }
        }
    }
}

// --- sizes, streaming, threads -------------------------------------------------------------------

TEST(DensePyramid, EmptyThinAndSingleVoxelVolumesWork) {
    for (Index3 dims : {Index3(0, 0, 0), Index3(5, 0, 5), Index3(1, 1, 1), Index3(1, 1, 200), Index3(200, 1, 1),
                        Index3(1, 67, 31), Index3(2, 2, 2)})
        for (PyramidFilter filter : kFilters) {
            const VolumePtr volume = noise(dims, ScalarType::u8, 0, 255);
            const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(4), filter);
            EXPECT_EQ(values(bricks, 0).size(), Box::of(dims).voxels());
            expect_exact_errors(volume, bricks);
        }
}

TEST(DensePyramid, AStreamedVolumeGivesTheSameAndKeepsOnlyTheCoarseLevels) {
    for (PyramidFilter filter : kFilters) {
        const VolumePtr dense = noise({70, 140, 40}, ScalarType::u16, 0, 60000);
        const auto streamed = std::make_shared<Streamed>(dense);
        const BricksPtr a = make_dense_pyramid(dense, glm::ivec3(16), filter);
        const BricksPtr b = make_dense_pyramid(streamed, glm::ivec3(16), filter);
        EXPECT_LT(b->resident_bytes(), dense->desc().dense_bytes() / 2);
        for (int l = 0; l < int(a->desc().levels.size()); ++l) {
            EXPECT_EQ(values(a, l), values(b, l));
            EXPECT_EQ(a->info({l, {0, 0, 0}}).l2, b->info({l, {0, 0, 0}}).l2);
        }
        // Bricks come the same way, whether there is an array behind them or not.
        BrickCache cache(1 << 20);
        const BrickVoxelsPtr one = cache.get(a, {0, {2, 1, 1}}), two = cache.get(b, {0, {2, 1, 1}});
        EXPECT_TRUE(std::ranges::equal(one->voxels.bytes(), two->voxels.bytes()));
    }
}

TEST(DensePyramid, MaskedStreamsGiveTheSameAsMaskedArrays) {
    const VolumePtr dense = masked(noise({30, 70, 20}, ScalarType::i16, -99, 99),
                                   [](Index3 i) { return (i.x * 7 + i.y * 3 + i.z) % 4 != 0; });
    const BricksPtr a = make_dense_pyramid(dense, glm::ivec3(8), PyramidFilter::lifting53);
    const BricksPtr b = make_dense_pyramid(std::make_shared<Streamed>(dense), glm::ivec3(8), PyramidFilter::lifting53);
    for (int l = 0; l < int(a->desc().levels.size()); ++l) EXPECT_EQ(values(a, l), values(b, l));
    EXPECT_EQ(a->info({1, {0, 0, 0}}).l2, b->info({1, {0, 0, 0}}).l2);
}

TEST(DensePyramid, DoesNotDependOnTheNumberOfThreads) {
    const VolumePtr volume = noise({90, 150, 50}, ScalarType::f32, -1, 1);
    std::vector<double> levels[2], errors[2];
    for (std::size_t run = 0; run < 2; ++run) {
        tbb::global_control control(tbb::global_control::max_allowed_parallelism, run == 0 ? 1 : 4);
        const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(8), PyramidFilter::lifting53);
        for (int l = 1; l < int(bricks->desc().levels.size()); ++l) {
            std::ranges::copy(values(bricks, l), std::back_inserter(levels[run]));
            const BrickInfo info = bricks->info({l, {0, 0, 0}});
            errors[run].insert(errors[run].end(), {info.l2, info.max_error, info.octant_l2[3]});
        }
    }
    EXPECT_EQ(levels[0], levels[1]);
    EXPECT_EQ(errors[0], errors[1]);
}

TEST(DensePyramid, StopsWhenAskedAndTellsItsProgress) {
    const VolumePtr volume = noise({200, 200, 100}, ScalarType::u8, 0, 255);
    double last = 0;
    make_dense_pyramid(volume, glm::ivec3(16), PyramidFilter::average, {}, [&](double fraction) {
        EXPECT_GE(fraction, last);
        last = fraction;
    });
    EXPECT_EQ(last, 1);
    std::stop_source stop;
    EXPECT_THROW(make_dense_pyramid(volume, glm::ivec3(16), PyramidFilter::average, stop.get_token(),
                                    [&](double) { stop.request_stop(); }),
                 Cancelled);
}

TEST(DensePyramid, TheDescriptionAheadIsTheOneAfterwards) {
    for (PyramidFilter filter : kFilters) {
        const VolumePtr volume = noise({40, 30, 20}, ScalarType::u16, 0, 99);
        const BricksDesc ahead = dense_pyramid_desc(volume->desc(), glm::ivec3(8), filter);
        const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(8), filter);
        EXPECT_EQ(ahead.compressed_bytes, bricks->desc().compressed_bytes);
        EXPECT_EQ(ahead.levels.size(), bricks->desc().levels.size());
        EXPECT_EQ(ahead.tree_type, bricks->desc().tree_type);
        std::uint64_t sum = 0;
        for (int l = 0; l < int(ahead.levels.size()); ++l) {
            const Index3 grid(ahead.levels[std::size_t(l)].bricks);
            for (std::int64_t b = 0; b < grid.x * grid.y * grid.z; ++b)
                sum += bricks->info({l, glm::ivec3(b % grid.x, b / grid.x % grid.y, b / (grid.x * grid.y))}).compressed_bytes;
        }
        EXPECT_EQ(sum, bricks->desc().compressed_bytes);
    }
}

TEST(DensePyramid, NeighbouringBricksShareTheVoxelsOfTheirFaceAtEveryLevel) {
    const VolumePtr volume = noise({30, 25, 20}, ScalarType::f32, -1, 1);
    const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(8), PyramidFilter::lifting53);
    BrickCache cache(1 << 20);
    for (int l = 0; l < 2; ++l) {
        Buffer a(9 * 9 * 9 * 4), b(9 * 9 * 9 * 4);
        read_brick(bricks, {l, {0, 0, 0}}, {0, 1}, a.bytes(), cache);
        read_brick(bricks, {l, {1, 0, 0}}, {0, 1}, b.bytes(), cache);
        for (std::size_t row = 0; row < 81; ++row) EXPECT_EQ(a.as<float>()[row * 9 + 8], b.as<float>()[row * 9]);
    }
}

}  // namespace
}  // namespace voxloom
