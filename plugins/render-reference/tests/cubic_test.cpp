#include "plugins/render-reference/cubic.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace voxloom::reference {
namespace {

TEST(Cubic, AlongALineEqualsTheTrilinearInterpolationOfTheCorners) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> any(-1, 1);
    for (int n = 0; n < 200; ++n) {
        std::array<double, 8> v;
        for (double& each : v) each = any(random);
        const glm::dvec3 u(any(random), any(random), any(random)),
            d(any(random), any(random), any(random));
        const Cubic f = trilinear_along(v, u, d);
        for (double x : {0.0, 0.3, 1.0}) {
            const glm::dvec3 p = u + x * d;
            double expected = 0;
            for (int i = 0; i < 8; ++i)
                expected += v[std::size_t(i)] * (i & 1 ? p.x : 1 - p.x) * (i & 2 ? p.y : 1 - p.y) *
                            (i & 4 ? p.z : 1 - p.z);
            EXPECT_NEAR(f(x), expected, 1e-13);
        }
    }
}

TEST(Cubic, OverAPartAndThroughFourValuesIsTheSameCurve) {
    const Cubic f{{0.5, -2, 3, 1.5}}, part = f.over(0.2, 0.7);
    for (double y : {0.0, 0.25, 1.0}) EXPECT_NEAR(part(y), f(0.2 + 0.5 * y), 1e-15);
    const Cubic again = cubic_through(f(0), f(1.0 / 3), f(2.0 / 3), f(1));
    for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(again.c[i], f.c[i], 1e-13);
}

TEST(Cubic, IsCutWhereItTurnsAndSolvedOnEachStretch) {
    // 16 x^3 - 24 x^2 + 9 x: turns at 1/4 (1) and 3/4 (0), and is 1/2 three times.
    const Cubic f{{0, 9, -24, 16}};
    std::vector<double> turns, halves;
    monotone_stretches(f, [&](double a, double b, double fa, double fb) {
        EXPECT_DOUBLE_EQ(fa, f(a));
        EXPECT_DOUBLE_EQ(fb, f(b));
        turns.push_back(b);
        if ((fa < 0.5) != (fb < 0.5)) halves.push_back(solve_monotone(f, a, b, 0.5));
    });
    ASSERT_EQ(turns.size(), 3u);
    EXPECT_NEAR(turns[0], 0.25, 1e-15);
    EXPECT_NEAR(turns[1], 0.75, 1e-15);
    ASSERT_EQ(halves.size(), 3u);
    for (double x : halves) EXPECT_NEAR(f(x), 0.5, 1e-14);
    EXPECT_NEAR(halves[1], 0.5, 1e-15);
}

TEST(Cubic, WithoutTurningPointsIsOneStretch) {
    for (const Cubic& f : {Cubic{{3, 0, 0, 0}}, Cubic{{1, 2, 0, 0}}, Cubic{{1, 1, 1, 1}},
                           Cubic{{0, 0, 1, 0}}, Cubic{{0, 0, 0, 1}}}) {
        double end = 0;
        int stretches = 0;
        monotone_stretches(f, [&](double a, double b, double, double) {
            EXPECT_EQ(a, end);
            end = b;
            ++stretches;
        });
        EXPECT_EQ(stretches, 1);
        EXPECT_EQ(end, 1.0);
    }
}

TEST(Cubic, QuadratureIsExactToItsDegree) {
    auto power = [](const auto& rule, int n) {
        double sum = 0;
        for (const Node& node : rule) sum += node.weight * std::pow(node.x, n);
        return sum;
    };
    for (int n = 0; n <= 3; ++n) EXPECT_NEAR(power(kGauss2, n), 1.0 / (n + 1), 1e-15);
    for (int n = 0; n <= 15; ++n) EXPECT_NEAR(power(kGauss8, n), 1.0 / (n + 1), 1e-15);
    for (int n = 0; n <= 22; ++n) EXPECT_NEAR(power(kKronrod15, n), 1.0 / (n + 1), 1e-15);
    EXPECT_GT(std::abs(power(kGauss2, 4) - 1.0 / 5), 1e-3);

    for (int n = 0; n <= 13; ++n) {
        double coarse = 0;
        for (const Node& node : kKronrod15) coarse += node.coarse * std::pow(node.x, n);
        EXPECT_NEAR(coarse, 1.0 / (n + 1), 1e-15);
    }
}

}  // namespace
}  // namespace voxloom::reference
