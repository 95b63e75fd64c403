#include "plugins/render-slicer/tables.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "plugins/render-slicer/blocks.h"
#include "plugins/render-slicer/keep.h"

using namespace voxloom;
using namespace voxloom::slicer;

namespace {

TransferFunction1D tent(double lo, double peak, double hi, double tau, glm::dvec3 left, glm::dvec3 right) {
    return {{{lo, Emission(0)}, {peak, Emission(0.5 * (left + right) * tau, tau)}, {hi, Emission(0)}}};
}

// The slab by brute force: `steps` pieces, each with the emission of its middle.
glm::dvec4 quadrature(const TransferFunction1D& tf, double f, double b, double d, int steps) {
    glm::dvec3 light(0);
    double depth = 0;
    for (int i = 0; i < steps; ++i) {
        Emission e = tf.at(f + (b - f) * (i + 0.5) / steps) * (d / steps);
        double alpha = -std::expm1(-e.a);
        if (e.a > 0) light += std::exp(-depth) * (alpha / e.a) * glm::dvec3(e);
        depth += e.a;
    }
    return {light, -std::expm1(-depth)};
}

glm::dvec4 seen(glm::vec4 entry) {
    double x = entry.a, alpha = -std::expm1(-x);
    return x > 0 ? glm::dvec4(glm::dvec3(entry) * (alpha / x), alpha) : glm::dvec4(0);
}

}  // namespace

TEST(PreintegratedTable, AgreesWithQuadratureInBothDirections) {
    TransferFunction1D tf{{{0, Emission(0)},
                           {0.3, Emission(8, 0, 0, 8)},
                           {0.5, Emission(0, 0.5, 0, 0.5)},
                           {0.8, Emission(0, 0, 6, 6)},
                           {1, Emission(0)}}};
    const int n = 257;
    for (double d : {0.1, 1.0, 8.0}) {
        std::vector<glm::vec4> table = preintegrated_table(tf, {0, 1}, n, d);
        double worst_alpha = 0, worst_color = 0;
        for (int f = 0; f < n; f += 16)
            for (int b = 0; b < n; b += 16) {
                if (f == b) continue;
                glm::dvec4 got = seen(table[std::size_t(b * n + f)]);
                glm::dvec4 want = quadrature(tf, f / 256.0, b / 256.0, d, 4096);
                worst_alpha = std::max(worst_alpha, std::abs(got.a - want.a));
                for (int c = 0; c < 3; ++c) worst_color = std::max(worst_color, std::abs(got[c] - want[c]));
            }
        EXPECT_LT(worst_alpha, 2e-5) << "d = " << d;
        EXPECT_LT(worst_color, 5e-3) << "d = " << d;
    }
}

TEST(PreintegratedTable, TwoHalvesCompositeToTheWhole) {
    TransferFunction1D tf = tent(0.2, 0.5, 0.9, 5, {1, 0, 0}, {0, 0, 1});
    const int n = 129;
    std::vector<glm::vec4> whole = preintegrated_table(tf, {0, 1}, n, 2);
    std::vector<glm::vec4> half = preintegrated_table(tf, {0, 1}, n, 1);
    for (int f = 0; f < n; f += 8)
        for (int b = 0; b < n; b += 8) {
            if (f == b) continue;
            int m = (f + b) / 2;
            if (m == f || m == b) continue;
            glm::dvec4 front = seen(half[std::size_t(m * n + f)]), back = seen(half[std::size_t(b * n + m)]);
            glm::dvec4 got = front + (1 - front.a) * back, want = seen(whole[std::size_t(b * n + f)]);
            EXPECT_NEAR(got.a, want.a, 2e-6);
            for (int c = 0; c < 3; ++c) EXPECT_NEAR(got[c], want[c], 2e-3);
        }
}

TEST(PreintegratedTable, KeepsTheIntegralOfAPeakNarrowerThanABin) {
    // A tent of area 0.01 * 50 / 2 inside one bin of a table with 16.
    TransferFunction1D tf = tent(0.42, 0.425, 0.43, 50, {1, 1, 1}, {1, 1, 1});
    const int n = 17;
    std::vector<glm::vec4> table = preintegrated_table(tf, {0, 1}, n, 1);
    EXPECT_NEAR(table[std::size_t(16 * n + 0)].a, 0.25, 1e-6);
    EXPECT_NEAR(table[std::size_t(0 * n + 16)].a, 0.25, 1e-6);
    // Crossing it in half of the range takes half of the slab per value, so twice the depth.
    EXPECT_NEAR(table[std::size_t(8 * n + 0)].a, 0.5, 1e-6);
    EXPECT_EQ(table[std::size_t(16 * n + 8)].a, 0.0f);
}

TEST(PreintegratedTable, OpaqueIsOpaqueAndWhatIsBehindItIsNotLost) {
    TransferFunction1D tf{{{0, Emission(0)},
                           {0.2, Emission(0)},
                           {0.2, Emission(glm::dvec4(1, 0, 0, 1) * kMaxExtinction)},
                           {0.4, Emission(glm::dvec4(1, 0, 0, 1) * kMaxExtinction)},
                           {0.4, Emission(0)},
                           {0.6, Emission(0, 0, 1, 1)},
                           {1, Emission(0, 0, 1, 1)}}};
    const int n = 65;
    std::vector<glm::vec4> table = preintegrated_table(tf, {0, 1}, n, 1);
    for (const glm::vec4& e : table)
        for (int c = 0; c < 4; ++c) ASSERT_TRUE(std::isfinite(e[c]));
    glm::dvec4 through = seen(table[std::size_t(64 * n + 0)]);
    EXPECT_EQ(through.a, 1.0);
    EXPECT_NEAR(through.r, 1.0, 1e-6);
    EXPECT_NEAR(table[std::size_t(64 * n + 48)].a, 1.0, 1e-6);  // only the blue plateau
}

TEST(DepthIntegral, DifferencesAreDepthsWhateverTheSlices) {
    const TransferFunction1D peak{{{0.0, Emission(0)}, {4.9, Emission(0)}, {5.0, Emission(3)}, {5.1, Emission(0)}, {10.0, Emission(0)}}};
    const std::vector<float> integral = depth_integral(peak, {0, 10}, 101, 2.0);
    // 2 long, through 10 values: the peak's 0.3 is met in 0.06 of it.
    EXPECT_NEAR(integral.back() - integral.front(), 0.06, 1e-7);
    EXPECT_NEAR(integral[50] - integral[49], 0.03, 1e-7);
    EXPECT_EQ(integral[48], integral[0]);
}

TEST(DepthIntegral, EndlessExtinctionStaysFinite) {
    const TransferFunction1D wall{{{0.0, Emission(kMaxExtinction)}, {10.0, Emission(kMaxExtinction)}}};
    for (float i : depth_integral(wall, {0, 10}, 64, 1e6)) EXPECT_LE(std::abs(i), 32 * kOpaqueBin);
}

TEST(NarrowPeak, IsOneOfAFewBins) {
    const auto peak = [](double width) {
        return TransferFunction1D{{{0.0, Emission(0)}, {50 - width, Emission(0)}, {50.0, Emission(1)}, {50 + width, Emission(0)}, {100.0, Emission(0)}}};
    };
    EXPECT_TRUE(has_narrow_peak(peak(0.01), {0, 100}, 101));
    EXPECT_TRUE(has_narrow_peak(peak(1), {0, 100}, 101));
    EXPECT_FALSE(has_narrow_peak(peak(8), {0, 100}, 101));
    EXPECT_FALSE(has_narrow_peak(TransferFunction1D{{{0.0, Emission(1)}}}, {0, 100}, 101));
    EXPECT_FALSE(has_narrow_peak(TransferFunction1D{{{0.0, Emission(0)}}}, {0, 100}, 101));
}

TEST(PreintegratedTable, ZeroIsExactlyZero) {
    TransferFunction1D tf{{{0, Emission(0)}}};
    for (const glm::vec4& e : preintegrated_table(tf, {0, 1}, 64, 1)) EXPECT_EQ(e, glm::vec4(0));
}

TEST(Leaps, AreTheDistancesToTheNearestBlockOfTheOtherKind) {
    std::mt19937 random(3);
    for (const glm::ivec3 n : {glm::ivec3(1, 1, 1), {1, 1, 9}, {2, 7, 1}, {7, 5, 6}, {17, 6, 5}, {300, 1, 1}, {1, 1, 300}})
        for (const unsigned one_in : {2u, 20u, 200u, ~0u}) {
            std::vector<std::uint8_t> seen(std::size_t(n.x) * std::size_t(n.y) * std::size_t(n.z));
            for (std::uint8_t& s : seen) s = random() % one_in == 0;
            auto place = [&](std::size_t i) { return glm::ivec3(int(i) % n.x, int(i) / n.x % n.y, int(i) / n.x / n.y); };
            const std::vector<std::int8_t> distances = leaps(n, seen);
            ASSERT_EQ(distances.size(), seen.size());
            for (std::size_t i = 0; i < seen.size(); ++i) {
                int nearest = 127;
                for (std::size_t o = 0; o < seen.size(); ++o) {
                    const glm::ivec3 away = glm::abs(place(o) - place(i));
                    if (seen[o] != seen[i]) nearest = std::min(nearest, std::max({away.x, away.y, away.z}));
                }
                ASSERT_EQ(distances[i], seen[i] ? nearest : -nearest) << i << " of " << n.x << " x " << n.y << " x " << n.z;
            }
        }
}

TEST(Keep, IsNeverTooMuchToLookThrough) {
    Keep keep;
    const auto owner = std::make_shared<const int>(0);
    std::size_t made = 0;
    auto get = [&](std::size_t i) {
        keep.begin(~std::uint64_t(0));
        return *keep.get<std::size_t>(owner, Hasher().value(i).finish(), [&](std::uint64_t&) {
            ++made;
            return std::make_shared<std::size_t>(i);
        });
    };
    for (std::size_t i = 0; i < 2 * Keep::kMostThings; ++i) {
        EXPECT_EQ(get(0), 0u);  // again and again
        EXPECT_EQ(get(i), i);
    }
    EXPECT_EQ(made, 2 * Keep::kMostThings);
    get(1);
    EXPECT_EQ(made, 2 * Keep::kMostThings + 1);
}
