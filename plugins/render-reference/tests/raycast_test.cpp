// Closed forms of whole volume-rendering integrals.
#include "plugins/render-reference/raycast.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cstring>
#include <glm/gtc/matrix_transform.hpp>

#include "core/base/error.h"
#include "plugins/render-reference/tests/scenes.h"

namespace voxloom::reference {
namespace {

using namespace testing;
using voxloom::testing::make_volume;

VolumePtr constant(Index3 dims, double value, ScalarType type = ScalarType::f32) {
    return make_volume(dims, type, [=](auto, auto, auto) { return value; });
}

VolumePtr ramp_x(std::int64_t n) {
    return make_volume({n, 5, 5}, ScalarType::f64, [](auto x, auto, auto) { return double(x); });
}

// Length of a ray inside the box from the first to the last voxel, by the slab method in world
// coordinates.
double chord(const Ray& ray, glm::dvec3 hi) {
    double t0 = 0, t1 = 1e300;
    for (int a = 0; a < 3; ++a) {
        const double p = (0 - ray.origin[a]) / ray.direction[a],
                     q = (hi[a] - ray.origin[a]) / ray.direction[a];
        if (ray.direction[a] == 0) {
            if (ray.origin[a] < 0 || ray.origin[a] > hi[a]) return 0;
            continue;
        }
        t0 = std::max(t0, std::min(p, q));
        t1 = std::min(t1, std::max(p, q));
    }
    return std::max(0.0, t1 - t0);
}

const std::vector<glm::dvec3> kViews = {
    {0, 0, 1},        {1, 0, 0},        {0, -1, 0}, {1, 1, 0},    {1, 1, 1}, {-1, 1, -1},
    {1, 1 + 1e-7, 0}, {0.3, -0.7, 0.2}, {0, 1, -1}, {1e-9, 1, 0}, {-5, 3, 1}};

TEST(Raycast, ConstantMediumIsOneMinusExpOfItsDepthForAnyView) {
    const glm::dvec3 spacing(1, 0.5, 2.5), hi = glm::dvec3(8, 6, 4) * spacing;
    const auto volume = make_volume(
        {9, 7, 5}, ScalarType::u8, [](auto, auto, auto) { return 7; }, spacing);
    const double tau = 0.31;
    const glm::dvec3 color(0.25, 0.5, 1);
    for (bool perspective : {true, false})
        for (Mode mode : {Mode::cells, Mode::steps})
            for (const glm::dvec3& view : kViews) {
                Camera camera = *look(0.5 * hi + 30.0 * glm::normalize(view), 0.5 * hi);
                if (!perspective) {
                    camera.projection = Camera::Projection::orthographic;
                    camera.height = 12;
                }
                RaycastScene scene = scene_of(volume, transfer({{0, glow(tau, color)}}),
                                              std::make_shared<Camera>(camera));
                scene.mode = mode;
                const Raycaster caster(scene);
                int hits = 0;
                for (double y = 0.5; y < 16; ++y)
                    for (double x = 0.5; x < 16; ++x) {
                        const Ray ray = camera.ray(x, y, 16, 16);
                        const double alpha = -std::expm1(-tau * chord(ray, hi));
                        hits += alpha > 0;
                        EXPECT_LT(largest_difference(caster.trace(ray), {color * alpha, alpha}),
                                  1e-12);
                    }
                EXPECT_GT(hits, 10);
            }
}

TEST(Raycast, CameraInsideSeesOnlyWhatIsBeforeIt) {
    const RaycastScene scene =
        scene_of(constant({9, 9, 9}, 1), transfer({{0, glow(0.2)}}), look({4, 4, 3}, {4, 4, 0}));
    const Raycaster caster(scene);
    EXPECT_NEAR(caster.trace({{4, 4, 3}, {0, 0, -1}}).a, -std::expm1(-0.6), 1e-14);
}

TEST(Raycast, NothingNearerThanTheNearPlaneIsDrawn) {
    Camera camera = *look({4, 4, 20}, {4, 4, 0});
    camera.near = 14;  // along the axis: a plane at z = 6
    RaycastScene scene = scene_of(constant({9, 9, 9}, 1), transfer({{0, glow(0.2)}}),
                                  std::make_shared<Camera>(camera));
    const Ray ray = camera.ray(9, 9, 16, 16);
    const double expected = -std::expm1(-0.2 * 6 / -ray.direction.z);
    EXPECT_NEAR(Raycaster(scene).trace(ray).a, expected, 1e-13);
}

TEST(Raycast, RampThroughABoxIsItsWidthWhateverTheView) {
    // tau on values 2 to 5.5 of a ramp of slope 1 in x: the ray spends 3.5 / |d.x| in it.
    const TransferPtr box = transfer(
        {{2, glow(0)}, {2, glow(0.4, {1, 0.5, 0})}, {5.5, glow(0.4, {1, 0.5, 0})}, {5.5, glow(0)}});
    for (glm::dvec3 direction :
         {glm::dvec3(1, 0, 0), {-1, 0, 0}, {1, 0.2, -0.1}, {-1, 0.1, 0.15}}) {
        direction = glm::normalize(direction);
        const glm::dvec3 middle(4.5, 2, 2);
        const RaycastScene scene =
            scene_of(ramp_x(10), box, look(middle - 20.0 * direction, middle));
        const glm::dvec4 seen = Raycaster(scene).trace({middle - 20.0 * direction, direction});
        const double alpha = -std::expm1(-0.4 * 3.5 / std::abs(direction.x));
        EXPECT_LT(largest_difference(seen, {alpha, 0.5 * alpha, 0, alpha}), 1e-13);
    }
}

TEST(Raycast, TwoColoursAlongARampMatchTheirIntegral) {
    // tau constant 0.3, colour from red (value 0) to blue (value 9) along the ray: the colour is
    // the integral of tau c exp(-tau x), which is elementary.
    const double tau = 0.3, n = 9;
    const RaycastScene scene =
        scene_of(ramp_x(10), transfer({{0, glow(tau, {1, 0, 0})}, {9, glow(tau, {0, 0, 1})}}),
                 look({-5, 2, 2}, {0, 2, 2}));
    const glm::dvec4 seen = Raycaster(scene).trace({{-5, 2, 2}, {1, 0, 0}});
    const double e = std::exp(-tau * n), blue = (1 - e * (1 + tau * n)) / (tau * n);
    EXPECT_NEAR(seen.b, blue, 1e-12);
    EXPECT_NEAR(seen.r, 1 - e - blue, 1e-12);
    EXPECT_NEAR(seen.a, 1 - e, 1e-14);
}

TEST(Raycast, APeakOfAnyWidthKeepsItsIntegral) {
    // A triangle of extinction of area A in value, met once on a ramp of slope 1: depth A.
    for (double width : {1.0, 1e-3, 1e-6, 1e-9}) {
        const double area = 0.7;
        const RaycastScene scene = scene_of(
            ramp_x(10),
            transfer({{4.3 - width, glow(0)}, {4.3, glow(area / width)}, {4.3 + width, glow(0)}}),
            look({-5, 2, 2}, {0, 2, 2}));
        EXPECT_NEAR(Raycaster(scene).trace({{-5, 2, 2}, {1, 0, 0}}).a, -std::expm1(-area),
                    1e-13 + 1e-15 / width);
    }
}

TEST(Raycast, HugeExtinctionIsOpaqueAndShowsTheFirstColour) {
    for (double tau : {1e3, 1e9, 1e30, 1e300}) {
        const RaycastScene scene = scene_of(
            ramp_x(10),
            transfer(
                {{2, glow(0, {0, 1, 0})}, {2, glow(tau, {0, 1, 0})}, {8, glow(tau, {1, 0, 0})}}),
            look({-5, 2, 2}, {0, 2, 2}));
        const glm::dvec4 seen = Raycaster(scene).trace({{-5, 2, 2}, {1, 0, 0}});
        EXPECT_EQ(seen.a, 1.0);
        EXPECT_NEAR(seen.g, 1, 1e-3);
        EXPECT_NEAR(seen.r + seen.g, 1, 1e-9);
    }
}

TEST(Raycast, ExtinctionThatIsNotFiniteIsRefused) {
    const double inf = std::numeric_limits<double>::infinity();
    EXPECT_THROW(
        Raycaster(scene_of(ramp_x(3), transfer({{0, glow(inf)}}), look({-5, 2, 2}, {0, 2, 2}))),
        Error);
}

TEST(Raycast, ZeroOpacityLeavesTheBackground) {
    RaycastScene scene =
        scene_of(waves_volume(), transfer({{0, glow(0)}}), look({5, 5, 40}, {5, 5, 5}));
    scene.background = {0.25, 0.5, 0.75, 0.5};
    const Image image = Raycaster(scene).image();
    for (const glm::vec4& pixel : image.rgba32f())
        EXPECT_EQ(pixel, glm::vec4(0.125, 0.25, 0.375, 0.5));
}

TEST(Raycast, SplittingATransferFunctionByPointsOnItsLinesChangesNothing) {
    const auto coarse = bumps();
    auto fine = std::make_shared<TransferFunction>(*coarse);
    fine->one.points.clear();
    for (std::size_t i = 0; i + 1 < coarse->one.points.size(); ++i) {
        const Point &a = coarse->one.points[i], &b = coarse->one.points[i + 1];
        for (double w : {0.0, 0.3, 0.6}) {
            const double v = a.value + w * (b.value - a.value);
            fine->one.points.push_back({v, a.emission + w * (b.emission - a.emission)});
        }
    }
    fine->one.points.push_back(coarse->one.points.back());
    const CameraPtr camera = look({30, 17, 22}, {5, 5, 5});
    const Raycaster a(scene_of(waves_volume(), coarse, camera)),
        b(scene_of(waves_volume(), fine, camera));
    for (double y = 0.5; y < 16; ++y)
        for (double x = 0.5; x < 16; ++x) {
            const Ray ray = camera->ray(x, y, 16, 16);
            EXPECT_LT(largest_difference(a.trace(ray), b.trace(ray)), 1e-9);
        }
}

TEST(Raycast, StepsConvergeToCellsWithTheSquareOfTheStep) {
    for (bool shading : {false, true}) {
        const CameraPtr camera = look({30, 17, 22}, {5, 5, 5});
        RaycastScene scene = scene_of(waves_volume(), bumps(), camera);
        scene.shading = shading;
        scene.lights.shininess = 8;
        const Raycaster truth(scene);
        ASSERT_TRUE(truth.uses_cells());
        auto rmse = [&](double step) {
            RaycastScene sampled = scene;
            sampled.mode = Mode::steps;
            sampled.step = step;
            const Raycaster caster(sampled);
            double sum = 0;
            for (double y = 0.5; y < 16; ++y)
                for (double x = 0.5; x < 16; ++x) {
                    const Ray ray = camera->ray(x, y, 16, 16);
                    const glm::dvec4 d = caster.trace(ray) - truth.trace(ray);
                    sum += glm::dot(d, d);
                }
            return std::sqrt(sum / (16 * 16 * 4));
        };
        const double coarse = rmse(0.04), fine = rmse(0.01), order = std::log2(coarse / fine) / 2;
        EXPECT_GT(coarse, 1e-7);
        EXPECT_LT(fine, 1e-5);
        EXPECT_NEAR(order, 2, 0.35) << (shading ? "shaded" : "unshaded");
    }
}

TEST(Raycast, XRayIsTheAbsorptionAlone) {
    const CameraPtr camera = look({30, 17, 22}, {5, 5, 5});
    RaycastScene scene = scene_of(waves_volume(), bumps(), camera);
    const Raycaster full(scene);
    scene.compositing = Compositing::x_ray;
    const Raycaster x_ray(scene);
    for (double y = 0.5; y < 16; ++y) {
        const Ray ray = camera->ray(8, y, 16, 16);
        EXPECT_LT(largest_difference(x_ray.trace(ray), glm::dvec4(full.trace(ray).a)), 1e-13);
    }
}

TEST(Raycast, SphereIsosurfaceIsWhereTheSphereIs) {
    // The distance field is curved between voxels: the hit is off by the interpolation's error,
    // which falls with the square of the spacing.
    auto error_at = [](std::int64_t n) {
        const double h = 2.0 / double(n - 1), radius = 0.7;
        const auto volume = make_volume(
            {n, n, n}, ScalarType::f64,
            [=](auto x, auto y, auto z) {
                return radius - glm::length(glm::dvec3(x, y, z) * h - 1.0);
            },
            glm::dvec3(h));
        // White headlight without specular: brightness gives |cos| of the angle at the hit.
        RaycastScene scene = scene_of(volume, transfer({{0, glow(1)}}), look({1, 1, 9}, {1, 1, 1}));
        scene.compositing = Compositing::isosurface;
        scene.shading = true;
        scene.lights.ambient = 0;
        scene.lights.diffuse = 1;
        scene.lights.specular = 0;
        const Raycaster caster(scene);
        double worst = 0;
        for (double y = -0.6; y <= 0.6; y += 0.17)
            for (double x = -0.6; x <= 0.6; x += 0.17) {
                const double rr = x * x + y * y;
                const glm::dvec4 seen = caster.trace({{1 + x, 1 + y, 9}, {0, 0, -1}});
                if (rr > 0.95 * radius * radius) continue;
                EXPECT_EQ(seen.a, 1.0);
                worst = std::max(worst, std::abs(seen.r - std::sqrt(1 - rr / (radius * radius))));
            }
        EXPECT_EQ(caster.trace({{1.75, 1, 9}, {0, 0, -1}}), glm::dvec4(0.0));
        return worst;
    };
    const double coarse = error_at(17), fine = error_at(33);
    EXPECT_LT(fine, 5e-3);
    EXPECT_LT(fine, coarse / 2.5);
}

TEST(Raycast, IsosurfaceIsTheFirstRootOfTheCubics) {
    // Against bisection between samples that are too close to miss a crossing; colour and light are
    // those of the hit.
    RaycastScene scene = scene_of(waves_volume(), bumps(), look({30, 17, 22}, {5, 5, 5}));
    scene.compositing = Compositing::isosurface;
    scene.iso_value = 0.6;
    const Raycaster cells(scene);
    scene.mode = Mode::steps;
    scene.step = 0.01;
    const Raycaster steps(scene);
    scene.mode = Mode::cells;
    scene.shading = true;
    const Raycaster lit_cells(scene);
    scene.mode = Mode::steps;
    const Raycaster lit_steps(scene);
    int hits = 0;
    for (double y = 0.5; y < 16; ++y)
        for (double x = 0.5; x < 16; ++x) {
            const Ray ray = scene.camera->ray(x, y, 16, 16);
            const glm::dvec4 seen = cells.trace(ray);
            hits += seen.a == 1;
            EXPECT_LT(largest_difference(seen, steps.trace(ray)), 1e-12);
            EXPECT_LT(largest_difference(lit_cells.trace(ray), lit_steps.trace(ray)), 1e-8);
            if (seen.a > 0) {
                EXPECT_LT(largest_difference(seen, {0.2, 0.3, 1, 1}), 1e-12);
            }
        }
    EXPECT_GT(hits, 30);
}

TEST(Raycast, MaximumIsThatOfTheCubicNotOfItsSamples) {
    // One cell, a saddle: along the diagonal between its two low edges the value is 2 x (1 - x),
    // with the maximum 1/2 inside and 0 at both ends.
    const auto volume = make_volume({2, 2, 2}, ScalarType::f64,
                                    [](auto x, auto y, auto) { return x == y ? 1.0 : 0.0; });
    RaycastScene scene = scene_of(volume, nullptr, look({-4, 5, 0.5}, {0.5, 0.5, 0.5}));
    scene.compositing = Compositing::mip;
    // Opacity equals the value for a reference length of 1: tau = -ln(1 - v) at a few points.
    scene.transfer = transfer({{0, glow(0)},
                               {0.4, glow(extinction_of(0.4, 1))},
                               {0.5, glow(extinction_of(0.5, 1))},
                               {1, glow(extinction_of(0.5, 1))}});
    const glm::dvec3 direction = glm::normalize(glm::dvec3(1, -1, 0));
    const glm::dvec4 seen = Raycaster(scene).trace({{-4, 5, 0.5}, direction});
    EXPECT_NEAR(seen.a, 0.5, 1e-15);
}

TEST(Raycast, MaximumOfARampIsItsEnd) {
    RaycastScene scene = scene_of(ramp_x(10), transfer({{0, glow(0)}, {9, glow(0.9, {1, 0.5, 0})}}),
                                  look({3, 2, 2}, {13, 3, 2}));
    scene.compositing = Compositing::mip;
    const glm::dvec3 direction = glm::normalize(glm::dvec3(1, 0.1, 0));
    // Leaves through y = 4 or x = 9, whichever is first.
    const double value = std::min(9.0, 3 + (4 - 2) / 0.1);
    for (Mode mode : {Mode::cells, Mode::steps}) {
        scene.mode = mode;
        const glm::dvec4 seen = Raycaster(scene).trace({{3, 2, 2}, direction});
        const double alpha = opacity_of(0.1 * value, 1);
        EXPECT_LT(largest_difference(seen, {alpha, 0.5 * alpha, 0, alpha}), 1e-12);
    }
}

TEST(Raycast, TurningTheVolumeIsTurningTheCameraTheOtherWay) {
    glm::dmat4 turn = glm::translate(glm::dmat4(1.0), glm::dvec3(3, -7, 2));
    turn = glm::rotate(turn, 0.83, glm::normalize(glm::dvec3(1, 2, -0.5)));
    const glm::dmat4 scale = glm::scale(glm::dmat4(1.0), glm::dvec3(1, 0.7, 1.9));
    const VolumePtr straight = with_matrix(waves_volume(), scale),
                    turned = with_matrix(waves_volume(), turn * scale);
    auto moved = [&](glm::dvec3 p, double w) { return glm::dvec3(turn * glm::dvec4(p, w)); };
    const glm::dvec3 eye(30, 17, 22), target(5, 4, 8), up(0, 1, 0);
    for (bool shading : {false, true})
        for (Compositing compositing :
             {Compositing::emission_absorption, Compositing::isosurface}) {
            RaycastScene scene = scene_of(straight, bumps(), look(eye, target, up));
            scene.shading = shading;
            scene.compositing = compositing;
            scene.iso_value = 0.5;
            const Raycaster a(scene);
            scene.volume = turned;
            scene.camera = look(moved(eye, 1), moved(target, 1), moved(up, 0));
            const Raycaster b(scene);
            for (double y = 0.5; y < 16; ++y)
                for (double x = 0.5; x < 16; ++x)
                    EXPECT_LT(largest_difference(a.trace(look(eye, target, up)->ray(x, y, 16, 16)),
                                                 b.trace(scene.camera->ray(x, y, 16, 16))),
                              1e-9);
        }
}

TEST(Raycast, ExtremeWorldsGiveTheSamePicture) {
    // The same scene in metres of 1e9 and 1e-9, extinction scaled along.
    const CameraPtr camera = look({30, 17, 22}, {5, 5, 5});
    const Raycaster plain(scene_of(waves_volume(), bumps(), camera));
    for (double s : {1e9, 1e-9}) {
        auto scaled = std::make_shared<TransferFunction>(*bumps());
        for (Point& p : scaled->one.points) p.emission /= s;
        const VolumePtr volume =
            with_matrix(waves_volume(), glm::scale(glm::dmat4(1.0), glm::dvec3(s)));
        const CameraPtr far = look(camera->eye * s, camera->target * s);
        const Raycaster caster(scene_of(volume, scaled, far));
        for (double y = 0.5; y < 16; ++y)
            EXPECT_LT(largest_difference(plain.trace(camera->ray(7.5, y, 16, 16)),
                                         caster.trace(far->ray(7.5, y, 16, 16))),
                      1e-11);
    }
}

TEST(Raycast, NearestIsConstantAroundEachVoxel) {
    // Extinction equals the voxel's value; along x the pieces are 1/2, 1, 1, ..., 1/2 long.
    const auto volume =
        make_volume({4, 3, 3}, ScalarType::u8, [](auto x, auto, auto) { return x * x; });
    RaycastScene scene =
        scene_of(volume, transfer({{0, glow(0)}, {10, glow(1)}}), look({-5, 1, 1}, {0, 1, 1}));
    scene.reconstruction = Reconstruction::nearest;
    const double depth = 0.1 * (0.5 * 0 + 1 + 4 + 0.5 * 9);
    EXPECT_NEAR(Raycaster(scene).trace({{-5, 1.1, 0.9}, {1, 0, 0}}).a, -std::expm1(-depth), 1e-14);

    scene.compositing = Compositing::isosurface;
    scene.iso_value = 3;
    EXPECT_EQ(Raycaster(scene).trace({{-5, 1.1, 0.9}, {1, 0, 0}}).a, 1.0);
    scene.iso_value = 9.5;
    EXPECT_EQ(Raycaster(scene).trace({{-5, 1.1, 0.9}, {1, 0, 0}}).a, 0.0);
}

TEST(Raycast, TricubicReproducesQuadraticsWhereTrilinearDoesNot) {
    const auto volume = make_volume({12, 12, 12}, ScalarType::f64, [](auto x, auto y, auto z) {
        return 0.1 * double(x * x) - 0.05 * double(y * z) + double(z);
    });
    const Field cubic(volume, 0, Reconstruction::tricubic, GradientStencil::central, false);
    const Field linear(volume, 0, Reconstruction::trilinear, GradientStencil::central, false);
    const glm::dvec3 p(4.4, 5.7, 6.1);
    const double exact = 0.1 * p.x * p.x - 0.05 * p.y * p.z + p.z;
    EXPECT_NEAR(cubic.value(p), exact, 1e-12);
    EXPECT_GT(std::abs(linear.value(p) - exact), 1e-3);
}

TEST(Raycast, GradientsOfARampAreExactWithAnyStencilAndSpacing) {
    const glm::dvec3 spacing(0.5, 2, 10), slope(3, -1, 0.25);
    const auto volume = make_volume(
        {6, 6, 6}, ScalarType::f64,
        [=](auto x, auto y, auto z) { return glm::dot(slope, glm::dvec3(x, y, z) * spacing); },
        spacing);
    for (auto stencil :
         {GradientStencil::central, GradientStencil::sobel, GradientStencil::isotropic})
        for (auto kernel :
             {Reconstruction::nearest, Reconstruction::trilinear, Reconstruction::tricubic}) {
            const Field field(volume, 0, kernel, stencil, false);
            EXPECT_LT(glm::length(field.gradient({2.5, 2.3, 2.8}) - slope), 1e-12);
        }
}

TEST(Raycast, ModulationScalesTheExtinctionByASmoothStepOfTheSlope) {
    // A ramp of slope 1/2 per world length: smoothstep(0, 1, 1/2) = 1/2 in the interior.
    const auto volume = make_volume(
        {11, 5, 5}, ScalarType::f64, [](auto x, auto, auto) { return double(x); }, glm::dvec3(2));
    RaycastScene scene =
        scene_of(volume, transfer({{3, glow(0)}, {3, glow(0.3)}, {7, glow(0.3)}, {7, glow(0)}}),
                 look({-5, 4, 4}, {0, 4, 4}));
    scene.gradient_modulation = {0, 1};
    scene.step = 0.01;
    EXPECT_NEAR(Raycaster(scene).trace({{-5, 4, 4}, {1, 0, 0}}).a, -std::expm1(-0.5 * 0.3 * 8),
                1e-3);
}

TEST(Raycast, TwoDimensionalTransferFunctionsSeeValueAndSlope) {
    auto two = std::make_shared<TransferFunction2D>();
    two->value = {0, 10};
    two->gradient = {0, 2};
    two->dims = {2, 2};
    two->samples = {glow(0), glow(0), glow(0.4), glow(0.4)};  // extinction 0.2 * slope
    auto t = std::make_shared<TransferFunction>(*transfer({{0, glow(5)}}));
    t->two = two;
    // Slope 1 inside: the border's half-differences are 1/2 and reach one voxel in.
    const Raycaster caster(scene_of(ramp_x(11), t, look({-5, 2, 2}, {0, 2, 2})));
    EXPECT_FALSE(caster.uses_cells());
    const double depth = 0.2 * (8 + 2 * 0.75);
    EXPECT_NEAR(caster.trace({{-5, 2, 2}, {1, 0, 0}}).a, -std::expm1(-depth), 1e-4);
}

TEST(Raycast, ColourVolumesKeepTheirColours) {
    VolumeDesc desc;
    desc.dims = {5, 5, 5};
    desc.components = 4;
    desc.color = true;
    Buffer voxels(desc.dense_bytes());
    for (std::size_t i = 0; i < 125; ++i) {
        const std::uint8_t rgba[4] = {255, 51, 0, 127};
        std::memcpy(voxels.data() + 4 * i, rgba, 4);
    }
    const auto volume = std::make_shared<DenseVolume>(desc, std::move(voxels));
    const double luma = 0.2126 * 255 + 0.7152 * 51;
    const Raycaster caster(
        scene_of(volume, transfer({{0, glow(0)}, {255, glow(0.5)}}), look({2, 2, 20}, {2, 2, 2})));
    const double alpha = -std::expm1(-4 * 0.5 * luma / 255 * 127 / 255);
    EXPECT_LT(
        largest_difference(caster.trace({{2, 2, 20}, {0, 0, -1}}), {alpha, 0.2 * alpha, 0, alpha}),
        1e-12);
}

TEST(Raycast, InvalidVoxelsAreLeftOutAndTheirNeighboursRenormalised) {
    // A NaN voxel inside of a constant medium changes nothing; a slab of NaN two voxels thick is
    // a hole one cell long.
    const double nan = std::nan("");
    const auto speck = make_volume({9, 9, 9}, ScalarType::f32, [=](auto x, auto y, auto z) {
        return x == 4 && y == 4 && z == 4 ? nan : 1.0;
    });
    const auto slab = make_volume({9, 9, 9}, ScalarType::f32,
                                  [=](auto, auto, auto z) { return z == 4 || z == 5 ? nan : 1.0; });
    for (Mode mode : {Mode::cells, Mode::steps})
        for (bool shading : {false, true}) {
            RaycastScene scene = scene_of(speck, transfer({{0, glow(0)}, {1, glow(0.2)}}),
                                          look({4, 4, 30}, {4, 4, 4}));
            scene.mode = mode;
            scene.shading = shading;
            scene.lights.ambient = 1;
            const Ray ray{{4.3, 4.2, 30}, {0, 0, -1}};
            EXPECT_LT(
                largest_difference(Raycaster(scene).trace(ray), glm::dvec4(-std::expm1(-1.6))),
                1e-12);
            scene.volume = slab;
            EXPECT_LT(
                largest_difference(Raycaster(scene).trace(ray), glm::dvec4(-std::expm1(-1.4))),
                mode == Mode::cells ? 1e-12 : 5e-3);
        }
}

TEST(Raycast, MaskedVoxelsAreInvalidToo) {
    VolumeDesc desc;
    desc.dims = {3, 3, 3};
    desc.has_mask = true;
    Buffer voxels(27), mask(27);
    std::memset(voxels.data(), 9, 27);
    std::memset(mask.data(), 0, 27);
    const auto all_masked = std::make_shared<DenseVolume>(desc, std::move(voxels), std::move(mask));
    for (auto compositing : {Compositing::emission_absorption, Compositing::mip, Compositing::x_ray,
                             Compositing::isosurface})
        for (auto kernel :
             {Reconstruction::nearest, Reconstruction::trilinear, Reconstruction::tricubic}) {
            RaycastScene scene =
                scene_of(all_masked, transfer({{0, glow(1)}}), look({1, 1, 9}, {1, 1, 1}));
            scene.compositing = compositing;
            scene.reconstruction = kernel;
            EXPECT_EQ(Raycaster(scene).trace({{1.2, 1.1, 9}, {0, 0, -1}}), glm::dvec4(0.0));
        }
}

TEST(Raycast, ClosedFormIsIntegratedInsteadOfTheVoxels) {
    class Ball final : public Volume {
      public:
        Ball()
            : Volume([] {
                  VolumeDesc d;
                  d.dims = {3, 3, 3};
                  d.type = ScalarType::f64;
                  return d;
              }()) {
            form_.value = [](glm::dvec3 p) { return 0.9 - glm::length(p - 1.0); };
            form_.gradient = [](glm::dvec3 p) { return -glm::normalize(p - 1.0); };
        }
        void read(const Box& box, std::span<std::byte> out, const std::stop_token&) const override {
            auto* v = reinterpret_cast<double*>(out.data());
            for (auto z = box.lo.z; z < box.hi.z; ++z)
                for (auto y = box.lo.y; y < box.hi.y; ++y)
                    for (auto x = box.lo.x; x < box.hi.x; ++x) *v++ = form_.value({x, y, z});
        }
        const ClosedForm* closed_form() const override { return &form_; }

      private:
        ClosedForm form_;
    };
    RaycastScene scene = scene_of(std::make_shared<Ball>(), transfer({{0, glow(0)}, {0, glow(1)}}),
                                  look({1, 1, 9}, {1, 1, 1}));
    scene.closed_form = true;
    scene.step = 0.001;
    const double x = 0.3, half = std::sqrt(0.81 - x * x);
    EXPECT_NEAR(Raycaster(scene).trace({{1 + x, 1, 9}, {0, 0, -1}}).a, -std::expm1(-2 * half),
                1e-3);

    scene.compositing = Compositing::isosurface;
    scene.shading = true;
    scene.lights.specular = 0;
    const double expected = 0.3 + 0.6 * half / 0.9;
    EXPECT_NEAR(Raycaster(scene).trace({{1 + x, 1, 9}, {0, 0, -1}}).r, expected, 1e-12);

    scene.volume = waves_volume();
    EXPECT_THROW(Raycaster{scene}, Error);
}

TEST(Raycast, EveryScalarTypeIsDrawn) {
    for (int i = 0; i < kScalarTypes; ++i) {
        const auto volume = make_volume({4, 4, 4}, ScalarType(i), [](auto x, auto y, auto z) {
            return double(x + 4 * y + 16 * z);
        });
        const Raycaster caster(scene_of(volume, transfer({{0, glow(0)}, {63, glow(1)}}),
                                        look({1.5, 1.5, 20}, {1.5, 1.5, 1})));
        // Along z at x = y = 1.5 the value goes from 7.5 to 55.5.
        EXPECT_NEAR(caster.trace({{1.5, 1.5, 20}, {0, 0, -1}}).a, -std::expm1(-3 * 31.5 / 63),
                    1e-13);
    }
}

TEST(Raycast, VolumesOfOneVoxelAndNoneAreDrawn) {
    const CameraPtr camera = look({0, 0, 9}, {0, 0, 0});
    for (auto kernel :
         {Reconstruction::nearest, Reconstruction::trilinear, Reconstruction::tricubic})
        for (Mode mode : {Mode::automatic, Mode::steps}) {
            RaycastScene scene =
                scene_of(constant({1, 1, 1}, 3), transfer({{0, glow(0.7)}}), camera);
            scene.reconstruction = kernel;
            scene.mode = mode;
            EXPECT_NEAR(Raycaster(scene).trace({{0.2, 0.1, 9}, {0, 0, -1}}).a, -std::expm1(-0.7),
                        1e-13);
            EXPECT_EQ(Raycaster(scene).trace({{0.6, 0.1, 9}, {0, 0, -1}}).a, 0.0);
            scene.volume = constant({0, 4, 4}, 3);
            EXPECT_EQ(Raycaster(scene).trace({{0, 0.1, 9}, {0, 0, -1}}).a, 0.0);
        }
}

TEST(Raycast, ThePictureDoesNotDependOnTheNumberOfThreads) {
    const Raycaster caster(scene_of(waves_volume(), bumps(), look({30, 17, 22}, {5, 5, 5})));
    auto bytes = [&](std::size_t threads) {
        tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        const Image image = caster.image();
        return std::vector<std::byte>(image.bytes().begin(), image.bytes().end());
    };
    const auto one = bytes(1);
    EXPECT_EQ(one, bytes(4));
    EXPECT_EQ(one, bytes(2));
}

TEST(Raycast, StopsWhenAsked) {
    RaycastScene scene = scene_of(waves_volume(), bumps(), look({30, 17, 22}, {5, 5, 5}));
    scene.size = {4000, 4000};
    scene.mode = Mode::steps;
    scene.step = 1e-3;
    std::stop_source source;
    const Raycaster caster(scene);
    EXPECT_THROW(caster.image(source.get_token(), [&](double) { source.request_stop(); }),
                 Cancelled);
}

TEST(Raycast, CellsAreRefusedWhereTheyAreNotExact) {
    RaycastScene scene = scene_of(waves_volume(), bumps(), look({30, 17, 22}, {5, 5, 5}));
    scene.mode = Mode::cells;
    EXPECT_NO_THROW(Raycaster{scene});
    scene.reconstruction = Reconstruction::tricubic;
    EXPECT_THROW(Raycaster{scene}, Error);
    scene.reconstruction = Reconstruction::trilinear;
    scene.gradient_modulation = {0.1, 0.2};
    EXPECT_THROW(Raycaster{scene}, Error);
}

}  // namespace
}  // namespace voxloom::reference
