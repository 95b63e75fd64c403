// Bricks drawn by selection: against the volume that they are of, and against closed forms.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "core/data/brick_cache.h"
#include "core/data/dense_pyramid.h"
#include "core/data/selection.h"
#include "tests/support/linked_plugin.h"
#include "tests/support/run_node.h"
#include "tests/support/volumes.h"

using namespace voxloom;
using namespace voxloom::testing;

namespace {

TransferPtr transfer(TransferFunction1D one) {
    auto tf = std::make_shared<TransferFunction>();
    tf->one = std::move(one);
    return tf;
}
TransferPtr constant_medium(double tau) { return transfer({{{0, Emission(glm::dvec3(0.5) * tau, tau)}}}); }
// Colour and opacity rise with the value.
TransferPtr smooth(double most, double tau = 0.05) {
    return transfer({{{0, Emission(0)}, {most, Emission(tau * 1.0, tau * 0.5, 0, tau)}}});
}

NodeRun draw(const Value& source, const SelectionPtr& selection, TransferPtr tf, const Camera& camera,
             const std::string& more = "") {
    NodeInputs inputs;
    inputs["source"] = {source};
    if (selection) inputs["selection"] = {selection};
    inputs["transfer"] = {tf};
    inputs["camera"] = {CameraPtr(std::make_shared<Camera>(camera))};
    return run_node(linked_plugin(), "slicer.render",
                    "{size: [48, 40], background: [0, 0, 0, 0], early_termination: 1" + more + "}", inputs);
}

BricksPtr pyramid(const VolumePtr& volume, int brick, PyramidFilter filter = PyramidFilter::average) {
    return make_dense_pyramid(volume, glm::ivec3(brick), filter);
}

// Everything at one level.
std::shared_ptr<Selection> level_of(const BricksDesc& desc, int level) {
    auto s = std::make_shared<Selection>();
    s->of = std::make_shared<BricksDesc>(desc);
    s->policy = "test";
    const glm::ivec3 n = desc.levels[std::size_t(level)].bricks;
    for (int z = 0; z < n.z; ++z)
        for (int y = 0; y < n.y; ++y)
            for (int x = 0; x < n.x; ++x) {
                SelectedBrick b;
                b.id = {level, {x, y, z}};
                s->bricks.push_back(b);
            }
    return s;
}

// The coarsest brick, but for one of its octants, which is drawn finer; and so on downwards.
std::shared_ptr<Selection> nested(const BricksDesc& desc, int octant) {
    auto s = level_of(desc, int(desc.levels.size()) - 1);
    for (;;) {
        SelectedBrick& last = s->bricks.back();
        if (last.id.level == 0) return s;
        std::vector<BrickId> finer = desc.finer(last.id);
        std::optional<BrickId> child;
        std::uint8_t others = 0;
        for (const BrickId& id : finer) {
            if (desc.octant_of(id) == octant)
                child = id;
            else
                others = std::uint8_t(others | 1 << desc.octant_of(id));
        }
        if (!child) return s;
        last.octants = others;
        SelectedBrick b;
        b.id = *child;
        s->bricks.push_back(b);
    }
}

// Each octant drawn so many levels finer than the brick that it is, blended as lod.balance does: at corners that
// touch a coarser octant.
std::shared_ptr<Selection> octants(const BricksDesc& desc, std::array<int, 8> depth, bool blended) {
    const int coarse = int(desc.levels.size()) - 2;
    auto s = level_of(desc, coarse);
    std::vector<SelectedBrick> bricks;
    for (const SelectedBrick& whole : s->bricks) {
        const int octant = desc.octant_of(whole.id), own = depth[std::size_t(octant)], n = 1 << own;
        auto of_octant = level_of(desc, coarse - own);
        for (SelectedBrick b : of_octant->bricks) {
            if (b.id.index / n != whole.id.index) continue;
            for (int c = 0; c < 8 && blended; ++c) {
                const glm::ivec3 corner = b.id.index + glm::ivec3(c & 1, c >> 1 & 1, c >> 2);
                for (int other = 0; other < 8; ++other) {
                    bool touches = depth[std::size_t(other)] < own;
                    for (int a = 0; a < 3; ++a) touches = touches && (corner[a] == n || (corner[a] > n) == bool(other >> a & 1));
                    if (touches) b.corner_blend[std::size_t(c)] = 1;
                }
            }
            bricks.push_back(b);
        }
    }
    s->bricks = bricks;
    return s;
}
// One fine octant within coarse ones.
std::shared_ptr<Selection> two_levels(const BricksDesc& desc, int octant, bool blended) {
    std::array<int, 8> depth{};
    depth[std::size_t(octant)] = 1;
    return octants(desc, depth, blended);
}

Camera looking(glm::dvec3 from, const VolumeDesc& desc, Camera::Projection projection, double distance = 1.5) {
    const SamplingBox box = sampling_box(desc);
    Camera c;
    c.projection = projection;
    c.target = glm::dvec3(desc.index_to_world * glm::dvec4(0.5 * (box.lo + box.hi), 1));
    const double size = glm::length(glm::dmat3(desc.index_to_world) * (box.hi - box.lo));
    c.eye = c.target + glm::normalize(from) * size * distance;
    c.up = {0.1, 0.9, 0.2};
    c.vertical_fov = 0.6;
    c.height = size;
    return c;
}

double largest_difference(const Image& a, const Image& b) {
    double most = 0;
    for (std::size_t i = 0; i < a.rgba32f().size(); ++i)
        for (int c = 0; c < 4; ++c) most = std::max(most, double(std::abs(a.rgba32f()[i][c] - b.rgba32f()[i][c])));
    return most;
}
double brightest(const Image& a) {
    double most = 0;
    for (glm::vec4 c : a.rgba32f()) most = std::max(most, double(c.a));
    return most;
}

VolumePtr blob(Index3 dims, ScalarType type = ScalarType::u8, glm::dvec3 spacing = glm::dvec3(1)) {
    return make_volume(dims, type, [dims](auto x, auto y, auto z) {
        const glm::dvec3 p = glm::dvec3(x, y, z) / glm::dvec3(dims);
        return 120 + 70 * std::sin(7 * p.x + 3 * p.y) + 50 * std::cos(9 * p.z - 4 * p.y);
    }, spacing);
}

constexpr auto kPerspective = Camera::Projection::perspective;
constexpr auto kOrthographic = Camera::Projection::orthographic;
const glm::dvec3 kViews[] = {{0, 0, 1}, {1, 0, 0}, {0, -1, 0}, {1, 1, 0}, {1, 1, 1}, {-1, 2, 0.3}};

}  // namespace

TEST(BrickPath, AConstantMediumDoesNotDependOnThePartition) {
    const VolumePtr volume = make_volume({33, 40, 27}, ScalarType::u8, [](auto, auto, auto) { return 100.0; });
    const BricksPtr bricks = pyramid(volume, 8);
    bool parallel = false;
    for (glm::dvec3 from : kViews) {
            parallel = !parallel;
            const Camera camera = looking(from, volume->desc(), parallel ? kOrthographic : kPerspective, 1.2);
            const ImagePtr whole = draw(volume, nullptr, constant_medium(0.05), camera).image();
            EXPECT_GT(brightest(*whole), 0.5);
            for (const SelectionPtr& s : {SelectionPtr(level_of(bricks->desc(), 0)), SelectionPtr(level_of(bricks->desc(), 1)),
                                          SelectionPtr(nested(bricks->desc(), 0)), SelectionPtr(nested(bricks->desc(), 5))})
                EXPECT_LT(largest_difference(*draw(bricks, s, constant_medium(0.05), camera).image(), *whole), 1e-5);
        }
}

TEST(BrickPath, ARampIsTheSameFromEveryLevel) {
    // 2^n + 1 voxels, so that the last one is a sample of every level.
    const VolumePtr volume = make_volume({65, 33, 33}, ScalarType::u16, [](auto x, auto y, auto z) { return double(512 * x + 256 * y + 128 * z); });
    const BricksPtr bricks = pyramid(volume, 8);
    ASSERT_GE(bricks->desc().levels.size(), 4u);
    const TransferPtr tf = transfer({{{0, Emission(0.05, 0, 0, 0.05)}, {45000, Emission(0, 0.05, 0.02, 0.05)}}});
    for (glm::dvec3 from : kViews) {
        const Camera camera = looking(from, volume->desc(), kPerspective);
        // Slices of coarse levels are further apart by default; here all levels have the same ones, so that nothing
        // but the voxels' places and values can differ.
        const ImagePtr whole = draw(volume, nullptr, tf, camera, ", classification: post, slice_distance: 0.25").image();
        EXPECT_GT(brightest(*whole), 0.5);
        for (int level = 0; level < 3; ++level)
            EXPECT_LT(largest_difference(*draw(bricks, level_of(bricks->desc(), level), tf, camera,
                                               ", classification: post, slice_distance: " + std::to_string(0.25 / (1 << level))).image(), *whole), 1e-5) << level;
    }
}

TEST(BrickPath, EveryBrickAtTheFinestLevelIsTheVolume) {
    for (ScalarType type : {ScalarType::u8, ScalarType::i16, ScalarType::f32})
        for (int brick : {8, 15, 16, 64}) {
            const VolumePtr volume = blob({37, 50, 41}, type, {1, 1, 1.3});
            const BricksPtr bricks = pyramid(volume, brick);
            for (glm::dvec3 from : {kViews[std::size_t(brick) % 6], glm::dvec3(0.6, -1, 0.7)}) {
                const Camera camera = looking(from, volume->desc(), kPerspective);
                // Slabs are cut at the bricks' faces, so a nonlinear pre-integration differs by what is left of its error.
                const ImagePtr a = draw(bricks, level_of(bricks->desc(), 0), smooth(240), camera, ", slice_distance: 0.5").image();
                const ImagePtr b = draw(volume, nullptr, smooth(240), camera, ", slice_distance: 0.5").image();
                EXPECT_GT(brightest(*b), 0.5);
                EXPECT_LT(largest_difference(*a, *b), 2e-4) << brick;
            }
        }
}

// The volume and all of its bricks, drawn alike: the level as a whole in the texture, or, with so little
// memory that this is not possible, in slots.
static void expect_same_picture(const std::string& mode, int slots_memory, Index3 dims = {64, 64, 72}, int brick = 16) {
    const VolumePtr volume = blob(dims);
    const BricksPtr bricks = pyramid(volume, brick);
    const Camera camera = looking({1, 0.6, 0.4}, volume->desc(), kPerspective);
    const ImagePtr b = draw(volume, nullptr, smooth(240), camera, mode + ", table_size: 64").image();
    EXPECT_GT(brightest(*b), 0.04) << mode;
    for (int memory : {2048, slots_memory}) {
        NodeRun run = draw(bricks, level_of(bricks->desc(), 0), smooth(240), camera, mode + ", table_size: 64, gpu_memory: " + std::to_string(memory));
        if (memory == 2048)
            EXPECT_EQ(run.counters["pages drawn"], 1) << mode;
        else
            EXPECT_EQ(run.counters["pages drawn"], run.counters["bricks drawn"]) << mode;
        const ImagePtr a = run.image();
        // A pixel at the rim of a surface, or on the border between two voxels, may fall on either side.
        double sum = 0;
        for (std::size_t i = 0; i < a->rgba32f().size(); ++i) {
            const glm::vec4 d = a->rgba32f()[i] - b->rgba32f()[i];
            sum += glm::dot(d, d);
        }
        EXPECT_LT(std::sqrt(sum / double(4 * a->rgba32f().size())), memory == 2048 ? 1e-3 : 4e-3) << mode << " " << memory;
    }
}

TEST(BrickPath, EveryCompositingAndReconstructionDrawsWhatTheVolumeShows) {
    for (const char* mode : {", compositing: mip", ", compositing: x-ray", ", compositing: isosurface, iso_value: 150",
                             ", reconstruction: nearest", ", classification: post"})
        expect_same_picture(mode, 1);
    expect_same_picture(", reconstruction: tricubic", 2, {64, 96, 96}, 32);  // its slots are larger
}

TEST(BrickPath, ClassifiedVoxelsDrawWhatTheVolumeShows) { expect_same_picture(", classification: pre", 9); }

TEST(BrickPath, ShadingDrawsWhatTheVolumeShows) {
    for (const char* mode : {"", ", compositing: mip", ", compositing: isosurface, iso_value: 150"})
        expect_same_picture(std::string(", shading: true, gradient: central, gradient_source: on-the-fly") + mode, 2, {64, 96, 96}, 32);
}

TEST(BrickPath, StoredGradientsDrawWhatTheVolumeShows) {
    for (const char* mode : {"", ", compositing: mip", ", compositing: isosurface, iso_value: 150", ", gradient_modulation: [0, 3]"})
        expect_same_picture(std::string(", shading: true") + mode, 5);
}

TEST(BrickPath, ALevelAloneIsDrawnAsAVolumeOfItsOwn) {
    // Of either level's voxels, with its own slices: the level as a volume is the same picture.
    const BricksPtr bricks = pyramid(blob({97, 81, 70}, ScalarType::u16, {1, 1, 2}), 16);
    for (int level : {1, 2}) {
        const VolumePtr alone = level_as_volume(bricks, level, BrickCache::global());
        for (const char* mode : {"", ", shading: true", ", shading: true, gradient_source: on-the-fly", ", classification: pre"}) {
            // The slices of a volume are anchored at its middle, which is not the same here: so thin that it does not show.
            const Camera camera = looking({1, 0.5, -0.4}, alone->desc(), kPerspective);
            const std::string fine = std::string(", slice_distance: 0.1") + mode;
            const ImagePtr a = draw(bricks, level_of(bricks->desc(), level), smooth(240, 0.02), camera, fine).image();
            const ImagePtr b = draw(alone, nullptr, smooth(240, 0.02), camera, fine).image();
            EXPECT_GT(brightest(*b), 0.3);
            double sum = 0;
            for (int y = 12; y < 28; ++y)
                for (int x = 14; x < 34; ++x) sum += glm::distance(a->at(x, y), b->at(x, y)) / (16 * 20);
            EXPECT_LT(sum, 0.02) << level << mode;
        }
    }
}

TEST(BrickPath, WhatIsNotSelectedIsNotDrawn) {
    // Holes that could be seen: every other brick, at the finest level.
    const VolumePtr volume = make_volume({64, 64, 64}, ScalarType::u8, [](auto, auto, auto) { return 100.0; });
    const BricksPtr bricks = pyramid(volume, 16);
    auto half = level_of(bricks->desc(), 0), lower = level_of(bricks->desc(), 0);
    std::erase_if(half->bricks, [](const SelectedBrick& b) { return (b.id.index.x + b.id.index.y + b.id.index.z) % 2; });
    std::erase_if(lower->bricks, [](const SelectedBrick& b) { return b.id.index.z >= 2; });
    Camera camera = looking({0, 0, 1}, volume->desc(), kOrthographic);
    camera.up = {0, 1, 0};
    for (const char* mode : {"", ", skipping: false", ", compositing: x-ray", ", classification: post"}) {
        // Whichever way through the bricks, half of its 63 voxels, 32 or 31, are medium.
        const ImagePtr image = draw(bricks, half, constant_medium(0.02), camera, mode).image();
        EXPECT_NEAR(image->at(20, 20).a, 1 - std::exp(-0.02 * 31.5), 0.02 * 0.6) << mode;
        EXPECT_NEAR(image->at(28, 22).a, 1 - std::exp(-0.02 * 31.5), 0.02 * 0.6) << mode;
        EXPECT_NEAR(draw(bricks, lower, constant_medium(0.02), camera, mode).image()->at(25, 18).a, 1 - std::exp(-0.02 * 32), 1e-4) << mode;
    }
}

TEST(BrickPath, MixedLevelsAreShadedAndClassifiedAlikeStoredOrNot) {
    const BricksPtr bricks = pyramid(blob({64, 64, 64}, ScalarType::u16), 16);
    const Camera camera = looking({1, 0.6, 0.4}, bricks->desc().volume, kPerspective);
    for (const SelectionPtr& s : {SelectionPtr(two_levels(bricks->desc(), 5, true)), SelectionPtr(nested(bricks->desc(), 3))}) {
        const ImagePtr stored = draw(bricks, s, smooth(240), camera, ", shading: true, gradient: central").image();
        const ImagePtr computed =
            draw(bricks, s, smooth(240), camera, ", shading: true, gradient: central, gradient_source: on-the-fly").image();
        double sum = 0;
        for (std::size_t i = 0; i < stored->rgba32f().size(); ++i) sum += glm::distance(stored->rgba32f()[i], computed->rgba32f()[i]) / (48 * 40);
        EXPECT_LT(sum, 2e-3);  // only where levels meet is a gradient of what is mixed another than a mixed gradient
        // Extinction and colour that are linear in the value may be interpolated before or after.
        const ImagePtr pre = draw(bricks, s, smooth(65535), camera, ", classification: pre").image();
        const ImagePtr post = draw(bricks, s, smooth(65535), camera, ", classification: post").image();
        EXPECT_LT(largest_difference(*pre, *post), 2e-4);
    }
}

TEST(BrickPath, WhatIsMissingAndCannotBeSeenIsStillNotSeen) {
    // Seen values in the middle of the range: between what is there and what is not, interpolation crosses
    // them wherever something other than the brick's own values stands in.
    const VolumePtr volume = make_volume({64, 64, 64}, ScalarType::u8, [](auto x, auto y, auto z) {
        return x >= 16 && x < 48 && y >= 16 && y < 40 && z >= 16 ? (x + y + z) % 3 ? 120.0 : 20.0 : x < 32 ? 10.0 : 240.0;
    });
    const BricksPtr bricks = pyramid(volume, 16);
    const TransferPtr tf = transfer({{{60, Emission(0)}, {100, Emission(0.1)}, {140, Emission(0.1)}, {200, Emission(0)}}});
    for (glm::dvec3 from : kViews)
        for (const char* mode : {"", ", skipping: false", ", slice_distance: 5", ", classification: pre", ", compositing: x-ray"}) {
            NodeRun run = draw(bricks, level_of(bricks->desc(), 0), tf, looking(from, volume->desc(), kPerspective), mode);
            EXPECT_GT(run.counters["bricks skipped (transparent)"], 5);
            EXPECT_LT(largest_difference(*run.image(), *draw(volume, nullptr, tf, looking(from, volume->desc(), kPerspective), mode).image()), 2e-4) << mode;
        }
}

TEST(BrickPath, WhatStandsInForABrickOfAnotherLevelIsNotSeen) {
    // Blocks in four octants, away from all faces; one of them is drawn finer. What stands in for it at the coarse
    // level is in the middle of its values, which is seen; the empty octant before it must not show that.
    const VolumePtr volume = make_volume({64, 64, 64}, ScalarType::u8, [](auto x, auto y, auto z) {
        const std::int64_t p[] = {x, y, z};
        int octant = 0;
        bool inside = true;
        for (int a = 0; a < 3; ++a) {
            octant |= (p[a] >= 32) << a;
            inside = inside && (p[a] % 32 > 4) && (p[a] % 32 < 27);
        }
        return inside && (octant == 1 || octant == 2 || octant == 4 || octant == 7) ? 200.0 : 0.0;
    });
    const BricksPtr bricks = pyramid(volume, 16, PyramidFilter::subsample);
    const TransferPtr tf = transfer({{{40, Emission(0)}, {60, Emission(0.2)}, {140, Emission(0.2)}, {160, Emission(0)}}});
    Camera camera = looking({0, 0, 1}, volume->desc(), kOrthographic);
    camera.up = {0, 1, 0};
    for (bool blended : {false, true})
        for (const char* mode : {"", ", skipping: false", ", compositing: x-ray, skipping: false"}) {
            const ImagePtr image = draw(bricks, two_levels(bricks->desc(), 7, blended), tf, camera, mode).image();
            EXPECT_GT(brightest(*image), 0.1);
            // Rays about the middle go along faces, past all blocks.
            for (int p = 0; p < 4; ++p) EXPECT_EQ(image->at(23 + p % 2, 19 + p / 2).a, 0) << blended << mode << p;
        }
}

TEST(BrickPath, SkippingChangesNothing) {
    const VolumePtr volume = make_volume({60, 50, 70}, ScalarType::u8, [](auto x, auto y, auto z) {
        return glm::distance(glm::dvec3(x, y, z), glm::dvec3(30, 20, 40)) < 12 || (x == 7 && y == 9) ? 200.0 : double((x * y + z) % 20);
    });
    const BricksPtr bricks = pyramid(volume, 16);
    const TransferPtr tf = transfer({{{50, Emission(0)}, {60, Emission(0.4)}}});
    for (glm::dvec3 from : kViews)
        for (const SelectionPtr& s : {SelectionPtr(level_of(bricks->desc(), 0)), SelectionPtr(two_levels(bricks->desc(), 0, true)), SelectionPtr(nested(bricks->desc(), 2))})
            for (double distance : {0.2, 1.5}) {
                const Camera camera = looking(from, volume->desc(), kPerspective, distance);
                NodeRun with = draw(bricks, s, tf, camera);
                if (s->bricks.size() > 10) {
                    EXPECT_LT(with.counters["blocks drawn"], 0.8 * with.counters["blocks"]);
                }
                EXPECT_LT(largest_difference(*with.image(), *draw(bricks, s, tf, camera, ", skipping: false").image()), 2e-4) << s->bricks.size() << " " << distance;
            }
}

TEST(BrickPath, BlendedFacesBetweenLevelsAgree) {
    // Values that differ between levels everywhere, so dense that a parallel view shows the ones where it
    // begins. It begins on a face between levels, and looks into either brick, along an axis on which
    // they do not change.
    const TransferPtr tf = transfer({{{0, Emission(0, 0, 0, 1e6)}, {65535, Emission(1e6, 5e5, 0, 1e6)}}});
    for (int axis = 0; axis < 3; ++axis) {
        const BricksPtr bricks = pyramid(make_volume({64, 64, 64}, ScalarType::u16, [axis](auto x, auto y, auto z) {
            const std::int64_t p[] = {x, y, z};
            return double((p[(axis + 1) % 3] * 7919 + p[(axis + 2) % 3] * 104729) % 65536);
        }), 16);
        auto looking_along = [&](double direction, bool blended) {
            Camera camera;
            camera.projection = kOrthographic;
            camera.eye = {30.3, 31.1, 32.6};
            camera.eye[axis] = 32 + 1e-5 * direction;
            camera.target = camera.eye;
            camera.target[axis] += direction;
            camera.up = glm::dvec3(0);
            camera.up[(axis + 1) % 3] = 1;
            camera.height = 50;
            return draw(bricks, two_levels(bricks->desc(), 0, blended), tf, camera, ", slice_distance: 0.01").image();
        };
        auto step = [&](bool blended) {
            const ImagePtr fine = looking_along(-1, blended), coarse = looking_along(1, blended);
            double most = 0;
            for (int y = 0; y < 40; ++y)
                for (int x = 0; x < 48; ++x)
                    most = std::max(most, double(std::abs(fine->at(x, y).r - coarse->at(47 - x, y).r)));
            return most;
        };
        EXPECT_GT(step(false), 0.05);
        // The slab behind the face is a hundredth of a voxel deep, and no longer all blended at its end.
        EXPECT_LT(step(true), 3e-4);
    }
}

TEST(BrickPath, SamplesOnFacesBetweenLevelsAgree) {
    // The same points of a face, read from the fine bricks and from the coarse one: a plane in the face is drawn
    // from the side that its normal points to.
    const TransferPtr tf = transfer({{{0, Emission(0, 0, 0, 1)}, {65535, Emission(1, 0.5, 0, 1)}}});
    for (int memory : {2048, 2})
        for (int axis = 0; axis < 3; ++axis) {
            const BricksPtr bricks = pyramid(make_volume({64, 64, 64}, ScalarType::u16, [](auto x, auto y, auto z) {
                return double((x * 7919 + y * 104729 + z * 1299709) % 65536);
            }), 16);
            glm::dvec3 normal(0), centre(31.5);
            normal[axis] = 1;
            centre[axis] = 32;
            auto camera = std::make_shared<Camera>(looking(normal + glm::dvec3(0.3, 0.2, 0.1), bricks->desc().volume, kOrthographic));
            camera->height = 60;
            auto side = [&](double direction, bool blended) {
                auto s = two_levels(bricks->desc(), 0, blended);
                s->plane = plane_through(centre, direction * normal);
                NodeInputs inputs;
                inputs["source"] = {bricks};
                inputs["selection"] = {SelectionPtr(s)};
                inputs["transfer"] = {tf};
                inputs["camera"] = {CameraPtr(camera)};
                return run_node(linked_plugin(), "slicer.plane", "{size: [80, 80], gpu_memory: " + std::to_string(memory) + "}", inputs).image();
            };
            EXPECT_GT(largest_difference(*side(1, false), *side(-1, false)), 0.05);
            EXPECT_LT(largest_difference(*side(1, true), *side(-1, true)), 1e-5) << axis;
        }
}

TEST(BrickPath, TheAtlasKeepsItsLimitAndItsBricks) {
    const VolumePtr volume = blob({64, 64, 64});
    const BricksPtr bricks = pyramid(volume, 8);
    const Camera camera = looking({1, 1, 1}, volume->desc(), kPerspective);
    NodeRun first = draw(bricks, level_of(bricks->desc(), 0), smooth(240), camera);
    EXPECT_EQ(first.counters["bricks uploaded"], 512);
    NodeRun again = draw(bricks, level_of(bricks->desc(), 0), smooth(240), looking({1, 0, 0}, volume->desc(), kPerspective));
    EXPECT_EQ(again.counters["bricks uploaded"], 0);
    EXPECT_EQ(again.counters["bricks resident"], 512);
    NodeRun coarser = draw(bricks, level_of(bricks->desc(), 1), smooth(240), camera);
    EXPECT_EQ(coarser.counters["bricks uploaded"], 64);

    const BricksPtr large = pyramid(blob({128, 128, 128}), 32);
    try {
        draw(large, level_of(large->desc(), 0), smooth(240), camera, ", gpu_memory: 1");
        FAIL();
    } catch (const Error& e) {
        EXPECT_THAT(e.what(), ::testing::HasSubstr("gpu_memory"));
    }
}

TEST(BrickPath, ANewCameraBuildsNothing) {
    // What can be seen where depends on bricks, selection and transfer function, and is found once for each.
    const VolumePtr volume = blob({64, 64, 64});
    const BricksPtr bricks = pyramid(volume, 8);
    const SelectionPtr mixed = two_levels(bricks->desc(), 3, true), fine = level_of(bricks->desc(), 0);
    const TransferPtr all = smooth(240), bright = transfer({{{120, Emission(0)}, {240, Emission(0.05, 0.02, 0, 0.05)}}});
    auto built = [&](const SelectionPtr& selection, const TransferPtr& tf, glm::dvec3 from, const char* more = "") {
        NodeRun run = draw(bricks, selection, tf, looking(from, volume->desc(), kPerspective), more);
        EXPECT_GT(run.counters["blocks drawn"], 0);
        return run.counters["tables of blocks built"];
    };
    for (const SelectionPtr& s : {mixed, fine}) {
        EXPECT_EQ(built(s, all, {1, 1, 1}), 1);
        EXPECT_EQ(built(s, all, {1, 0, 0.2}), 0);
        EXPECT_EQ(built(s, bright, {1, 0, 0.2}), 1);
        EXPECT_EQ(built(s, bright, {-1, 0.3, 0.2}, ", shading: true"), 0);
        EXPECT_EQ(built(s, bright, {-1, 0.3, 0.2}, ", reconstruction: tricubic"), 1);
    }
    EXPECT_EQ(built(mixed, all, {0, 1, 1}), 0);
}

TEST(BrickPath, BricksComeAndGoWithoutATrace) {
    // A limit that holds one of two selections: each picture evicts the other's bricks.
    const VolumePtr volume = blob({128, 128, 128});
    const BricksPtr bricks = pyramid(volume, 16);
    const Camera camera = looking({1, 1, 1}, volume->desc(), kPerspective);
    auto half = [&](bool upper) {
        auto s = level_of(bricks->desc(), 0);
        std::erase_if(s->bricks, [&](const SelectedBrick& b) { return (b.id.index.x >= 4) != upper; });
        return SelectionPtr(s);
    };
    const ImagePtr a = draw(bricks, half(false), smooth(240), camera, ", gpu_memory: 4").image();
    const ImagePtr b = draw(bricks, half(true), smooth(240), camera, ", gpu_memory: 4").image();
    EXPECT_GT(largest_difference(*a, *b), 0.1);
    NodeRun back = draw(bricks, half(false), smooth(240), camera, ", gpu_memory: 4");
    EXPECT_GT(back.counters["bricks evicted"], 0);
    EXPECT_LT(largest_difference(*a, *back.image()), 1e-5);  // other slots round otherwise
}

TEST(BrickPath, MixturesLeaveNoTrace) {
    // Selections in turn, each of which mixes other bricks: every picture is the one that fresh bricks give, side by
    // side in the texture or in slots.
    const VolumePtr smooth_one = blob({64, 64, 64});
    const VolumePtr noise = make_volume({64, 64, 64}, ScalarType::u8, [](auto x, auto y, auto z) { return double((x * 7919 + y * 104729 + z * 1299709) % 251); });
    const TransferPtr all = smooth(240), some = transfer({{{100, Emission(0)}, {120, Emission(0.3)}, {140, Emission(0.3)}, {160, Emission(0)}}});
    const BricksPtr kept[] = {pyramid(smooth_one, 8), pyramid(noise, 8)};
    std::mt19937 random(3);
    for (int turn = 0; turn < 80; ++turn) {
        const bool slots = turn % 3 == 0;  // they round otherwise in another place, which noise would not forgive
        const VolumePtr& volume = slots ? smooth_one : noise;
        const BricksPtr& bricks = kept[!slots];
        std::array<int, 8> depth;
        for (int& d : depth) d = int(random() % 3);
        const SelectionPtr s = octants(bricks->desc(), depth, random() % 4 > 0);
        const TransferPtr tf = random() % 2 ? all : some;
        const Camera camera = looking(kViews[random() % 6], volume->desc(), kPerspective);
        const std::string mode = std::string(random() % 2 ? ", shading: true" : "") + ", table_size: 64, gpu_memory: " + (slots ? "8" : "2048");
        const ImagePtr image = draw(bricks, s, tf, camera, mode).image();
        EXPECT_LT(largest_difference(*image, *draw(pyramid(volume, 8), s, tf, camera, mode).image()), slots ? 1e-4 : 1e-6) << turn << mode;
    }
}

TEST(BrickPath, PagesOfALevelAreOneWhetherTheyBlendOrNot) {
    const BricksPtr bricks = pyramid(blob({128, 128, 128}, ScalarType::u16), 16);
    NodeRun run = draw(bricks, two_levels(bricks->desc(), 5, true), smooth(65535), looking({1, 0.6, 0.4}, bricks->desc().volume, kPerspective));
    EXPECT_LT(run.counters["pages drawn"], 0.6 * run.counters["bricks drawn"]);
    // A parent that is mixed in is no brick of the picture.
    EXPECT_EQ(run.counters["bricks drawn"], double(two_levels(bricks->desc(), 5, true)->bricks.size()));
}

TEST(BrickPath, TheLimitHoldsWhateverIsLookedAt) {
    // A camera that jumps: other bricks, other levels, other textures beside the values' own.
    const BricksPtr bricks = pyramid(blob({128, 128, 128}), 16);
    const BricksDesc& desc = bricks->desc();
    std::mt19937 random(7);
    std::size_t evicted = 0;
    for (int jump = 0; jump < 40; ++jump) {
        const int level = int(random() % 3), memory = 2 + int(random() % 3);
        auto s = level_of(desc, level);
        std::shuffle(s->bricks.begin(), s->bricks.end(), random);
        s->bricks.resize(std::min<std::size_t>(s->bricks.size(), 20));
        if (level == 2) s = nested(desc, int(random() % 8));
        const char* modes[] = {"", ", shading: true", ", classification: post", ", compositing: mip"};
        NodeRun run = draw(bricks, s, smooth(240), looking(kViews[random() % 6], desc.volume, kPerspective),
                           std::string(modes[random() % 4]) + ", table_size: 64, gpu_memory: " + std::to_string(memory));
        EXPECT_GT(run.measured("GPU memory"), 0);
        EXPECT_LE(run.measured("GPU memory"), double(memory << 20)) << jump;
        evicted += std::size_t(run.counters["bricks evicted"]);
    }
    EXPECT_GT(evicted, 0u);
    // Nothing can be drawn without room for the tables and one brick.
    for (int memory : {0, 1})
        try {
            draw(bricks, level_of(desc, 0), smooth(240), looking({1, 1, 1}, desc.volume, kPerspective), ", gpu_memory: " + std::to_string(memory));
            FAIL() << memory;
        } catch (const Error& e) {
            EXPECT_THAT(e.what(), ::testing::HasSubstr("raise gpu_memory"));
        }
}

TEST(BrickPath, VoxelsThatAreNotNumbersAreTransparent) {
    const VolumePtr volume = make_volume({40, 40, 40}, ScalarType::f32, [](auto x, auto y, auto z) {
        return x > 10 && x < 16 && y > 5 && z > 5 ? std::nan("") : 0.5 + 0.01 * double(x);
    });
    const BricksPtr bricks = pyramid(volume, 16);
    for (glm::dvec3 from : kViews) {
        const Camera camera = looking(from, volume->desc(), kPerspective);
        EXPECT_LT(largest_difference(*draw(bricks, level_of(bricks->desc(), 0), smooth(1), camera, ", slice_distance: 0.5").image(),
                                     *draw(volume, nullptr, smooth(1), camera, ", slice_distance: 0.5").image()), 5e-3);
    }
}

TEST(BrickPath, ThinVolumesAndTheirEdges) {
    for (Index3 dims : {Index3(1, 40, 40), Index3(33, 1, 1), Index3(17, 9, 2)}) {
        const VolumePtr volume = blob(dims, ScalarType::u8, {0.5, 0.5, 5});
        const BricksPtr bricks = pyramid(volume, 8);
        const Camera camera = looking({1, 0.7, 0.4}, volume->desc(), kPerspective);
        const ImagePtr a = draw(bricks, level_of(bricks->desc(), 0), smooth(240, 0.5), camera, ", slice_distance: 0.5").image();
        const ImagePtr b = draw(volume, nullptr, smooth(240, 0.5), camera, ", slice_distance: 0.5").image();
        EXPECT_GT(brightest(*b), 0.1);
        EXPECT_LT(largest_difference(*a, *b), 2e-3);
    }
}

TEST(BrickPath, RefusesASelectionOfOtherBricks) {
    const BricksPtr bricks = pyramid(blob({40, 40, 40}), 8), others = pyramid(blob({40, 40, 48}), 8);
    EXPECT_THROW(draw(bricks, level_of(others->desc(), 0), smooth(240), Camera()), Error);
}
