// Error metrics against what is worked out by hand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <limits>
#include <random>

#include "core/base/error.h"
#include "core/measure/image_error.h"
#include "core/measure/statistics.h"
#include "core/measure/sum.h"
#include "core/measure/volume_error.h"
#include "tests/support/volumes.h"

namespace voxloom {
namespace {

using testing::make_volume;

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

double wave(std::int64_t x, std::int64_t y, std::int64_t z) {
    return std::sin(0.3 * double(x)) * 90 + std::cos(0.7 * double(y)) * 30 + double(z % 7);
}

TEST(Sum, KeepsWhatPlainAdditionLoses) {
    Sum sum;
    sum.add(1e16);
    for (int i = 0; i < 1000; ++i) sum.add(1);
    sum.add(-1e16);
    EXPECT_EQ(sum.value(), 1000);
    Sum a, b;
    a.add(1e16);
    b.add(1);
    b.add(-1e16);
    a.add(b);
    EXPECT_EQ(a.value(), 1);
    a.add(kInf);
    EXPECT_EQ(a.value(), kInf);
}

TEST(Statistics, AreMedianAndPercentile) {
    std::vector<double> v;
    for (int i = 100; i >= 0; --i) v.push_back(i);
    v.push_back(kNaN);
    Statistics s = statistics_of(v);
    EXPECT_EQ(s.count, 101u);
    EXPECT_EQ(s.median, 50);
    EXPECT_EQ(s.p95, 95);
    EXPECT_EQ(s.mean, 50);
    EXPECT_EQ(s.min, 0);
    EXPECT_EQ(s.max, 100);
    EXPECT_EQ(statistics_of(std::vector<double>{1, 2}).median, 1.5);
    EXPECT_EQ(statistics_of(std::vector<double>{7}).p95, 7);
    EXPECT_EQ(statistics_of({}).count, 0u);
}

TEST(VolumeError, OfAVolumeAndItselfIsNothing) {
    VolumePtr v = make_volume({33, 17, 9}, ScalarType::i16, wave);
    VolumeError e = compare_volumes(v, v);
    EXPECT_TRUE(e.identical());
    EXPECT_EQ(e.compared, 33u * 17 * 9);
    EXPECT_EQ(e.rmse, 0);
    EXPECT_EQ(e.max_error, 0);
    EXPECT_EQ(e.psnr_range, kInf);
    EXPECT_EQ(e.psnr_nominal, kInf);
    EXPECT_DOUBLE_EQ(e.correlation, 1);
}

TEST(VolumeError, OfAConstantOffsetIsThatOffset) {
    for (ScalarType type : {ScalarType::u8, ScalarType::i16, ScalarType::u32, ScalarType::f32,
                            ScalarType::f64}) {
        auto r = make_volume({40, 30, 20}, type, [](auto x, auto, auto) { return double(x); });
        auto v = make_volume({40, 30, 20}, type, [](auto x, auto, auto) { return double(x) + 3; });
        VolumeError e = compare_volumes(v, r);
        EXPECT_DOUBLE_EQ(e.rmse, 3);
        EXPECT_DOUBLE_EQ(e.mean_error, 3);
        EXPECT_DOUBLE_EQ(e.max_error, 3);
        EXPECT_NEAR(e.correlation, 1, 1e-12);
        EXPECT_EQ(e.reference_range, (ValueRange{0, 39}));
        EXPECT_DOUBLE_EQ(e.psnr_range, 20 * std::log10(39.0 / 3));
        EXPECT_EQ(e.psnr_nominal.has_value(), !is_float(type));
    }
}

TEST(VolumeError, StatesTheNominalPeakOfTheBitsInUse) {
    VolumeDesc desc;
    desc.type = ScalarType::u8;
    EXPECT_EQ(nominal_peak(desc), 255);
    desc.type = ScalarType::i16;
    EXPECT_EQ(nominal_peak(desc), 65535);
    desc.significant_bits = 12;
    EXPECT_EQ(nominal_peak(desc), 4095);
    desc.type = ScalarType::u32;
    desc.significant_bits = 0;
    EXPECT_EQ(nominal_peak(desc), 4294967295.0);
    desc.type = ScalarType::f32;
    EXPECT_EQ(nominal_peak(desc), std::nullopt);
    EXPECT_DOUBLE_EQ(psnr(255, 255), 0);
    EXPECT_DOUBLE_EQ(psnr(255, 2.55), 40);
    EXPECT_TRUE(std::isnan(psnr(0, 1)));
}

TEST(VolumeError, FindsTheOneVoxelThatIsWrong) {
    auto r = make_volume({70, 60, 50}, ScalarType::u16, [](auto...) { return 1000; });
    auto v = make_volume({70, 60, 50}, ScalarType::u16, [](auto x, auto y, auto z) {
        return x == 69 && y == 13 && z == 41 ? 1050 : 1000;
    });
    VolumeError e = compare_volumes(v, r);
    EXPECT_EQ(e.max_error, 50);
    EXPECT_EQ(e.max_error_at, Index3(69, 13, 41));
    EXPECT_DOUBLE_EQ(e.rmse, 50 / std::sqrt(70.0 * 60 * 50));
    EXPECT_EQ(e.different, 1u);
    EXPECT_TRUE(std::isnan(e.correlation));  // the reference is constant
    EXPECT_TRUE(std::isnan(e.psnr_range));
}

TEST(VolumeError, ComparesAcrossScalarTypes) {
    auto f = make_volume({9, 9, 9}, ScalarType::f32, [](auto x, auto, auto) { return x + 0.25; });
    auto u = make_volume({9, 9, 9}, ScalarType::u8, [](auto x, auto, auto) { return double(x); });
    EXPECT_DOUBLE_EQ(compare_volumes(f, u).rmse, 0.25);
    EXPECT_DOUBLE_EQ(compare_volumes(f, u).mean_error, 0.25);
    EXPECT_DOUBLE_EQ(compare_volumes(u, f).mean_error, -0.25);
}

TEST(VolumeError, MeasuresCorrelationOfOpposites) {
    auto a = make_volume({300, 200, 3}, ScalarType::f64, wave);
    auto b = make_volume({300, 200, 3}, ScalarType::f64,
                         [](auto x, auto y, auto z) { return 1e9 - 2 * wave(x, y, z); });
    EXPECT_NEAR(compare_volumes(a, b).correlation, -1, 1e-9);
}

TEST(VolumeError, CountsWhatIsNotFiniteAndKeepsItOutOfTheSums) {
    auto r = make_volume({4, 1, 1}, ScalarType::f32, [](auto x, auto, auto) {
        return x == 0 ? kNaN : x == 1 ? 5 : x == 2 ? kInf : 7.0;
    });
    auto v = make_volume({4, 1, 1}, ScalarType::f32, [](auto x, auto, auto) {
        return x == 0 ? kNaN : x == 1 ? kNaN : x == 2 ? kInf : 9.0;
    });
    VolumeError e = compare_volumes(v, r);
    EXPECT_EQ(e.compared, 1u);
    EXPECT_EQ(e.skipped, 2u);     // NaN with NaN, the same infinity
    EXPECT_EQ(e.mismatched, 1u);  // 5 with NaN
    EXPECT_EQ(e.different, 2u);
    EXPECT_EQ(e.rmse, 2);
    EXPECT_FALSE(e.identical());
}

TEST(VolumeError, TreatsWhatAMaskHidesAsNotThere) {
    auto masked = [](std::uint8_t first) {
        VolumeDesc desc;
        desc.dims = {3, 1, 1};
        desc.has_mask = true;
        Buffer voxels(3), mask(3);
        for (int i = 0; i < 3; ++i) {
            voxels.as<std::uint8_t>()[std::size_t(i)] = std::uint8_t(10 * i);
            mask.as<std::uint8_t>()[std::size_t(i)] = 1;
        }
        mask.as<std::uint8_t>()[0] = first;
        mask.as<std::uint8_t>()[2] = 0;
        return std::make_shared<DenseVolume>(desc, std::move(voxels), std::move(mask));
    };
    VolumeError e = compare_volumes(masked(1), masked(0));
    EXPECT_EQ(e.compared, 1u);
    EXPECT_EQ(e.skipped, 1u);
    EXPECT_EQ(e.mismatched, 1u);
}

TEST(VolumeError, TakesEveryComponentAsASample) {
    auto rgb = [](std::uint8_t blue) {
        VolumeDesc desc;
        desc.dims = {2, 2, 1};
        desc.components = 3;
        Buffer voxels(12);
        for (std::size_t i = 0; i < 12; ++i) voxels.as<std::uint8_t>()[i] = i == 8 ? blue : 7;
        return std::make_shared<DenseVolume>(desc, std::move(voxels));
    };
    VolumeError e = compare_volumes(rgb(19), rgb(7));
    EXPECT_EQ(e.compared, 12u);
    EXPECT_DOUBLE_EQ(e.rmse, 12 / std::sqrt(12.0));
    EXPECT_EQ(e.max_error_at, Index3(0, 1, 0));
}

TEST(VolumeError, IsTheSameForAnyNumberOfThreadsAndNearlySoForAnyTile) {
    auto r = make_volume({130, 90, 70}, ScalarType::f32, wave);
    auto v = make_volume({130, 90, 70}, ScalarType::f32, [](auto x, auto y, auto z) {
        return wave(x, y, z) + 1e-3 * std::sin(double(x * y + z));
    });
    auto with_threads = [&](std::size_t n) {
        tbb::global_control limit(tbb::global_control::max_allowed_parallelism, n);
        return compare_volumes(v, r);
    };
    VolumeError one = with_threads(1), four = with_threads(4);
    EXPECT_EQ(one.rmse, four.rmse);
    EXPECT_EQ(one.mean_error, four.mean_error);
    EXPECT_EQ(one.correlation, four.correlation);
    EXPECT_EQ(one.max_error_at, four.max_error_at);
    for (Index3 tile : {Index3(1, 0, 0), Index3(32), Index3(7, 11, 13), Index3(500)}) {
        CompareOptions options;
        options.tile = tile;
        VolumeError e = compare_volumes(v, r, options);
        EXPECT_EQ(e.compared, one.compared);
        EXPECT_NEAR(e.rmse, one.rmse, 1e-14 * one.rmse);
        EXPECT_EQ(e.max_error, one.max_error);
        EXPECT_NEAR(e.correlation, one.correlation, 1e-12);
    }
}

TEST(VolumeError, OfNothingIsNotANumberAndOfOneVoxelIsItsError) {
    for (Index3 dims : {Index3(0), Index3(0, 5, 5)}) {
        auto empty = make_volume(dims, ScalarType::u8, wave);
        VolumeError e = compare_volumes(empty, empty);
        EXPECT_EQ(e.compared, 0u);
        EXPECT_TRUE(std::isnan(e.rmse));
        EXPECT_TRUE(e.identical());
    }
    auto a = make_volume(Index3(1), ScalarType::u8, [](auto...) { return 3; });
    auto b = make_volume(Index3(1), ScalarType::u8, [](auto...) { return 8; });
    EXPECT_EQ(compare_volumes(a, b).rmse, 5);
    EXPECT_EQ(compare_volumes(a, b).mean_error, -5);
}

TEST(VolumeError, NamesBothSizesWhereTheyDiffer) {
    auto a = make_volume({4, 5, 6}, ScalarType::u8, wave);
    auto b = make_volume({4, 5, 7}, ScalarType::u8, wave);
    try {
        compare_volumes(a, b);
        FAIL();
    } catch (const Error& e) {
        EXPECT_STREQ(e.what(), "the volume has 4 x 5 x 6 voxels and the reference 4 x 5 x 7; they must "
                               "agree, so crop or resample one of them");
    }
}

TEST(VolumeError, StopsWhenAskedTo) {
    auto v = make_volume({64, 64, 64}, ScalarType::u8, wave);
    std::stop_source stop;
    stop.request_stop();
    CompareOptions options;
    options.stop = stop.get_token();
    EXPECT_THROW(compare_volumes(v, v, options), Cancelled);
}

Image picture(int w, int h, const std::function<glm::vec4(int, int)>& f) {
    Image image({w, h}, Image::Format::rgba32f);
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x) image.rgba32f()[std::size_t(y * w + x)] = f(x, y);
    return image;
}
glm::vec4 texture(int x, int y) {
    return glm::vec4(0.5f + 0.4f * std::sin(0.9f * float(x)) * std::cos(0.5f * float(y)));
}

TEST(ImageError, OfAPictureAndItselfIsNothing) {
    Image a = picture(40, 30, texture);
    ImageError e = compare_images(a, a);
    EXPECT_EQ(e.rmse, 0);
    EXPECT_EQ(e.psnr, kInf);
    EXPECT_EQ(e.ssim, 1);
    EXPECT_EQ(e.share_off, 0);
    EXPECT_EQ(e.pixels, 1200u);
}

TEST(ImageError, OfAConstantOffsetIsThatOffset) {
    Image a = picture(20, 20, [](int, int) { return glm::vec4(0.5f); });
    Image b = picture(20, 20, [](int, int) { return glm::vec4(0.25f); });
    ImageError e = compare_images(a, b);
    EXPECT_DOUBLE_EQ(e.rmse, 0.25);
    EXPECT_DOUBLE_EQ(e.psnr, 20 * std::log10(4.0));
    EXPECT_EQ(e.share_off, 1);
    // Of constants only the first factor of the SSIM is left.
    EXPECT_NEAR(e.ssim, (2 * 0.5 * 0.25 + 1e-4) / (0.25 + 0.0625 + 1e-4), 1e-9);
}

TEST(ImageError, FindsTheOnePixelThatIsOff) {
    Image a = picture(16, 16, texture);
    Image b = picture(16, 16, [](int x, int y) {
        return texture(x, y) + (x == 3 && y == 12 ? glm::vec4(0, 0, 0.5f, 0) : glm::vec4(0.0f));
    });
    ImageError e = compare_images(b, a);
    EXPECT_EQ(e.max_error_at, glm::ivec2(3, 12));
    EXPECT_NEAR(e.max_error, 0.5, 1e-6);
    EXPECT_NEAR(e.rmse, 0.5 / std::sqrt(4 * 256.0), 1e-7);
    EXPECT_EQ(e.share_off, 1.0 / 256);
    EXPECT_LT(e.ssim, 1);
}

TEST(ImageError, DoesNotCountOneStepOfEightBits) {
    Image a({256, 1}, Image::Format::rgba8), b({256, 1}, Image::Format::rgba8);
    for (int x = 0; x < 256; ++x) {
        a.rgba8()[std::size_t(x)] = glm::u8vec4(x);
        b.rgba8()[std::size_t(x)] = glm::u8vec4(x < 255 ? x + 1 : 253);
    }
    ImageError e = compare_images(a, b);
    EXPECT_EQ(e.share_off, 1.0 / 256);  // only the last one is two steps off
}

TEST(ImageError, HasTheSsimThatFollowsFromItsDefinition) {
    // Noise b = a + n, independent: the window's sums written out for one position of an 11 x 11 image.
    std::mt19937 random(3);
    std::uniform_real_distribution<float> uniform(0, 1);
    std::vector<double> u(121), v(121);
    for (std::size_t i = 0; i < 121; ++i) u[i] = uniform(random), v[i] = 0.5 * u[i] + 0.5 * uniform(random);
    Image a = picture(11, 11, [&](int x, int y) { return glm::vec4(float(u[std::size_t(y * 11 + x)])); });
    Image b = picture(11, 11, [&](int x, int y) { return glm::vec4(float(v[std::size_t(y * 11 + x)])); });
    double weight = 0, mu = 0, mv = 0, suu = 0, svv = 0, suv = 0;
    for (int pass = 0; pass < 2; ++pass)
        for (int y = 0; y < 11; ++y)
            for (int x = 0; x < 11; ++x) {
                double w = std::exp(-((x - 5) * (x - 5) + (y - 5) * (y - 5)) / 4.5);
                std::size_t i = std::size_t(y * 11 + x);
                if (pass == 0) {
                    weight += w, mu += w * u[i], mv += w * v[i];
                } else {
                    suu += w * (u[i] - mu) * (u[i] - mu) / weight;
                    svv += w * (v[i] - mv) * (v[i] - mv) / weight;
                    suv += w * (u[i] - mu) * (v[i] - mv) / weight;
                }
                if (pass == 0 && i == 120) mu /= weight, mv /= weight;
            }
    double expected = (2 * mu * mv + 1e-4) * (2 * suv + 9e-4) /
                      ((mu * mu + mv * mv + 1e-4) * (suu + svv + 9e-4));
    EXPECT_NEAR(compare_images(a, b).ssim, expected, 1e-6);
}

TEST(ImageError, HoldsForPicturesSmallerThanTheWindow) {
    for (auto [w, h] : {std::pair(1, 1), {1, 40}, {40, 1}, {3, 7}, {10, 12}}) {
        Image a = picture(w, h, texture);
        Image b = picture(w, h, [](int x, int y) { return texture(x, y) * 0.9f; });
        EXPECT_EQ(compare_images(a, a).ssim, 1);
        EXPECT_LT(compare_images(a, b).ssim, 1);
        EXPECT_GT(compare_images(a, b).ssim, 0.5);
    }
    Image none({0, 0}, Image::Format::rgba32f);
    ImageError e = compare_images(none, none);
    EXPECT_EQ(e.pixels, 0u);
    EXPECT_EQ(e.ssim, 1);
    EXPECT_EQ(e.share_off, 0);
}

TEST(ImageError, CountsPixelsThatAreNotFinite) {
    Image a = picture(4, 1, [](int x, int) { return x == 0 || x == 1 ? glm::vec4(NAN) : glm::vec4(0.5f); });
    Image b = picture(4, 1, [](int x, int) { return x == 0 ? glm::vec4(NAN) : glm::vec4(0.5f); });
    ImageError e = compare_images(a, b);
    EXPECT_EQ(e.pixels, 2u);
    EXPECT_EQ(e.mismatched, 1u);
    EXPECT_EQ(e.rmse, 0);
    EXPECT_EQ(e.share_off, 0.25);
    EXPECT_TRUE(std::isfinite(e.ssim));
}

TEST(ImageError, IsTheSameForAnyNumberOfThreads) {
    Image a = picture(200, 150, texture);
    Image b = picture(200, 150, [](int x, int y) { return texture(x, y) * 0.97f; });
    auto with_threads = [&](std::size_t n) {
        tbb::global_control limit(tbb::global_control::max_allowed_parallelism, n);
        return compare_images(a, b).ssim;
    };
    EXPECT_EQ(with_threads(1), with_threads(4));
}

TEST(ImageError, DrawsTheDifference) {
    Image a = picture(2, 1, [](int x, int) { return glm::vec4(0.5f, 0.25f, x == 1 ? NAN : 0.0f, 1.0f); });
    Image b = picture(2, 1, [](int, int) { return glm::vec4(0.25f, 0.5f, 0.0f, 0.5f); });
    ImagePtr d = difference_image(a, b, 2);
    EXPECT_EQ(d->at(0, 0), glm::vec4(0.5f, 0.5f, 0.0f, 1.0f));
    EXPECT_EQ(d->at(1, 0), glm::vec4(1.0f));
}

TEST(ImageError, EndsWhenItIsStopped) {
    const Image a = picture(40, 30, texture);
    std::stop_source stop;
    EXPECT_EQ(compare_images(a, a, stop.get_token()).rmse, 0);
    EXPECT_EQ(difference_image(a, a, 2, stop.get_token())->at(7, 7), glm::vec4(0, 0, 0, 1));
    stop.request_stop();
    EXPECT_THROW(compare_images(a, a, stop.get_token()), Cancelled);
    EXPECT_THROW(difference_image(a, a, 2, stop.get_token()), Cancelled);
}

TEST(ImageError, NamesBothSizesWhereTheyDiffer) {
    Image a({4, 4}, Image::Format::rgba8), b({4, 5}, Image::Format::rgba8);
    EXPECT_THROW(compare_images(a, b), Error);
    EXPECT_EQ(problem_with_comparison(a.size(), b.size()),
              "the image has 4 x 4 pixels and the reference 4 x 5; they must agree");
}

}  // namespace
}  // namespace voxloom
