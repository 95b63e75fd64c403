#include <gtest/gtest.h>

#include <cmath>

#include "core/plugin/plugin.h"
#include "tests/support/run_node.h"
#include "tests/support/volumes.h"

extern "C" const voxloom::PluginTable* voxloom_plugin();

using namespace voxloom;
using namespace voxloom::testing;

namespace {

const Registry& slicer() {
    static const Registry registry = [] {
        Registry r;
        voxloom_plugin()->add_to(r);
        return r;
    }();
    return registry;
}

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
    return run_node(slicer(), "slicer.render", params, inputs, options);
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
