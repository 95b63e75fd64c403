#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/support/linked_plugin.h"
#include "tests/support/run_node.h"
#include "tests/support/volumes.h"

using namespace voxloom;
using namespace voxloom::testing;

namespace {

TransferPtr transfer(TransferFunction1D one, double reference = 1) {
    TransferFunction tf;
    tf.reference_length = reference;
    tf.one = std::move(one);
    return std::make_shared<TransferFunction>(tf);
}
TransferPtr constant_medium(double tau, glm::dvec3 c = {1, 1, 1}) {
    return transfer({{{0, Emission(c * tau, tau)}}});
}

NodeRun draw(const Value& source, TransferPtr tf, const Camera& camera, const std::string& params,
             const RunNodeOptions& options = {}) {
    NodeInputs inputs;
    inputs["source"] = {source};
    inputs["transfer"] = {tf};
    inputs["camera"] = {CameraPtr(std::make_shared<Camera>(camera))};
    return run_node(linked_plugin(), "slicer.render", params, inputs, options);
}

VolumePtr ramp(Index3 dims, ScalarType type = ScalarType::f32, glm::dvec3 spacing = glm::dvec3(1)) {
    return make_volume(dims, type, [](auto x, auto, auto) { return double(x); }, spacing);
}

Camera looking(glm::dvec3 from_direction, const VolumeDesc& desc, Camera::Projection projection,
               double distance = 3) {
    SamplingBox box = sampling_box(desc);
    glm::dvec3 middle(desc.index_to_world * glm::dvec4(0.5 * (box.lo + box.hi), 1));
    double size = glm::length(glm::dmat3(desc.index_to_world) * (box.hi - box.lo));
    Camera c;
    c.projection = projection;
    c.target = middle;
    c.eye = middle + glm::normalize(from_direction) * size * distance;
    c.up = {0.1, 0.9, 0.2};
    c.vertical_fov = 0.5;
    c.height = size * 1.1;
    return c;
}

// Length of a ray inside of a volume's box, in world units; t from near on.
double length_inside(const VolumeDesc& desc, const Camera& camera, const Ray& ray) {
    glm::dmat4 to_index = glm::inverse(desc.index_to_world);
    glm::dvec3 o(to_index * glm::dvec4(ray.origin, 1)), d(to_index * glm::dvec4(ray.direction, 0));
    SamplingBox box = sampling_box(desc);
    double lo = camera.near / glm::dot(ray.direction, camera.forward()), hi = 1e300;
    for (int a = 0; a < 3; ++a) {
        if (d[a] == 0) {
            if (o[a] < box.lo[a] || o[a] > box.hi[a]) return 0;
            continue;
        }
        double t0 = (box.lo[a] - o[a]) / d[a], t1 = (box.hi[a] - o[a]) / d[a];
        lo = std::max(lo, std::min(t0, t1));
        hi = std::min(hi, std::max(t0, t1));
    }
    return std::max(hi - lo, 0.0);
}


void expect_constant_medium(const VolumePtr& volume, const Camera& camera, double tau,
                            const std::string& more, const std::string& what) {
    ImagePtr image = draw(volume, constant_medium(tau), camera,
                          "{size: [40, 32], background: [0, 0, 0, 0], early_termination: 1" + more + "}")
                         .image();
    double worst = 0, brightest = 0;
    for (int y = 0; y < 32; ++y)
        for (int x = 0; x < 40; ++x) {
            Ray ray = camera.ray(x + 0.5, y + 0.5, 40, 32);
            double want = -std::expm1(-tau * length_inside(volume->desc(), camera, ray));
            worst = std::max(worst, std::abs(image->at(x, y).a - want));
            brightest = std::max(brightest, want);
        }
    EXPECT_GT(brightest, 0.1) << what;
    EXPECT_LT(worst, 1e-4) << what;
}

constexpr auto kPerspective = Camera::Projection::perspective;
constexpr auto kOrthographic = Camera::Projection::orthographic;

}  // namespace

TEST(SlicerRender, ConstantMediumHasItsOpacityFromEveryView) {
    VolumePtr volume = make_volume({17, 20, 13}, ScalarType::u8, [](auto, auto, auto) { return 100.0; });
    for (auto projection : {kPerspective, kOrthographic})
        for (glm::dvec3 from : {glm::dvec3(0, 0, 1), glm::dvec3(1, 0, 0), glm::dvec3(0, -1, 0),
                                glm::dvec3(1, 1, 0), glm::dvec3(1, 1, 1), glm::dvec3(-1, 2, 0.3)})
            for (const char* classification : {"pre", "post", "pre-integrated"})
                expect_constant_medium(volume, looking(from, volume->desc(), projection, 1.2), 0.05,
                                       std::string(", classification: ") + classification, classification);
}

TEST(SlicerRender, ConstantMediumFromInsideAndWithANearPlane) {
    VolumePtr volume = make_volume({24, 24, 24}, ScalarType::f32, [](auto, auto, auto) { return 1.0; });
    for (double near : {0.0, 2.5}) {
        Camera camera = looking({0.3, 1, 0.2}, volume->desc(), kPerspective, 0.05);
        camera.near = near;
        camera.vertical_fov = 1.6;
        expect_constant_medium(volume, camera, 0.1, "", "inside");
        camera.projection = kOrthographic;
        expect_constant_medium(volume, camera, 0.1, "", "inside, orthographic");
    }
}

TEST(SlicerRender, ConstantMediumInRotatedAnisotropicAndTinyOrHugeWorlds) {
    for (double unit : {1.0, 1e-9, 1e9}) {
        VolumeDesc desc;
        desc.dims = {20, 12, 9};
        desc.type = ScalarType::i16;
        glm::dmat4 m(1.0);
        m[0] = glm::dvec4(0.8, 0.6, 0, 0) * unit;
        m[1] = glm::dvec4(-0.6, 0.8, 0, 0) * 2.0 * unit;
        m[2] = glm::dvec4(0, 0, -1, 0) * 3.5 * unit;
        m[3] = glm::dvec4(glm::dvec3(100, -200, 50) * unit, 1);
        desc.index_to_world = m;
        Buffer voxels(desc.dense_bytes());
        std::ranges::fill(voxels.as<std::int16_t>(), std::int16_t(-700));
        auto volume = std::make_shared<DenseVolume>(desc, std::move(voxels));
        for (auto projection : {kPerspective, kOrthographic})
            expect_constant_medium(volume, looking({1, 0.7, 0.4}, desc, projection, 1.5), 0.03 / unit, "",
                                   "unit " + std::to_string(unit));
    }
}

TEST(SlicerRender, ZeroOpacityDrawsNothing) {
    VolumePtr volume = ramp({32, 32, 32});
    NodeRun run = draw(volume, transfer({{{0, Emission(0)}}}), looking({0, 0, 1}, volume->desc(), kPerspective),
                       "{size: [64, 64], background: [0.2, 0.4, 0.6, 0.5]}");
    EXPECT_EQ(run.counters["blocks drawn"], 0);
    EXPECT_EQ(run.counters.count("samples"), 0u);
    EXPECT_EQ(run.image()->at(3, 3), glm::vec4(0.1f, 0.2f, 0.3f, 0.5f));
}

// --- closed forms ------------------------------------------------------------------------------

TEST(SlicerRender, RampThroughABoxHasTheOpacityOfTheBox) {
    VolumePtr volume = ramp({33, 5, 5});
    Emission inside(glm::dvec4(1, 0.5, 0, 1) * 0.2), outside(0);
    TransferPtr tf = transfer({{{0, outside}, {8, outside}, {8, inside}, {24, inside}, {24, outside}, {32, outside}}});
    for (glm::dvec3 from : {glm::dvec3(1, 0, 0), glm::dvec3(-1, 0, 0)})
        for (double distance : {0.25, 1.0, 2.7}) {
            ImagePtr image = draw(volume, tf, looking(from, volume->desc(), kOrthographic),
                                  "{size: [16, 16], background: [0, 0, 0, 0], table_size: 257, early_termination: 1, "
                                  "slice_distance: " + std::to_string(distance) + "}").image();
            glm::vec4 c = image->at(8, 8);
            EXPECT_NEAR(c.a, -std::expm1(-0.2 * 16), 1e-3);
            EXPECT_NEAR(c.g, 0.5 * c.a, 1e-4);
        }
}

TEST(SlicerRender, PeakOnARampDoesNotDependOnTheSliceDistanceWithPreIntegration) {
    VolumePtr volume = ramp({33, 4, 4});
    Emission peak(glm::dvec4(1) * 20.0), none(0);
    TransferPtr tf = transfer({{{0, none}, {15.97, none}, {16, peak}, {16.03, none}, {32, none}}});
    const double want = -std::expm1(-20 * 0.03);
    Camera camera = looking({1, 0, 0}, volume->desc(), kOrthographic);
    camera.height = 4;
    auto alpha = [&](double distance, const std::string& classification) {
        return draw(volume, tf, camera, "{size: [8, 8], background: [0, 0, 0, 0], early_termination: 1, "
                    "classification: " + classification + ", slice_distance: " + std::to_string(distance) + "}")
            .image()->at(4, 4).a;
    };
    // The peak is half a bin of the table wide, and a slice stands in its middle.
    for (double distance : {0.01, 0.03, 0.12, 0.2, 0.7, 1.0, 1.9, 3.0, 7.7})
        EXPECT_NEAR(alpha(distance, "pre-integrated"), want, 1e-4 * want) << distance;
    // Without, the slices miss it, or meet it by luck.
    EXPECT_GT(std::abs(alpha(1.9, "post") - want), 0.1);
}

TEST(SlicerRender, EndlessExtinctionIsOpaqueWithoutNaN) {
    VolumePtr volume = ramp({16, 16, 16});
    for (const char* classification : {"pre", "post", "pre-integrated"}) {
        ImagePtr image = draw(volume, constant_medium(kMaxExtinction, {0.2, 0.4, 0.8}),
                              looking({1, 1, 1}, volume->desc(), kPerspective),
                              std::string("{size: [32, 32], background: [0, 0, 0, 0], classification: ") + classification + "}")
                             .image();
        for (glm::vec4 c : image->rgba32f())
            for (int i = 0; i < 4; ++i) ASSERT_TRUE(std::isfinite(c[i]));
        EXPECT_EQ(image->at(16, 16).a, 1.0f);
        EXPECT_NEAR(image->at(16, 16).b, 0.8, 1e-3);
    }
}

TEST(SlicerRender, ErrorFallsWithTheSquareOfTheSliceDistance) {
    VolumePtr volume = make_volume({24, 24, 24}, ScalarType::f32, [](auto x, auto y, auto z) {
        return 0.5 + 0.5 * std::sin(0.35 * double(x)) * std::cos(0.3 * double(y) + 0.25 * double(z));
    });
    TransferPtr tf = transfer({{{0, Emission(0)}, {1, Emission(0.3, 0.2, 0.1, 0.3)}}});
    Camera camera = looking({0.4, 0.3, 1}, volume->desc(), kPerspective);
    auto at = [&](double distance) {
        return draw(volume, tf, camera, "{size: [48, 48], early_termination: 1, slice_distance: " +
                                            std::to_string(distance) + "}").image();
    };
    ImagePtr truth = at(0.05);
    auto rmse = [&](double distance) {
        ImagePtr image = at(distance);
        double sum = 0;
        for (std::size_t i = 0; i < image->rgba32f().size(); ++i) {
            glm::vec4 d = image->rgba32f()[i] - truth->rgba32f()[i];
            sum += glm::dot(d, d);
        }
        return std::sqrt(sum / double(image->rgba32f().size()));
    };
    double coarse = rmse(2), middle = rmse(1), fine = rmse(0.5);
    EXPECT_GT(coarse / middle, 3);
    EXPECT_GT(middle / fine, 3);
}

// --- what must not change the picture ------------------------------------------------------------

namespace {

VolumePtr ball(ScalarType type = ScalarType::u8, Index3 dims = {41, 37, 35}) {
    return make_volume(dims, type, [dims](auto x, auto y, auto z) {
        double r = glm::length(glm::dvec3(x, y, z) - 0.5 * glm::dvec3(dims - Index3(1)));
        return std::max(0.0, 100 - 6 * std::abs(r - 11));
    });
}
TransferPtr soft_shell() {
    return transfer({{{30, Emission(0)}, {60, Emission(0.3, 0.1, 0.05, 0.3)}, {100, Emission(0.1, 0.2, 0.6, 0.7)}}});
}
double worst(const Image& a, const Image& b) {
    double d = 0;
    for (std::size_t i = 0; i < a.rgba32f().size(); ++i)
        for (int c = 0; c < 4; ++c) d = std::max(d, double(std::abs(a.rgba32f()[i][c] - b.rgba32f()[i][c])));
    return d;
}

}  // namespace

TEST(SlicerRender, SkippingChangesNothingWhateverTheBlocksAndTheView) {
    VolumePtr volume = ball();
    for (const char* more : {"", ", reconstruction: tricubic", ", compositing: isosurface, iso_value: 70",
                             ", slice_distance: 2.3", ", shading: true"})
        for (glm::dvec3 from : {glm::dvec3(0, 0, 1), glm::dvec3(1, 1, 1), glm::dvec3(-1, 0.2, 0.4)})
            for (double distance : {2.0, 0.2}) {
                Camera camera = looking(from, volume->desc(), kPerspective, distance);
                std::string common = std::string("size: [64, 48]") + more;
                NodeRun all = draw(volume, soft_shell(), camera, "{skipping: false, " + common + "}");
                for (int size : {2, 8, 30}) {
                    NodeRun some = draw(volume, soft_shell(), camera,
                                        "{block_size: " + std::to_string(size) + ", " + common + "}");
                    EXPECT_LT(worst(*all.image(), *some.image()), 1e-5) << common << " " << size;
                    EXPECT_LE(some.counters["samples"], all.counters["samples"] + 1e4);
                }
            }
}

TEST(SlicerRender, SkippingSkips) {
    VolumePtr volume = ball(ScalarType::u8, {96, 96, 96});
    Camera camera = looking({0, 0, 1}, volume->desc(), kPerspective);
    NodeRun all = draw(volume, soft_shell(), camera, "{size: [64, 64], skipping: false}");
    NodeRun some = draw(volume, soft_shell(), camera, "{size: [64, 64]}");
    EXPECT_GT(some.counters["blocks skipped (transparent)"], some.counters["blocks drawn"]);
    EXPECT_LT(some.counters["samples"], 0.5 * all.counters["samples"]);
}

TEST(SlicerRender, EarlyTerminationStaysBelowItsThreshold) {
    VolumePtr volume = make_volume({40, 40, 40}, ScalarType::u8, [](auto, auto, auto) { return 1.0; });
    Camera camera = looking({0.2, 0.1, 1}, volume->desc(), kPerspective);
    NodeRun exact = draw(volume, constant_medium(0.5), camera, "{size: [32, 32], early_termination: 1}");
    NodeRun early = draw(volume, constant_medium(0.5), camera, "{size: [32, 32], early_termination: 0.99}");
    EXPECT_LT(worst(*exact.image(), *early.image()), 0.0101);
    EXPECT_GT(early.counters["rays ended by opacity"], 0);
    EXPECT_LT(early.counters["samples"], 0.7 * exact.counters["samples"]);
}

TEST(SlicerRender, StoredGradientsAreThoseComputedOnTheFly) {
    VolumePtr volume = ball(ScalarType::f32);
    Camera camera = looking({0.5, 0.7, 1}, volume->desc(), kPerspective);
    for (const char* gradient : {"central", "sobel", "isotropic"})
        for (const char* more : {"shading: true", "gradient_modulation: [1, 6]"}) {
            std::string common = std::string("size: [48, 48], gradient: ") + gradient + ", " + more;
            ImagePtr stored = draw(volume, soft_shell(), camera, "{" + common + "}").image();
            ImagePtr fly = draw(volume, soft_shell(), camera, "{gradient_source: on-the-fly, " + common + "}").image();
            EXPECT_LT(worst(*stored, *fly), 2e-3) << common;
        }
}

TEST(SlicerRender, AHairsBreadthOfTurningDoesNotFlicker) {
    VolumePtr volume = ball();
    for (glm::dvec3 from : {glm::dvec3(0, 0, 1), glm::dvec3(1, 1, 0), glm::dvec3(1, 1, 1)})
        for (auto projection : {kPerspective, kOrthographic}) {
            ImagePtr a = draw(volume, soft_shell(), looking(from + glm::dvec3(1e-7, 0, -1e-7), volume->desc(), projection), "{size: [48, 48]}").image();
            ImagePtr b = draw(volume, soft_shell(), looking(from - glm::dvec3(1e-7, 0, -1e-7), volume->desc(), projection), "{size: [48, 48]}").image();
            EXPECT_LT(worst(*a, *b), 2e-4);
        }
}

TEST(SlicerRender, AllScalarTypesGiveOnePicture) {
    VolumePtr floats = ball(ScalarType::f64);
    VolumePtr rounded = make_volume(floats->desc().dims, ScalarType::f64, [&](auto x, auto y, auto z) {
        return std::nearbyint(voxel(*floats, {x, y, z}));
    });
    Camera camera = looking({0.5, 0.7, 1}, floats->desc(), kPerspective);
    ImagePtr want = draw(rounded, soft_shell(), camera, "{size: [48, 48], table_size: 1024}").image();
    for (int t = 0; t < kScalarTypes; ++t) {
        VolumePtr volume = make_volume(floats->desc().dims, ScalarType(t),
                                       [&](auto x, auto y, auto z) { return voxel(*rounded, {x, y, z}); });
        ImagePtr got = draw(volume, soft_shell(), camera, "{size: [48, 48], table_size: 1024}").image();
        EXPECT_LT(worst(*got, *want), 1e-4) << name_of(ScalarType(t));
    }
}

// --- hard cases ------------------------------------------------------------------------------------

TEST(SlicerRender, OneVoxelThinAndEmptyVolumes) {
    for (Index3 dims : {Index3(1, 1, 1), Index3(1, 9, 7), Index3(9, 1, 1), Index3(2, 2, 1)})
        expect_constant_medium(make_volume(dims, ScalarType::u16, [](auto, auto, auto) { return 3.0; }),
                               looking({0.3, 0.5, 1}, make_volume(dims, ScalarType::u16, [](auto, auto, auto) { return 3.0; })->desc(), kPerspective, 1.5),
                               0.7, "", "thin");
    VolumePtr none = make_volume({0, 4, 4}, ScalarType::u8, [](auto, auto, auto) { return 0.0; });
    Camera camera;
    EXPECT_EQ(draw(none, constant_medium(1), camera, "{size: [4, 4]}").image()->at(1, 1), glm::vec4(0, 0, 0, 1));
}

TEST(SlicerRender, SpacingOfOneToAThousand) {
    VolumePtr volume = make_volume({6, 6, 6}, ScalarType::u8, [](auto, auto, auto) { return 9.0; }, {1, 1, 1000});
    for (glm::dvec3 from : {glm::dvec3(1, 0.1, 0), glm::dvec3(0, 0, 1), glm::dvec3(1, 0, 1)}) {
        Camera camera = looking(from, volume->desc(), kOrthographic, 1);
        camera.height = 7;
        expect_constant_medium(volume, camera, 0.05, "", "1:1000");
    }
}

TEST(SlicerRender, VoxelsThatAreNotNumbersAreTransparentAndDoNotSpread) {
    double nan = std::nan("");
    VolumePtr holes = make_volume({20, 20, 20}, ScalarType::f32, [&](auto x, auto, auto) { return x < 10 ? 5.0 : nan; });
    ImagePtr image = draw(holes, constant_medium(0.1), looking({0, 0, 1}, holes->desc(), kOrthographic),
                          "{size: [40, 40], background: [0, 0, 0, 0]}").image();
    float most = 0;
    for (glm::vec4 c : image->rgba32f()) {
        for (int i = 0; i < 4; ++i) ASSERT_TRUE(std::isfinite(c[i]));
        most = std::max(most, c.a);
    }
    EXPECT_NEAR(most, -std::expm1(-0.1 * 19), 1e-4);
    NodeRun nothing = draw(make_volume({8, 8, 8}, ScalarType::f64, [&](auto, auto, auto) { return nan; }),
                           constant_medium(1), looking({0, 0, 1}, holes->desc(), kPerspective), "{size: [8, 8]}");
    EXPECT_EQ(nothing.counters["blocks drawn"], 0);
}

TEST(SlicerRender, HugeValueRangesDoNotOverflow) {
    VolumePtr volume = make_volume({9, 9, 9}, ScalarType::f64, [](auto x, auto, auto) { return x % 2 ? 1e30 : 1e-30; });
    ImagePtr image = draw(volume, transfer({{{0, Emission(0)}, {1e30, Emission(1)}}}),
                          looking({1, 1, 1}, volume->desc(), kPerspective), "{size: [16, 16], shading: true}").image();
    for (glm::vec4 c : image->rgba32f())
        for (int i = 0; i < 4; ++i) ASSERT_TRUE(std::isfinite(c[i]));
    EXPECT_GT(image->at(8, 8).g, 0.0f);
}

TEST(SlicerRender, ColourVolumesKeepTheirColours) {
    VolumeDesc desc;
    desc.dims = {8, 8, 8};
    desc.components = 3;
    desc.color = true;
    Buffer voxels(desc.dense_bytes());
    for (std::size_t i = 0; i < desc.voxels(); ++i) {
        voxels.as<std::uint8_t>()[3 * i] = 255;
        voxels.as<std::uint8_t>()[3 * i + 1] = 102;
        voxels.as<std::uint8_t>()[3 * i + 2] = 0;
    }
    auto volume = std::make_shared<DenseVolume>(desc, std::move(voxels));
    for (const char* classification : {"pre", "post", "pre-integrated"}) {
        glm::vec4 c = draw(VolumePtr(volume), constant_medium(100), looking({0, 0, 1}, desc, kOrthographic),
                           std::string("{size: [16, 16], classification: ") + classification + "}").image()->at(8, 8);
        EXPECT_NEAR(c.r, 1.0, 2e-3);
        EXPECT_NEAR(c.g, 0.4, 2e-3);
        EXPECT_NEAR(c.b, 0.0, 1e-5);
    }
}

TEST(SlicerRender, MaximumIntensityShowsTheLargestValue) {
    VolumePtr volume = make_volume({9, 9, 9}, ScalarType::u8, [](auto, auto, auto z) { return z == 4 ? 80.0 : 10.0; });
    TransferPtr tf = transfer({{{0, Emission(0)}, {100, Emission(1)}}}, 2.0);
    glm::vec4 c = draw(volume, tf, looking({0, 0, 1}, volume->desc(), kOrthographic),
                       "{size: [16, 16], background: [0, 0, 0, 0], compositing: mip}").image()->at(8, 8);
    EXPECT_NEAR(c.a, -std::expm1(-0.8 * 2), 1e-4);
}

TEST(SlicerRender, MaximumIntensityIsModulatedAndLit) {
    VolumePtr volume = make_volume({9, 9, 9}, ScalarType::u8, [](auto, auto, auto z) { return 10.0 * double(z); });
    TransferPtr tf = transfer({{{0, Emission(0)}, {100, Emission(0.5, 0.25, 0, 1)}}}, 2.0);
    // Along x every value of a ray is the same; the gradient is 10 across the view: no diffuse light.
    auto at_middle = [&](const std::string& more) {
        return draw(volume, tf, looking({1, 0, 0}, volume->desc(), kOrthographic),
                    "{size: [17, 17], background: [0, 0, 0, 0], compositing: mip" + more + "}").image()->at(8, 8);
    };
    const double depth = 0.4 * 2;
    EXPECT_NEAR(at_middle("").a, -std::expm1(-depth), 1e-3);
    EXPECT_NEAR(at_middle(", gradient_modulation: [0, 20]").a, -std::expm1(-0.5 * depth), 1e-3);
    const glm::vec4 lit = at_middle(", shading: true");
    EXPECT_NEAR(lit.a, -std::expm1(-depth), 1e-3);
    EXPECT_NEAR(lit.r, Lights{}.ambient * 0.5 * lit.a, 1e-3);
    EXPECT_NEAR(lit.g, 0.5 * lit.r, 1e-4);
}

TEST(SlicerRender, MaximumIntensityLeavesOutBlocksThatCannotHoldIt) {
    VolumePtr volume = ball(ScalarType::u8, {96, 96, 96});
    Camera camera = looking({0.3, 0.2, 1}, volume->desc(), kPerspective);
    for (const char* more : {"", ", reconstruction: tricubic"}) {
        std::string common = std::string("compositing: mip, size: [64, 64]") + more;
        NodeRun all = draw(volume, soft_shell(), camera, "{skipping: false, " + common + "}");
        NodeRun some = draw(volume, soft_shell(), camera, "{" + common + "}");
        EXPECT_LT(worst(*all.image(), *some.image()), 1e-5);
        EXPECT_LT(some.counters["samples"], 0.5 * all.counters["samples"]);
    }
}

TEST(SlicerRender, IsosurfacesAreMetBetweenTwoSlices) {
    // A lens whose middle is thinner than the distance between two slices.
    VolumePtr volume = make_volume({41, 41, 41}, ScalarType::f32, [](auto x, auto y, auto z) {
        return 100 - 0.1 * std::pow(double(x) - 20, 2) - 0.1 * std::pow(double(y) - 20, 2) -
               4 * std::pow(double(z) - 19.3, 2);
    });
    Camera camera = looking({0, 0, 1}, volume->desc(), kOrthographic);
    camera.height = 40;
    ImagePtr image = draw(volume, constant_medium(1), camera,
                          "{size: [80, 80], background: [0, 0, 0, 0], compositing: isosurface, iso_value: 90, "
                          "slice_distance: 4}").image();
    double covered = 0;
    for (glm::vec4 c : image->rgba32f()) covered += c.a / 4;
    EXPECT_NEAR(covered, std::numbers::pi * 100, 0.1 * std::numbers::pi * 100);
}

// --- behaviour ---------------------------------------------------------------------------------------

TEST(SlicerRender, AnotherCameraUploadsNothingAndGivesTheSameBytesTwice) {
    VolumePtr volume = ball();
    TransferPtr tf = soft_shell();
    Camera camera = looking({0, 0, 1}, volume->desc(), kPerspective);
    NodeRun first = draw(volume, tf, camera, "{size: [32, 32], shading: true}");
    EXPECT_GT(first.counters["bytes uploaded"], 0);
    NodeRun again = draw(volume, tf, camera, "{size: [32, 32], shading: true}");
    EXPECT_EQ(again.counters.count("bytes uploaded"), 0u);
    EXPECT_EQ(worst(*first.image(), *again.image()), 0.0);
    NodeRun turned = draw(volume, tf, looking({1, 0.2, 0.1}, volume->desc(), kPerspective), "{size: [32, 32], shading: true}");
    EXPECT_EQ(turned.counters.count("bytes uploaded"), 0u);
}

TEST(SlicerRender, ShowsACoarsePictureFirst) {
    VolumePtr volume = ball();
    RunNodeOptions options;
    options.wants_provisional = true;
    NodeRun run = draw(volume, soft_shell(), looking({0, 0, 1}, volume->desc(), kPerspective), "{size: [192, 160]}", options);
    ASSERT_EQ(run.provisional.size(), 1u);
    auto coarse = std::get<ImagePtr>(run.provisional[0].second);
    EXPECT_EQ(coarse->size(), glm::ivec2(192, 160));
    auto mean = [](const Image& image) {
        glm::dvec4 sum(0);
        for (glm::vec4 c : image.rgba32f()) sum += glm::dvec4(c);
        return sum / double(image.rgba32f().size());
    };
    glm::dvec4 a = mean(*coarse), b = mean(*run.image());
    EXPECT_GT(b.r, 0.01);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(a[c], b[c], 0.05 * b[c]);
}

TEST(SlicerRender, ACancelledRunEndsWithoutAPicture) {
    VolumePtr volume = ball();
    std::stop_source stop;
    stop.request_stop();
    RunNodeOptions options;
    options.stop = stop.get_token();
    EXPECT_THROW(draw(volume, soft_shell(), looking({0, 0, 1}, volume->desc(), kPerspective), "{size: [32, 32]}", options), Cancelled);
}

TEST(SlicerRender, RefusesWhatItCannotDrawWithASentence) {
    Camera camera;
    try {
        draw(make_volume({70000, 1, 1}, ScalarType::u8, [](auto, auto, auto) { return 1.0; }), constant_medium(1), camera, "{size: [8, 8]}");
        FAIL() << "was drawn";
    } catch (const Error& e) {
        EXPECT_NE(std::string(e.what()).find("does not fit into one texture"), std::string::npos) << e.what();
    }
    VolumeDesc flat;
    flat.dims = {4, 4, 4};
    flat.index_to_world[2] = flat.index_to_world[1];
    EXPECT_THROW(draw(VolumePtr(std::make_shared<DenseVolume>(flat, Buffer(64))), constant_medium(1), camera, "{size: [8, 8]}"), Error);
}
