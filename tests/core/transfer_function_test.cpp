// Transfer functions: closed forms of values, integrals and bounds.
#include "core/data/transfer_function.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace voxloom {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

TransferFunction1D ramp() {  // tau = v on [0, 10], green
    return {{{0, {0, 0, 0, 0}}, {10, {0, 10, 0, 10}}}};
}
TransferFunction1D box(double lo, double hi, double tau) {
    Emission on(tau, 0, 0, tau), off(0.0);
    return {{{lo, off}, {lo, on}, {hi, on}, {hi, off}}};
}

TEST(Extinction, AgreesWithItsDefinitionAndComesBack) {
    for (double opacity : {1e-12, 1e-3, 0.1, 0.5, 0.9, 0.999})
        for (double d : {1e-9, 1.0, 1e9}) {
            EXPECT_NEAR(extinction_of(opacity, d) * d, -std::log1p(-opacity), 1e-14);
            EXPECT_NEAR(opacity_of(extinction_of(opacity, d), d), opacity, 1e-15 + 1e-14 * opacity);
        }
}

TEST(Extinction, KeepsTheDigitsOfTinyOpacities) {
    EXPECT_NEAR(extinction_of(1e-18, 1) / 1e-18, 1, 1e-12);
    EXPECT_NEAR(opacity_of(1e-18, 1) / 1e-18, 1, 1e-12);
}

TEST(Extinction, OfFullOpacityIsFiniteAndHidesAllButThe24thBit) {
    double tau = extinction_of(1, 2);
    EXPECT_TRUE(std::isfinite(tau));
    EXPECT_DOUBLE_EQ(tau, 24 * std::log(2.0) / 2);
    EXPECT_EQ(extinction_of(7, 2), tau);
    EXPECT_EQ(extinction_of(1, 1e-300), kMaxExtinction);
}

TEST(Extinction, OfNothingIsZero) {
    EXPECT_EQ(extinction_of(0, 1), 0);
    EXPECT_EQ(extinction_of(-1, 1), 0);
    EXPECT_EQ(extinction_of(kNaN, 1), 0);
    EXPECT_EQ(opacity_of(0, 1), 0);
    EXPECT_EQ(opacity_of(kNaN, 1), 0);
    EXPECT_EQ(opacity_of(kInf, 0), 0);
    EXPECT_EQ(opacity_of(kInf, 1), 1);
}

TEST(Emission, KeepsItsColour) {
    glm::dvec3 c(0.1, 0.5, 0.9);
    EXPECT_LT(glm::length(color_of(emission_of(c, 0.3, 2)) - c), 1e-15);
    EXPECT_LT(glm::length(color_of(emission_of(c, 1, 1e-300)) - c), 1e-15);
    EXPECT_EQ(color_of(Emission(0.0)), glm::dvec3(1.0));
}

TEST(TransferFunction1D, IsLinearBetweenPointsAndHeldOutside) {
    EXPECT_EQ(ramp().at(-5), Emission(0.0));
    EXPECT_EQ(ramp().at(2.5), Emission(0, 2.5, 0, 2.5));
    EXPECT_EQ(ramp().at(10), Emission(0, 10, 0, 10));
    EXPECT_EQ(ramp().at(kInf).a, 10);
    EXPECT_EQ(ramp().at(-kInf).a, 0);
    EXPECT_EQ(ramp().at(kNaN), Emission(0.0));
}

TEST(TransferFunction1D, TakesTheLaterPointAtAStep) {
    TransferFunction1D f = box(2, 3, 5);
    EXPECT_EQ(f.at(std::nextafter(2, 0)).a, 0);
    EXPECT_EQ(f.at(2).a, 5);
    EXPECT_EQ(f.at(std::nextafter(3, 0)).a, 5);
    EXPECT_EQ(f.at(3).a, 0);
}

TEST(TransferFunction1D, OfOnePointIsConstant) {
    TransferFunction1D f{{{4, {1, 2, 3, 4}}}};
    for (double v : {-kInf, 0.0, 4.0, 9.0, kInf}) EXPECT_EQ(f.at(v), Emission(1, 2, 3, 4));
    EXPECT_EQ(f.integral(2, 5), 3.0 * Emission(1, 2, 3, 4));
    EXPECT_EQ(f.max_extinction(-1, 1), 4);
}

TEST(TransferFunction1D, SpansTheWholeOfDouble) {
    double big = std::numeric_limits<double>::max();
    TransferFunction1D f{{{-big, Emission(0.0)}, {big, Emission(2.0)}}};
    EXPECT_EQ(f.at(0).a, 1);
    EXPECT_EQ(f.at(big / 2).a, 1.5);
}

TEST(TransferFunction1D, IntegratesRampsAndBoxesExactly) {
    EXPECT_DOUBLE_EQ(ramp().integral(2, 6).a, 16);
    EXPECT_DOUBLE_EQ(ramp().integral(-3, 4).g, 8);
    EXPECT_DOUBLE_EQ(ramp().integral(-3, -1).a, 0);
    EXPECT_DOUBLE_EQ(ramp().integral(8, 12).a, 18 + 20);
    EXPECT_DOUBLE_EQ(ramp().integral(11, 12).a, 10);
    EXPECT_DOUBLE_EQ(box(2, 3, 5).integral(0, 9).r, 5);
    EXPECT_DOUBLE_EQ(box(2, 3, 5).integral(2.5, 2.75).r, 1.25);
    EXPECT_EQ(ramp().integral(4, 4), Emission(0.0));
}

TEST(TransferFunction1D, ConservesThePeakThatNoSampleMeets) {
    for (double width : {1e-3, 1e-6, 1e-9}) {
        TransferFunction1D f{{{0.3 - width, Emission(0.0)}, {0.3, Emission(1 / width)},
                              {0.3 + width, Emission(0.0)}}};
        EXPECT_NEAR(f.integral(0, 1).a, 1, 1e-6);
        // Whatever the bins, their shares add up to the whole.
        double sum = 0;
        for (int i = 0; i < 7; ++i) sum += f.integral(i / 7.0, (i + 1) / 7.0).a;
        EXPECT_NEAR(sum, f.integral(0, 1).a, 1e-9);
    }
}

TEST(TransferFunction1D, StaysFiniteWhereItIsOpaque) {
    TransferFunction1D f{{{0, emission_of(glm::dvec3(1.0), 1, 1e-300)},
                          {1, emission_of(glm::dvec3(1.0), 1, 1e-300)}}};
    EXPECT_EQ(f.integral(0, 1).a, kMaxExtinction);
    EXPECT_EQ(opacity_of(f.at(0.5).a, 1), 1);
}

TEST(TransferFunction1D, BoundsItselfExactlyAtSteps) {
    TransferFunction1D f = box(2, 3, 5);
    EXPECT_EQ(f.max_extinction(0, 1.999), 0);
    EXPECT_EQ(f.max_extinction(0, 2), 5);      // the step's upper end is met at 2
    EXPECT_EQ(f.max_extinction(2.5, 3), 5);
    EXPECT_EQ(f.max_extinction(3, 3), 0);      // at 3 the lower end holds
    EXPECT_EQ(f.max_extinction(3, 9), 0);
    EXPECT_EQ(f.max_extinction(9, 0), 0);
    EXPECT_EQ(f.max_extinction(kNaN, kNaN), 0);
    // A step down after a rise: the value just below 4 counts although 4 itself is dark.
    TransferFunction1D saw{{{0, Emission(0.0)}, {4, Emission(8.0)}, {4, Emission(0.0)}}};
    EXPECT_EQ(saw.max_extinction(0, 4), 8);
    EXPECT_EQ(saw.max_extinction(1, 2), 4);
    EXPECT_EQ(saw.max_extinction(4, 9), 0);
    // A point between two others of its value is never seen.
    TransferFunction1D three{{{1, Emission(0.0)}, {1, Emission(9.0)}, {1, Emission(1.0)}}};
    EXPECT_EQ(three.max_extinction(0, 2), 1);
}

TEST(TransferFunction1D, NeverExceedsItsBound) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (int round = 0; round < 200; ++round) {
        TransferFunction1D f;
        double value = 0;
        for (int i = 0; i < 6; ++i) {
            value += uniform(random) < 0.3 ? 0 : uniform(random);
            f.points.push_back({value, Emission(uniform(random))});
        }
        double a = uniform(random) * 4, b = a + uniform(random) * 2, seen = 0;
        for (int i = 0; i <= 500; ++i) seen = std::max(seen, f.at(a + (b - a) * i / 500).a);
        EXPECT_LE(seen, f.max_extinction(a, b) + 1e-15);
    }
}

// tau = v * g on the nodes of a 3 x 3 grid over [0, 2] x [0, 4]; bilinear, so exact everywhere.
TransferFunction2D product() {
    TransferFunction2D f{{0, 2}, {0, 4}, {3, 3}, {}};
    for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 3; ++i) f.samples.push_back(Emission(double(i) * 2 * j));
    return f;
}

TEST(TransferFunction2D, IsBilinearAndClamped) {
    TransferFunction2D f = product();
    EXPECT_DOUBLE_EQ(f.at(0.7, 1.3).a, 0.7 * 1.3);
    EXPECT_DOUBLE_EQ(f.at(1.9, 3.9).a, 1.9 * 3.9);
    EXPECT_EQ(f.at(2, 4).a, 8);
    EXPECT_EQ(f.at(99, 99).a, 8);
    EXPECT_EQ(f.at(-1, 3).a, 0);
    EXPECT_EQ(f.at(kInf, kInf).a, 8);
    EXPECT_EQ(f.at(kNaN, 1).a, 0);
    EXPECT_EQ(f.at(1, kNaN).a, 0);
}

TEST(TransferFunction2D, BoundsItselfOverAllGradients) {
    TransferFunction2D f = product();
    EXPECT_DOUBLE_EQ(f.max_extinction(0.2, 0.7), 0.7 * 4);
    EXPECT_DOUBLE_EQ(f.max_extinction(0.2, 9), 8);
    EXPECT_EQ(f.max_extinction(-3, 0), 0);
    EXPECT_EQ(f.max_extinction(1, 0), 0);
    // A single bright node inside the interval.
    TransferFunction2D peak{{0, 4}, {0, 1}, {5, 2}, std::vector<Emission>(10, Emission(0.0))};
    peak.samples[2] = Emission(3.0);
    EXPECT_EQ(peak.max_extinction(1.5, 2.5), 3);
    EXPECT_EQ(peak.max_extinction(0, 1), 0);
    EXPECT_EQ(peak.max_extinction(3, 4), 0);
    EXPECT_DOUBLE_EQ(peak.max_extinction(2.5, 4), 1.5);
}

TEST(TransferFunction2D, OfNoExtentIsItsFirstColumn) {
    TransferFunction2D f = product();
    f.value = {5, 5};
    EXPECT_EQ(f.at(5, 4).a, 0);
    EXPECT_EQ(f.at(7, 4).a, 0);
}

TEST(TransferFunction, IsClassifiedByTwoDimensionsWhereThereAreTwo) {
    TransferFunction f;
    f.one = box(0, 1, 9);
    EXPECT_EQ(f.max_extinction(0, 1), 9);
    f.two = std::make_shared<TransferFunction2D>(product());
    EXPECT_EQ(f.max_extinction(0, 1), 4);
}

}  // namespace
}  // namespace voxloom
