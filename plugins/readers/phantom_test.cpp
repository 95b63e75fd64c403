#include "plugins/readers/phantom.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>

#include "plugins/readers/phantom_field.h"
#include "plugins/readers/phantom_random.h"
#include "tests/support/run_node.h"
#include "tests/support/volumes.h"

namespace voxloom {
namespace {

using testing::run_node;

const std::vector<std::string> kKinds = {
    "marschner-lobb", "ramp", "sphere-distance", "constant",    "impulse",
    "checkerboard",   "step", "shells",          "plane-waves", "ct-head"};
// A grid that is not a cube, not isotropic and not along the world's axes.
const std::string kSkewGrid =
    "dims: [13, 11, 7], spacing: [0.5, 1, 2], origin: [10, -20, 5], rotation: [1, 2, -1, 40], fit: "
    "outside";

const Registry& phantoms() {
    static const Registry registry = [] {
        Registry r;
        add_phantoms(r);
        return r;
    }();
    return registry;
}

VolumePtr phantom(const std::string& params) {
    return run_node(phantoms(), "readers.phantom", "{" + params + "}").volume();
}

std::vector<std::byte> bytes_of_box(const Volume& volume, const Box& box) {
    std::vector<std::byte> out(box.voxels() * volume.desc().voxel_bytes());
    volume.read(box, out, {});
    return out;
}

template <class T>
std::vector<T> voxels(const Volume& volume) {
    EXPECT_EQ(volume.desc().type, scalar_type_of<T>);
    std::vector<T> out(volume.desc().voxels());
    volume.read(Box::of(volume.desc().dims), std::as_writable_bytes(std::span(out)), {});
    return out;
}

glm::dvec3 to_world(const VolumeDesc& desc, glm::dvec3 i) {
    return glm::dvec3(desc.index_to_world * glm::dvec4(i, 1.0));
}

TEST(PhantomMath, CosineOfTurnsAgreesWithTheLibrary) {
    SeededNumbers random(3);
    for (int i = 0; i < 20000; ++i) {
        double t = 200 * (random.next() - 0.5);
        double reduced = t - std::nearbyint(t);
        ASSERT_NEAR(cos_turns(t), std::cos(6.283185307179586 * reduced), 2e-15) << t;
    }
    EXPECT_EQ(cos_turns(0), 1.0);
    EXPECT_NEAR(cos_turns(0.5), -1.0, 1e-15);
}

TEST(Phantom, VoxelsAreTheClosedFormOnARotatedAnisotropicGrid) {
    for (const std::string& kind : kKinds) {
        VolumePtr v =
            phantom("kind: " + kind + ", type: f64, direction: [1, -2, 0.5], " + kSkewGrid);
        ASSERT_NE(v->closed_form(), nullptr) << kind;
        std::vector<double> values = voxels<double>(*v);
        const Index3 n = v->desc().dims;
        for (std::int64_t z = 0, at = 0; z < n.z; ++z)
            for (std::int64_t y = 0; y < n.y; ++y)
                for (std::int64_t x = 0; x < n.x; ++x, ++at) {
                    double exact = v->closed_form()->value(to_world(v->desc(), {x, y, z}));
                    // Positions go through a matrix and its inverse; the head's edges are steep.
                    ASSERT_NEAR(values[std::size_t(at)], exact, kind == "ct-head" ? 1e-7 : 1e-10)
                        << kind << " at " << x << " " << y << " " << z;
                }
    }
}

TEST(Phantom, GradientsAgreeWithFiniteDifferencesOfTheClosedForm) {
    for (const std::string& kind : kKinds) {
        VolumePtr v = phantom(
            "kind: " + kind +
            ", type: f32, direction: [1, -2, 0.5], low: -3, high: 5, edge: 0.1, " + kSkewGrid);
        const ClosedForm& f = *v->closed_form();
        SeededNumbers random(11);
        double largest = 0;
        int compared = 0;
        for (int i = 0; i < 400; ++i) {
            glm::dvec3 at =
                to_world(v->desc(), v->desc().extent() *
                                        glm::dvec3(random.next(), random.next(), random.next()));
            const glm::dvec3 g = f.gradient(at);
            auto differences = [&](double h) {
                glm::dvec3 d;
                for (int a = 0; a < 3; ++a) {
                    glm::dvec3 step(0.0);
                    step[a] = h;
                    d[a] = (f.value(at + step) - f.value(at - step)) / (2 * h);
                }
                return d;
            };
            const glm::dvec3 fine = differences(1e-5), coarse = differences(2e-5);
            // Kinks (the hat's corners, the step, the second derivative at the edges of the head)
            // show as differences that do not agree among themselves.
            if (glm::length(fine - coarse) > 1e-6 * (1 + glm::length(fine))) continue;
            ++compared;
            largest = std::max(largest, glm::length(g));
            ASSERT_LT(glm::length(g - fine), 1e-5 * (1 + glm::length(g))) << kind;
        }
        EXPECT_GT(compared, 300) << kind;
        if (kind != "constant" && kind != "step" && kind != "impulse") {
            EXPECT_GT(largest, 0.01) << kind;
        }
    }
}

TEST(Phantom, ImpulseHasTheSlopeOfTheTrilinearHat) {
    VolumePtr v =
        phantom("kind: impulse, type: f64, dims: [9, 9, 9], spacing: [2, 1, 1], at: [4, 4, 4]");
    glm::dvec3 g = v->closed_form()->gradient({8.5, 4.25, 4});  // index (4.25, 4.25, 4)
    EXPECT_NEAR(g.x, -0.75 / 2, 1e-12);
    EXPECT_NEAR(g.y, -0.75, 1e-12);
    EXPECT_NEAR(v->closed_form()->value({8.5, 4.25, 4}), 0.5625, 1e-12);
}

TEST(Phantom, MarschnerLobbIsThePublishedFormula) {
    VolumePtr v = phantom("kind: marschner-lobb, type: f64, dims: [21, 21, 21]");
    const double pi = std::acos(-1.0);
    for (Index3 i : {Index3(0, 0, 0), Index3(10, 10, 10), Index3(3, 17, 6), Index3(20, 20, 20)}) {
        glm::dvec3 p = glm::dvec3(i) / 10.0 - 1.0;
        double rho = std::cos(2 * pi * 6 * std::cos(pi * std::hypot(p.x, p.y) / 2));
        double expected = (1 - std::sin(pi * p.z / 2) + 0.25 * (1 + rho)) / (2 * 1.25);
        EXPECT_NEAR(testing::voxel(*v, i), expected, 1e-13);
    }
}

TEST(Phantom, AnyRegionOnAnyNumberOfThreadsHoldsTheSameBytes) {
    for (const std::string& kind : kKinds) {
        const std::string params =
            "kind: " + kind +
            ", type: f32, dims: [61, 47, 53], edge: 0.05, "
            "noise: 0.5, special: inf, special_share: 0.01, low: -1, high: 2";
        VolumePtr v = phantom(params);
        const Box all = Box::of(v->desc().dims);
        std::vector<std::byte> whole = bytes_of_box(*v, all);
        {
            tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
            EXPECT_EQ(bytes_of_box(*v, all), whole) << kind;
        }
        SeededNumbers random(5);
        for (int i = 0; i < 20; ++i) {
            Box box;
            for (int a = 0; a < 3; ++a) {
                box.lo[a] = std::int64_t(random.next() * double(all.hi[a]));
                box.hi[a] =
                    box.lo[a] + 1 + std::int64_t(random.next() * double(all.hi[a] - box.lo[a] - 1));
            }
            std::vector<std::byte> part(box.voxels() * 4);
            copy_box(box, whole.data(), all, part.data(), box, 4);
            ASSERT_EQ(bytes_of_box(*v, box), part) << kind;
        }
    }
}

TEST(Phantom, CheckerboardAndStepReachTheLimitsOfEveryIntegerType) {
    for (const char* name : {"u8", "i8", "u16", "i16", "u32", "i32"})
        for (const char* kind : {"checkerboard", "step"}) {
            VolumePtr v =
                phantom(std::string("kind: ") + kind + ", type: " + name + ", dims: [4, 3, 2]");
            auto [lo, hi] = limits_of(v->desc().type);
            for (std::int64_t x = 0; x < 4; ++x) {
                bool high = kind[0] == 's' ? x >= 2 : x % 2 == 0;
                EXPECT_EQ(testing::voxel(*v, {x, 0, 0}), high ? hi : lo) << kind << " " << name;
                if (kind[0] == 'c') {
                    EXPECT_EQ(testing::voxel(*v, {x, 1, 0}), high ? lo : hi);
                    EXPECT_EQ(testing::voxel(*v, {x, 1, 1}), high ? hi : lo);
                }
            }
        }
}

TEST(Phantom, ImpulseIsOneVoxel) {
    VolumePtr v =
        phantom("kind: impulse, type: u16, dims: [7, 5, 3], at: [6, -1, 0], low: 10, high: 500");
    std::vector<std::uint16_t> all = voxels<std::uint16_t>(*v);
    EXPECT_EQ(std::count(all.begin(), all.end(), 500), 1);
    EXPECT_EQ(std::count(all.begin(), all.end(), 10), 104);
    EXPECT_EQ(testing::voxel(*v, {6, 2, 0}), 500);
    EXPECT_THROW(phantom("kind: impulse, at: [64, 0, 0]"), Error);
}

TEST(Phantom, SphereDistanceIsATrueDistanceInTheWorld) {
    VolumePtr v = phantom(
        "kind: sphere-distance, type: f64, dims: [33, 17, 9], spacing: [1, 2, 5], "
        "origin: [3, 4, 5], rotation: [0, 1, 1, 30], radius: 0.5");
    const ClosedForm& f = *v->closed_form();
    glm::dvec3 centre = to_world(v->desc(), v->desc().extent() * 0.5);
    EXPECT_NEAR(f.value(centre), -8, 1e-9);  // half of the smallest half extent, 16
    for (Index3 i : {Index3(0, 0, 0), Index3(30, 2, 1), Index3(16, 8, 8)}) {
        glm::dvec3 at = to_world(v->desc(), glm::dvec3(i));
        EXPECT_NEAR(f.value(at), glm::length(at - centre) - 8, 1e-9);
        EXPECT_NEAR(glm::length(f.gradient(at)), 1, 1e-9);
        EXPECT_NEAR(testing::voxel(*v, i), f.value(at), 1e-9);
    }
}

TEST(Phantom, RampIsLinearAndCoversTheRangeInTheGrid) {
    VolumePtr v = phantom("kind: ramp, type: u16, dims: [65, 3, 3], direction: [1, 0, 0]");
    EXPECT_EQ(testing::voxel(*v, {0, 0, 0}), 0);
    EXPECT_EQ(testing::voxel(*v, {64, 2, 1}), 65535);
    EXPECT_EQ(testing::voxel(*v, {32, 1, 1}), 32768);  // 32767.5, to even
    EXPECT_THROW(phantom("kind: ramp, direction: [0, 0, 0]"), Error);
}

TEST(Phantom, PlaneWavesKeepTheirBandLimit) {
    VolumePtr v = phantom("kind: plane-waves, type: f64, dims: [40, 40, 40], band: 0.25, waves: 8");
    // Bernstein: a function bounded by 1 whose frequencies are at most W has slopes of at most W.
    const double limit = 0.25 * std::acos(-1.0);
    SeededNumbers random(1);
    for (int i = 0; i < 500; ++i) {
        glm::dvec3 at = 39.0 * glm::dvec3(random.next(), random.next(), random.next());
        EXPECT_LE(glm::length(v->closed_form()->gradient(at)), limit);
        EXPECT_LE(std::abs(v->closed_form()->value(at)), 1);
    }
    VolumePtr other =
        phantom("kind: plane-waves, type: f64, dims: [40, 40, 40], band: 0.25, waves: 8, seed: 2");
    EXPECT_NE(testing::voxel(*v, {7, 8, 9}), testing::voxel(*other, {7, 8, 9}));
}

TEST(Phantom, ShellsDependOnTheRadiusAlone) {
    VolumePtr v = phantom("kind: shells, type: f64, dims: [31, 31, 31], shells: 3");
    EXPECT_NEAR(testing::voxel(*v, {15, 15, 15}), 1, 1e-14);
    EXPECT_NEAR(testing::voxel(*v, {30, 15, 15}), 1, 1e-13);
    EXPECT_NEAR(testing::voxel(*v, {15, 11, 18}), testing::voxel(*v, {18, 15, 19}), 1e-14);
    EXPECT_NEAR(testing::voxel(*v, {20, 15, 15}), 1, 1e-13);  // one shell out
}

TEST(Phantom, TheHeadHasAirSkinBoneAndBrain) {
    VolumePtr v = phantom("kind: ct-head, type: i16, dims: [101, 101, 101], edge: 0.004");
    EXPECT_EQ(testing::voxel(*v, {0, 0, 100}), -1000);
    EXPECT_EQ(testing::voxel(*v, {50, 52, 77}), 5);   // fissure between the halves
    EXPECT_EQ(testing::voxel(*v, {64, 52, 62}), 28);  // white matter
    std::set<double> on_the_way;                      // from the crown downwards
    for (std::int64_t z = 100; z > 50; --z) on_the_way.insert(testing::voxel(*v, {64, 52, z}));
    EXPECT_TRUE(on_the_way.contains(1200)) << "no bone over the brain";
    EXPECT_TRUE(on_the_way.contains(450)) << "no diploe in the bone";
    VolumePtr scanner = phantom("kind: ct-head, type: u16, dims: [101, 101, 101], edge: 0.004");
    EXPECT_EQ(scanner->desc().significant_bits, 12);
    std::vector<std::int16_t> hounsfield = voxels<std::int16_t>(*v);
    std::vector<std::uint16_t> bits = voxels<std::uint16_t>(*scanner);
    for (std::size_t i = 0; i < bits.size(); ++i) {
        ASSERT_NEAR(bits[i], hounsfield[i] + 1024, 1);  // halves round to even on either side
        ASSERT_LE(bits[i], 4095);
    }
}

TEST(Phantom, NoiseHasTheStandardDeviationAskedFor) {
    VolumePtr v = phantom("kind: constant, value: 100, type: f64, dims: [50, 50, 40], noise: 7");
    double sum = 0, squares = 0;
    for (double x : voxels<double>(*v)) {
        sum += x - 100;
        squares += (x - 100) * (x - 100);
    }
    EXPECT_NEAR(sum / 1e5, 0, 0.1);
    EXPECT_NEAR(std::sqrt(squares / 1e5), 7, 0.07);
    EXPECT_EQ(v->closed_form(), nullptr);
}

TEST(Phantom, SpecialValuesAreSprinkledOverFloatsOnly) {
    auto share = [](const char* kind, const char* type, auto is) {
        VolumePtr v =
            phantom(std::string("kind: ramp, dims: [40, 50, 50], special_share: 0.05, special: ") +
                    kind + ", type: " + type);
        double count = 0;
        if (v->desc().type == ScalarType::f32)
            for (float x : voxels<float>(*v))
                count += is(double(x), double(std::numeric_limits<float>::min()));
        else
            for (double x : voxels<double>(*v)) count += is(x, std::numeric_limits<double>::min());
        return count / 1e5;
    };
    for (const char* type : {"f32", "f64"}) {
        EXPECT_NEAR(share("nan", type, [](double x, double) { return std::isnan(x); }), 0.05,
                    0.005);
        EXPECT_NEAR(share("inf", type, [](double x, double) { return std::isinf(x); }), 0.05,
                    0.005);
        EXPECT_NEAR(share("denormal", type,
                          [](double x, double tiny) { return x != 0 && std::abs(x) < tiny; }),
                    0.05, 0.005);
    }
    EXPECT_THROW(phantom("special: nan, type: u8"), Error);
}

TEST(Phantom, MaskMarksTheShareAskedFor) {
    VolumePtr v = phantom("kind: ramp, dims: [50, 50, 40], masked_share: 0.25");
    ASSERT_TRUE(v->desc().has_mask);
    std::vector<std::uint8_t> mask(100000), part(100);
    v->read_mask(Box::of(v->desc().dims), mask);
    EXPECT_NEAR(double(std::count(mask.begin(), mask.end(), 1)) / 1e5, 0.75, 0.01);
    v->read_mask({{0, 7, 3}, {50, 9, 4}}, part);
    EXPECT_TRUE(std::equal(part.begin(), part.end(), mask.begin() + 3 * 2500 + 7 * 50));
}

TEST(Phantom, EveryKindTypeAndDegenerateSizeReads) {
    for (const std::string& kind : kKinds)
        for (const char* dims :
             {"[0, 5, 5]", "[0, 0, 0]", "[1, 1, 1]", "[1, 7, 5]", "[17, 1, 1]", "[2, 3, 1]"})
            for (int t = 0; t < kScalarTypes; ++t) {
                VolumePtr v = phantom("kind: " + kind + ", dims: " + dims +
                                      ", type: " + std::string(name_of(ScalarType(t))));
                std::vector<std::byte> bytes = bytes_of_box(*v, Box::of(v->desc().dims));
                with_type(v->desc().type, [&](auto type) {
                    using T = decltype(type);
                    for (std::size_t i = 0; i < bytes.size() / sizeof(T); ++i) {
                        T x;
                        std::memcpy(&x, bytes.data() + i * sizeof(T), sizeof(T));
                        ASSERT_TRUE(std::isfinite(double(x))) << kind << dims;
                    }
                });
            }
}

TEST(Phantom, TenGigabytesAreReadByRegion) {
    VolumePtr v = phantom("kind: ct-head, type: u16, dims: [2048, 1216, 1877], fit: stretch");
    EXPECT_EQ(v->desc().dense_bytes(), 9348841472u);
    EXPECT_EQ(v->resident_bytes(), 0u);
    std::vector<std::byte> corner = bytes_of_box(*v, {{2016, 1184, 1845}, {2048, 1216, 1877}});
    EXPECT_EQ(corner[0], std::byte(24));  // air
    EXPECT_THROW(phantom("dims: [1000000000, 1000000000, 1000000000]"), Error);
}

TEST(Phantom, VeryLongRowsAreTheSameInParts) {
    VolumePtr v =
        phantom("kind: plane-waves, type: f64, dims: [200003, 2, 1], waves: 3, noise: 0.1");
    std::vector<double> all = voxels<double>(*v);
    for (std::int64_t x : {0, 65535, 65536, 131072, 200002}) {
        EXPECT_EQ(testing::voxel(*v, {x, 1, 0}), all[std::size_t(200003 + x)]);
    }
}

TEST(Phantom, ValuesThatTheTypeCannotHoldAreRefused) {
    EXPECT_THROW(phantom("kind: constant, value: 1e39, type: f32"), Error);
    EXPECT_THROW(phantom("kind: ramp, low: -1e60, high: 1e60, type: f32"), Error);
    EXPECT_EQ(testing::voxel(*phantom("kind: constant, value: 1e39, type: f64"), {0, 0, 0}), 1e39);
    EXPECT_EQ(testing::voxel(*phantom("kind: constant, value: 1e39, type: u8"), {0, 0, 0}), 255);
}

TEST(Phantom, ReadingStopsWhenAsked) {
    VolumePtr v = phantom("kind: shells, dims: [512, 512, 512]");
    std::stop_source stop;
    stop.request_stop();
    std::vector<std::byte> out(512 * 512 * 64);
    EXPECT_THROW(v->read({{0, 0, 0}, {512, 512, 64}}, out, stop.get_token()), Cancelled);
}

SeriesPtr series(const std::string& params) {
    return run_node(phantoms(), "readers.phantom-series", "{" + params + "}")
        .output<Series>("series");
}

VolumePtr step_of(const SeriesPtr& s, std::size_t i) {
    return std::get<VolumePtr>(s->fetch(i));
}

TEST(PhantomSeries, LinearInTimeIsExactBetweenUnevenSteps) {
    SeriesPtr s =
        series("kind: linear-in-time, type: f64, dims: [9, 8, 7], times: [-1, 0.5, 4, 4.25]");
    auto first = voxels<double>(*step_of(s, 0)), last = voxels<double>(*step_of(s, 3));
    for (std::size_t k : {1u, 2u}) {
        double t = (s->desc().times[k] + 1) / 5.25;
        auto now = voxels<double>(*step_of(s, k));
        for (std::size_t i = 0; i < now.size(); ++i)
            ASSERT_NEAR(now[i], (1 - t) * first[i] + t * last[i], 1e-14);
    }
    EXPECT_NE(first, last);
}

TEST(PhantomSeries, UnevenTimesIncreaseAndDependOnTheSeed) {
    SeriesPtr s = series("steps: 200, unevenness: 0.99, time_step: 0.1");
    std::set<double> gaps;
    for (std::size_t i = 1; i < 200; ++i) {
        ASSERT_LT(s->desc().times[i - 1], s->desc().times[i]);
        gaps.insert(s->desc().times[i] - s->desc().times[i - 1]);
    }
    EXPECT_GT(gaps.size(), 150u);
    EXPECT_NE(series("steps: 200, unevenness: 0.99, time_step: 0.1, seed: 9")->desc().times,
              s->desc().times);
    EXPECT_THROW(series("times: [1, 1]"), Error);
    EXPECT_THROW(s->fetch(200), Error);
}

TEST(PhantomSeries, EachKindMovesAndComesBackAfterItsPeriod) {
    for (const char* kind : {"moving-sphere", "rotating-waves", "pulsating-shells"}) {
        SeriesPtr s = series(std::string("kind: ") + kind +
                             ", type: f64, dims: [12, 12, 12], period: 4, steps: 5");
        auto at0 = voxels<double>(*step_of(s, 0)), at1 = voxels<double>(*step_of(s, 1)),
             at4 = voxels<double>(*step_of(s, 4));
        EXPECT_NE(at0, at1) << kind;
        for (std::size_t i = 0; i < at0.size(); ++i) ASSERT_NEAR(at0[i], at4[i], 1e-12) << kind;
        VolumePtr v = step_of(s, 1);
        EXPECT_NEAR(testing::voxel(*v, {3, 4, 5}), v->closed_form()->value({3, 4, 5}), 1e-12);
    }
}

TEST(PhantomSeries, TheMovingSphereStaysWithinTheIntegerRangeAtAllTimes) {
    SeriesPtr s = series("kind: moving-sphere, type: u8, dims: [20, 20, 20]");
    for (std::size_t k = 0; k < 10; ++k) {
        VolumePtr v = step_of(s, k);
        for (Index3 i : {Index3(0, 0, 0), Index3(19, 19, 19), Index3(19, 0, 0)})
            EXPECT_NEAR(testing::voxel(*v, i), v->closed_form()->value(glm::dvec3(i)), 0.5);
    }
}

}  // namespace
}  // namespace voxloom
