#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "plugins/codec-wavelet/lifting.h"

namespace voxloom::wavelet {
namespace {

template <class T>
std::vector<T> noise(std::size_t count, int lo, int hi, unsigned seed) {
    std::mt19937 random(seed);
    std::vector<T> values(count);
    for (T& v : values) v = T(lo + int(random() % unsigned(hi - lo + 1)));
    return values;
}

template <class T>
class Lifting : public ::testing::Test {};
using Types = ::testing::Types<std::int16_t, std::int32_t>;
TYPED_TEST_SUITE(Lifting, Types);

TYPED_TEST(Lifting, InverseOfForwardIsTheInputForEveryParityMaskAndRounding) {
    std::vector<TypeParam> scratch;
    for (glm::ivec3 dims : {glm::ivec3(1), {2, 1, 1}, {3, 2, 1}, {5, 4, 3}, {16, 17, 15}, {32, 32, 32}, {1, 31, 8}})
        for (int mask = 0; mask < 8; ++mask)
            for (Rounding rounding : {Rounding::jpeg2000, Rounding::unbiased}) {
                const glm::bvec3 halved(mask & 1, mask & 2, mask & 4);
                const auto input = noise<TypeParam>(std::size_t(dims.x * dims.y * dims.z), -32768, 32767, 5);
                auto box = input;
                forward(box.data(), dims, halved, rounding, scratch);
                inverse(box.data(), dims, halved, rounding, scratch);
                ASSERT_EQ(box, input) << dims.x << " " << dims.y << " " << dims.z << " mask " << mask;
            }
}

TYPED_TEST(Lifting, AConstantLeavesNoDetailsAndItsOwnValue) {
    std::vector<TypeParam> scratch;
    const glm::ivec3 dims(9, 8, 7);
    for (int value : {-300, 0, 1, 255}) {
        std::vector<TypeParam> box(9 * 8 * 7, TypeParam(value));
        forward(box.data(), dims, glm::bvec3(true), Rounding::unbiased, scratch);
        for (int z = 0; z < 7; ++z)
            for (int y = 0; y < 8; ++y)
                for (int x = 0; x < 9; ++x) {
                    const bool low = x < 5 && y < 4 && z < 4;
                    ASSERT_EQ(box[std::size_t((z * 8 + y) * 9 + x)], low ? value : 0);
                }
    }
}

TYPED_TEST(Lifting, ZeroDetailsInterpolateLinearly) {
    // Low samples 0, 10, 20, 40 of a line of seven.
    std::vector<TypeParam> scratch, line = {0, 10, 20, 40, 0, 0, 0};
    inverse(line.data(), {7, 1, 1}, glm::bvec3(true), Rounding::unbiased, scratch);
    EXPECT_EQ(line, (std::vector<TypeParam>{0, 5, 10, 15, 20, 30, 40}));
}

TYPED_TEST(Lifting, SharedEndsPassOnAsTheyAreAndComeBack) {
    std::vector<TypeParam> scratch;
    for (glm::ivec3 dims : {glm::ivec3(3), {17, 9, 5}, {9, 1, 33}})
        for (int lo = 0; lo < 8; ++lo)
            for (int hi = 0; hi < 8; ++hi) {
                const Ends shared{{lo & 1, lo & 2, lo & 4}, {hi & 1, hi & 2, hi & 4}};
                const auto input = noise<TypeParam>(std::size_t(dims.x * dims.y * dims.z), -32768, 32767, 5);
                auto box = input;
                forward(box.data(), dims, glm::bvec3(true), Rounding::unbiased, scratch, shared);
                const glm::ivec3 low = low_dims(dims, glm::bvec3(true)) - 1;
                const auto at = [&](glm::ivec3 i) { return std::size_t((i.z * dims.y + i.y) * dims.x + i.x); };
                if (lo == 7) {
                    ASSERT_EQ(box[0], input[0]);
                }
                if (hi == 7) {
                    ASSERT_EQ(box[at(low)], input.back());
                }
                inverse(box.data(), dims, glm::bvec3(true), Rounding::unbiased, scratch, shared);
                ASSERT_EQ(box, input) << lo << " " << hi;
            }
}

TEST(Lifting, WorkedByHandOnFourSamples) {
    // d0 = 3 - ((1 + 8 + 1) >> 1) = -2, d1 = 2 - ((8 + 8 + 1) >> 1) = -6
    // s0 = 1 + ((-2 - 2 + 2) >> 2) = 0, s1 = 8 + ((-2 - 6 + 2) >> 2) = 6
    std::vector<std::int32_t> scratch, line = {1, 3, 8, 2};
    forward(line.data(), {4, 1, 1}, glm::bvec3(true), Rounding::unbiased, scratch);
    EXPECT_EQ(line, (std::vector<std::int32_t>{0, 6, -2, -6}));
}

// Of |HHH| at the first level, the largest over all inputs in [0, max]: 2^3 * max / 2.
TEST(Lifting, TheBoundOfTheFirstLevelIsReachedExactly) {
    for (int max : {255, 4095, 65535}) {
        const int n = 8;
        std::vector<std::int32_t> scratch, box(n * n * n);
        for (int z = 0; z < n; ++z)
            for (int y = 0; y < n; ++y)
                for (int x = 0; x < n; ++x) box[std::size_t((z * n + y) * n + x)] = (x + y + z) % 2 ? max : 0;
        forward(box.data(), glm::ivec3(n), glm::bvec3(true), Rounding::unbiased, scratch);
        std::int32_t largest = 0;
        for (int z = n / 2; z < n; ++z)
            for (int y = n / 2; y < n; ++y)
                for (int x = n / 2; x < n; ++x)
                    largest = std::max(largest, std::abs(box[std::size_t((z * n + y) * n + x)]));
        EXPECT_EQ(largest, 4 * max);  // 1020, 16380, 262140
        EXPECT_LE(largest, peak_after(0, max));
    }
}

TEST(Lifting, SixteenBitsHoldEightBitDataAndNoMore) {
    EXPECT_LE(peak_after(0, 255), 32767);
    EXPECT_LE(peak_after(-128, 127), 32767);
    EXPECT_GT(peak_after(0, 4095), 32767);
}

TEST(Lifting, BothWidthsGiveTheSameBandsWithinTheBounds) {
    std::vector<std::int16_t> scratch16;
    std::vector<std::int32_t> scratch32;
    auto wide = noise<std::int32_t>(16 * 16 * 16, 0, 255, 3);
    std::vector<std::int16_t> narrow(wide.begin(), wide.end());
    for (glm::ivec3 dims(16); dims.x > 1; dims /= 2) {
        forward(wide.data(), dims, glm::bvec3(true), Rounding::unbiased, scratch32);
        forward(narrow.data(), dims, glm::bvec3(true), Rounding::unbiased, scratch16);
        ASSERT_TRUE(std::equal(wide.begin(), wide.end(), narrow.begin()));
    }
}

double bias_of_the_low_band(Rounding rounding) {
    std::vector<std::int32_t> scratch;
    const int n = 64;
    auto box = noise<std::int32_t>(std::size_t(n) * n * n, 0, 255, 11);
    double before = 0, after = 0;
    for (auto v : box) before += v;
    forward(box.data(), glm::ivec3(n), glm::bvec3(true), rounding, scratch);
    for (int z = 0; z < n / 2; ++z)
        for (int y = 0; y < n / 2; ++y)
            for (int x = 0; x < n / 2; ++x) after += box[std::size_t((z * n + y) * n + x)];
    return after * 8 / double(box.size()) - before / double(box.size());
}

TEST(Lifting, TheDefaultRoundingDoesNotBrightenTheLowBand) {
    // On noise of this size the mean of the low band strays by about 0.3 by itself; the difference
    // between the two roundings, on the same noise, does not.
    const double difference = bias_of_the_low_band(Rounding::jpeg2000) - bias_of_the_low_band(Rounding::unbiased);
    EXPECT_NEAR(difference, 0.75, 0.05);
}

}  // namespace
}  // namespace voxloom::wavelet
