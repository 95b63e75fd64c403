// What the pixel under the pointer shows, against closed forms.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "app/editor/model/pick.h"
#include "core/data/brick_cache.h"
#include "core/data/dense_pyramid.h"
#include "tests/support/volumes.h"

namespace voxloom::editor {
namespace {

using voxloom::testing::make_volume;

constexpr double kRadius = 9;
const glm::dvec3 kSpacing(1, 0.5, 2);
const Index3 kDims(33, 65, 17);  // its box is 32 a side, its middle (16, 16, 16)

// 200 inside of a sphere in the world, 10 + x outside of it.
VolumePtr sphere() {
    return make_volume(kDims, ScalarType::u8, [](auto x, auto y, auto z) {
        return glm::distance(glm::dvec3(x, y, z) * kSpacing, glm::dvec3(16)) <= kRadius ? 200.0 : 10.0 + double(x);
    }, kSpacing);
}

// Nothing up to 99, and this extinction from 100 on.
TransferPtr step_at_100(double extinction) {
    auto f = std::make_shared<TransferFunction>();
    f->one.points = {{0, Emission(0)}, {100, Emission(0)}, {100, Emission(extinction)}, {255, Emission(extinction)}};
    return f;
}

Camera looking(glm::dvec3 from, Camera::Projection projection = Camera::Projection::perspective) {
    Camera camera;
    camera.projection = projection;
    camera.target = glm::dvec3(16);
    camera.eye = camera.target + from;
    camera.up = {0.1, 0.2, 1};
    camera.height = 40;
    return camera;
}

PickScene scene_of(VolumePtr volume, Camera camera, double extinction = 1e6) {
    PickScene scene;
    scene.volume = std::move(volume);
    scene.camera = std::make_shared<const Camera>(camera);
    scene.transfer = step_at_100(extinction);
    return scene;
}

// Where a ray first meets the sphere; NaN where it passes by.
double hit(const Ray& ray, double radius) {
    const glm::dvec3 to = glm::dvec3(16) - ray.origin;
    const double middle = glm::dot(to, ray.direction), off = glm::dot(to, to) - middle * middle;
    return middle - std::sqrt(radius * radius - off);
}

constexpr glm::ivec2 kSize(40, 30);

void expect_the_sphere(const PickScene& scene) {
    int met = 0, passed = 0;
    for (int y = 0; y < kSize.y; ++y)
        for (int x = 0; x < kSize.x; ++x) {
            const Ray ray = scene.camera->ray(x + 0.5, y + 0.5, kSize.x, kSize.y);
            const auto picked = pick(scene, {x, y}, kSize);
            if (std::isnan(hit(ray, kRadius + 1.2))) {
                EXPECT_EQ(picked, nullptr) << x << ", " << y;
                ++passed;
            } else if (!std::isnan(hit(ray, kRadius - 1.2))) {
                ASSERT_NE(picked, nullptr) << x << ", " << y;
                EXPECT_EQ(picked->values, std::vector<double>{200});
                EXPECT_LT(glm::length(glm::cross(picked->world - ray.origin, ray.direction)), 1e-9) << "on the ray";
                EXPECT_NEAR(glm::distance(picked->world, glm::dvec3(16)), kRadius, 0.5 * glm::length(kSpacing));
                EXPECT_LT(glm::dot(picked->world - glm::dvec3(16), ray.direction), 0) << "in front";
                EXPECT_TRUE(glm::all(glm::lessThanEqual(glm::abs(glm::dvec3(picked->voxel) * kSpacing - picked->world), 0.5 * kSpacing + 1e-9)));
                ++met;
            }
        }
    EXPECT_GT(met, 50);
    EXPECT_GT(passed, 50);
}

TEST(Pick, meetsASphereWhereItIs) {
    for (const auto projection : {Camera::Projection::perspective, Camera::Projection::orthographic})
        for (const glm::dvec3 from : {glm::dvec3(0, -80, 0), glm::dvec3(60, 40, 30)}) {
            expect_the_sphere(scene_of(sphere(), looking(from, projection)));
            PickScene iso = scene_of(sphere(), looking(from, projection));
            iso.how = PickScene::How::isosurface;
            iso.iso_value = 100;
            expect_the_sphere(iso);
        }
}

TEST(Pick, readsBricksThroughTheirCache) {
    PickScene scene = scene_of(sphere(), looking({60, 40, 30}));
    scene.volume = level_as_volume(make_dense_pyramid(sphere(), glm::ivec3(8), PyramidFilter::average), 0, BrickCache::global());
    expect_the_sphere(scene);
}

// 1 - exp(-tau d) = kVisible.
TEST(Pick, looksAsDeepIntoFogAsItHidesWhatIsBehind) {
    const auto fog = make_volume({41, 41, 41}, ScalarType::f32, [](auto...) { return 150; });
    for (double extinction : {0.01, 0.005, 0.001}) {
        PickScene scene = scene_of(fog, looking({4, -100, 4}), extinction);
        const auto picked = pick(scene, {20, 15}, {41, 31});
        const double depth = -std::log1p(-kVisible) / extinction;
        if (depth > 40) {
            EXPECT_EQ(picked, nullptr);
            continue;
        }
        ASSERT_NE(picked, nullptr);
        const Ray ray = scene.camera->ray(20.5, 15.5, 41, 31);
        EXPECT_NEAR(glm::distance(picked->world, ray.origin + ray.direction * (-ray.origin.y / ray.direction.y)), depth, 1.01);
    }
}

TEST(Pick, findsTheGreatestValueOfARay) {
    PickScene scene = scene_of(make_volume({9, 50, 9}, ScalarType::i16, [](auto, auto y, auto) { return y == 31 ? -5 : -300 - double(y); }),
                               looking({0, -100, 0}, Camera::Projection::orthographic));
    auto camera = *scene.camera;
    camera.target = {4, 0, 4}, camera.eye = {4, -100, 4}, camera.height = 9;
    scene.camera = std::make_shared<const Camera>(camera);
    scene.how = PickScene::How::maximum;
    const auto picked = pick(scene, {4, 4}, {9, 9});
    ASSERT_NE(picked, nullptr);
    EXPECT_EQ(picked->voxel.y, 31);
    EXPECT_EQ(picked->values, std::vector<double>{-5});
}

// A ray along y through the middle of a box, in whole voxels.
PickScene scene_along_y(VolumePtr volume) {
    PickScene scene = scene_of(std::move(volume), looking({0, -100, 0}, Camera::Projection::orthographic));
    auto camera = *scene.camera;
    camera.target = {4, 0, 4}, camera.eye = {4, -100, 4}, camera.up = {0, 0, 1}, camera.height = 9;
    scene.camera = std::make_shared<const Camera>(camera);
    return scene;
}

std::optional<std::int64_t> y_seen(const PickScene& scene) {
    const auto picked = pick(scene, {4, 4}, {9, 9});
    return picked ? std::optional(picked->voxel.y) : std::nullopt;
}

TEST(Pick, ofAnXRayIsWhereMostIsAbsorbed) {
    // Thin in front, a dense layer, the densest one behind it, thin again.
    PickScene scene = scene_along_y(make_volume({9, 50, 9}, ScalarType::u8, [](auto, auto y, auto) { return y == 20 ? 200 : y == 33 || y == 40 ? 240 : 110; }));
    scene.how = PickScene::How::densest;
    auto ramp = std::make_shared<TransferFunction>();
    ramp->one.points = {{100, Emission(0)}, {250, Emission(3)}};
    scene.transfer = ramp;
    EXPECT_EQ(y_seen(scene), 33);
    scene.how = PickScene::How::opacity;
    EXPECT_LE(y_seen(scene).value(), 1) << "what hides is thick enough at once";
    auto peak = std::make_shared<TransferFunction>();
    peak->one.points = {{190, Emission(0)}, {200, Emission(9)}, {210, Emission(0)}};
    scene.how = PickScene::How::densest, scene.transfer = peak;
    EXPECT_EQ(y_seen(scene), 20);
    peak = std::make_shared<TransferFunction>();
    peak->one.points = {{0, Emission(0)}};
    scene.transfer = peak;
    EXPECT_EQ(y_seen(scene), std::nullopt) << "nothing is absorbed";
}

TEST(Pick, readsTransferFunctionsOverGradients) {
    PickScene scene = scene_along_y(make_volume({9, 50, 9}, ScalarType::u8, [](auto, auto y, auto) { return y < 30 ? 100 : 200; }));
    auto two = std::make_shared<TransferFunction2D>();
    two->value = {0, 255}, two->gradient = {0, 100}, two->dims = {2, 3};
    two->samples = {Emission(0), Emission(0), Emission(50), Emission(50), Emission(50), Emission(50)};  // from 50 on, in half
    auto transfer = std::make_shared<TransferFunction>();
    transfer->two = two;
    scene.transfer = transfer;
    EXPECT_EQ(y_seen(scene), 29) << "the first of two voxels beside the step: half of 100 is its gradient";
    two = std::make_shared<TransferFunction2D>(*two);
    two->samples = {Emission(0), Emission(0), Emission(0), Emission(0), Emission(50), Emission(50)};
    transfer = std::make_shared<TransferFunction>();
    transfer->two = two;
    scene.transfer = transfer;
    EXPECT_EQ(y_seen(scene), std::nullopt) << "no gradient is so steep";
    scene.how = PickScene::How::densest;
    EXPECT_EQ(y_seen(scene), std::nullopt);
}

// All stencils are exact for a ramp, also in a skew and stretched lattice; one-sided at a border they give half.
TEST(Pick, modulatesOpacityByTheGradientInTheWorld) {
    VolumeDesc desc = make_volume({9, 50, 9}, ScalarType::f32, [](auto x, auto y, auto z) { return 150 + double(x) + 2 * double(y) - 3 * double(z); })->desc();
    const VolumePtr ramp = make_volume({9, 50, 9}, ScalarType::f32, [](auto x, auto y, auto z) { return 150 + double(x) + 2 * double(y) - 3 * double(z); });
    desc.index_to_world = glm::dmat4(glm::dmat3(1, 0.25, 0, 0, 2, 0, 0, 0, 4));
    Buffer voxels(desc.dense_bytes());
    ramp->read(Box::of(desc.dims), voxels.bytes());
    PickScene scene = scene_of(std::make_shared<const DenseVolume>(desc, std::move(voxels)), looking({0, -200, 0}, Camera::Projection::orthographic));
    auto camera = *scene.camera;
    camera.target = {4, 50, 16}, camera.eye = {4, -100, 16}, camera.up = {0, 0, 1}, camera.height = 9;
    scene.camera = std::make_shared<const Camera>(camera);
    // v = x + 2 y - 3 z of indices; world x = i, y = i/4 + 2 j, z = 4 k: dv = (1 - 1/4) dX + dY - 3/4 dZ.
    const double slope = glm::length(glm::dvec3(0.75, 1, -0.75));
    for (double smoothing : {0.0, 0.25, 1.0 / 6}) {
        scene.smoothing = smoothing;
        scene.modulation = glm::dvec2(slope * 1.0001);
        EXPECT_EQ(y_seen(scene), std::nullopt);
        scene.modulation = glm::dvec2(slope * 0.9999);
        EXPECT_EQ(y_seen(scene), 1) << "behind the border, where gradients are half";
        scene.modulation = {0, slope * 0.1};
        EXPECT_EQ(y_seen(scene), 0);
    }
}

TEST(Pick, takesTheOpacityOfColoursFromTheirAlpha) {
    VolumeDesc desc = make_volume({9, 50, 9}, ScalarType::u8, [](auto...) { return 0; })->desc();
    desc.components = 4, desc.color = true;
    Buffer voxels(desc.dense_bytes());
    for (std::size_t i = 0; i < desc.voxels(); ++i) {
        const std::size_t y = i / 9 % 50;
        for (std::size_t c = 0; c < 4; ++c) voxels.as<std::uint8_t>()[4 * i + c] = std::uint8_t(c < 3 ? 150 + c : y < 17 ? 0 : 255);
    }
    PickScene scene = scene_along_y(std::make_shared<const DenseVolume>(desc, std::move(voxels)));
    const auto picked = pick(scene, {4, 4}, {9, 9});
    ASSERT_NE(picked, nullptr);
    EXPECT_EQ(picked->voxel, Index3(4, 17, 4));
    EXPECT_EQ(picked->values, (std::vector<double>{150, 151, 152, 255}));
    scene.transfer = step_at_100(0);
    EXPECT_EQ(y_seen(scene), std::nullopt) << "the transfer function of their luma counts, too";
}

TEST(Pick, meetsAPlaneOfAnyVolumeAndNothingBesideIt) {
    const auto pairs = [] {
        VolumeDesc desc = make_volume({20, 10, 5}, ScalarType::u8, [](auto...) { return 0; })->desc();
        desc.components = 2;
        Buffer voxels(desc.dense_bytes());
        for (int i = 0; i < 1000; ++i) voxels.as<std::uint8_t>()[std::size_t(2 * i)] = std::uint8_t(i % 20), voxels.as<std::uint8_t>()[std::size_t(2 * i + 1)] = std::uint8_t(i / 200);
        return std::make_shared<const DenseVolume>(desc, std::move(voxels));
    }();
    PickScene scene = scene_of(pairs, looking({0, 0, 50}));
    auto camera = *scene.camera;
    camera.projection = Camera::Projection::orthographic;
    camera.target = {10, 5, 0}, camera.eye = {10, 5, 50}, camera.up = {0, 1, 0}, camera.height = 20;
    scene.camera = std::make_shared<const Camera>(camera);
    scene.how = PickScene::How::plane;
    scene.plane = Plane{{0, 0, 3}, {0, 0, 1}};
    const auto picked = pick(scene, {12, 10}, {20, 20});  // its middle is at x = 12.5 of 20, y = 10.5 from above
    ASSERT_NE(picked, nullptr);
    EXPECT_LT(glm::distance(picked->world, glm::dvec3(12.5, 4.5, 3)), 1e-9);
    EXPECT_EQ(picked->voxel.z, 3);
    EXPECT_EQ(picked->values, (std::vector<double>{double(picked->voxel.x), 3}));
    EXPECT_EQ(pick(scene, {0, 0}, {20, 20}), nullptr);
    scene.plane->normal = {1, 0, 0};  // seen from its edge
    EXPECT_EQ(pick(scene, {12, 10}, {20, 20}), nullptr);
    EXPECT_EQ(text_of(*picked, "mm").substr(0, 14), "at 12.5 4.5 3 ");
}

TEST(Pick, survivesWhatCannotBeSeen) {
    for (double bad : {0.0, 1e300, std::numeric_limits<double>::quiet_NaN()}) {
        VolumeDesc desc = sphere()->desc();
        desc.index_to_world[1] = glm::dvec4(0, bad, 0, 0);
        Buffer clear(desc.dense_bytes());
        std::ranges::fill(clear.bytes(), std::byte{0});
        PickScene scene = scene_of(std::make_shared<const DenseVolume>(desc, std::move(clear)), looking({0, -80, 0}));
        EXPECT_EQ(pick(scene, {20, 15}, kSize), nullptr);
    }
    const auto nans = make_volume({5, 5, 1}, ScalarType::f32, [](auto...) { return NAN; }, {1, 1, 1000});
    EXPECT_EQ(pick(scene_of(nans, looking({0, 0, 4000})), {20, 15}, kSize), nullptr);
    PickScene behind = scene_of(sphere(), looking({0, -80, 0}));
    auto camera = *behind.camera;
    camera.target = {16, -200, 16};
    behind.camera = std::make_shared<const Camera>(camera);
    EXPECT_EQ(pick(behind, {20, 15}, kSize), nullptr);
}

// --- what a picture is made of ---------------------------------------------------------------------

NodeType drawing(const char* id, bool plane) {
    NodeType type;
    type.id = id;
    type.title = type.doc = "test";
    type.inputs = {{"source", {PortType::volume, PortType::bricks}, "What is drawn."}, {"transfer", PortType::transfer, "Its colours."}, {"camera", PortType::camera, "From where."}};
    type.outputs = {{"image", PortType::image, "The picture."}};
    if (plane) type.params = {param::vector("normal", {0, 0, 1}, "Normal."), param::vector("origin", {0.5, 0.5, 0.5}, "Point.")};
    else type.params = {param::choice("compositing", {"emission-absorption", "mip", "x-ray", "isosurface"}, "emission-absorption", "How."),
                        param::real("iso_value", 7, "Value."), param::vector("gradient_modulation", {0, 0}, "Gradients."),
                        param::choice("gradient", {"central", "sobel", "isotropic"}, "isotropic", "Stencil."), param::integer("component", 0, "Component.")};
    type.evaluate = [](Evaluation&) {};
    return type;
}

TEST(PickScene, isMadeOfWhatIsNearestUpstream) {
    Registry registry;
    registry.add(drawing("draw.all", false));
    registry.add(drawing("draw.plane", true));
    Document document = Document::parse(
        "voxloom: 1\nnodes:\n  - { id: a, type: draw.all, in: { source: code.bricks, transfer: tf.transfer, camera: eye.camera } }\n"
        "  - { id: cut, type: draw.plane, in: { source: code.bricks, transfer: tf.transfer, camera: eye.camera } }\n"
        "  - { id: code, type: not.here, in: { volume: head.volume } }\n  - { id: tf, type: not.here }\n"
        "  - { id: eye, type: not.here }\n  - { id: head, type: not.here }\n");
    Evaluator::State state;
    auto scene = [&](const char* node) { return pick_scene(document.graph(), registry, node, state); };
    EXPECT_FALSE(scene("a")) << "nothing is known yet";
    const VolumePtr head = sphere();
    state.volumes["head.volume"] = head;
    state.values["eye.camera"].value = std::make_shared<const Camera>(looking({0, -80, 0}));
    EXPECT_FALSE(scene("a")) << "no transfer function";
    state.values["tf.transfer"].value = step_at_100(1);
    EXPECT_EQ(scene("a").value().volume, head);
    const BricksPtr bricks = make_dense_pyramid(head, glm::ivec3(16), PyramidFilter::average);
    state.bricks["code.bricks"] = bricks;
    EXPECT_NE(scene("a").value().volume, head) << "the bricks are nearer";
    EXPECT_EQ(scene("a").value().how, PickScene::How::opacity);

    document.set_param("a", "compositing", std::string("isosurface"));
    EXPECT_EQ(scene("a").value().how, PickScene::How::isosurface);
    EXPECT_EQ(scene("a").value().iso_value, 7);
    document.set_param("a", "compositing", std::string("x-ray"));
    EXPECT_EQ(scene("a").value().how, PickScene::How::densest);
    EXPECT_EQ(scene("a").value().modulation, glm::dvec2(0));
    document.set_param("a", "gradient_modulation", std::vector<double>{1, 4});
    document.set_param("a", "gradient", std::string("sobel"));
    EXPECT_EQ(scene("a").value().modulation, glm::dvec2(1, 4));
    EXPECT_EQ(scene("a").value().smoothing, 0.25);
    document.reset_param("a", "compositing");
    document.set_param("a", "component", std::int64_t(1));
    EXPECT_FALSE(scene("a"));

    state.nodes["code"].outputs = {ValueDesc(bricks->desc())};
    const auto cut = scene("cut");
    ASSERT_TRUE(cut);
    EXPECT_EQ(cut->how, PickScene::How::plane);
    const auto picked = pick(*cut, {20, 15}, kSize);
    EXPECT_EQ(picked, nullptr) << "seen from its edge";
    EXPECT_FALSE(scene("gone"));
}

}  // namespace
}  // namespace voxloom::editor
