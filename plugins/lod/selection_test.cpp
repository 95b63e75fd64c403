#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

#include "core/data/dense_pyramid.h"
#include "plugins/lod/error_model.h"
#include "plugins/lod/nodes.h"
#include "plugins/lod/priority.h"
#include "plugins/lod/synthetic_bricks.h"
#include "tests/support/run_node.h"
#include "tests/support/volumes.h"

namespace voxloom::lod {
namespace {

using ::testing::HasSubstr;
using voxloom::testing::make_volume;
using voxloom::testing::NodeInputs;
using voxloom::testing::NodeRun;
using voxloom::testing::params_from_yaml;
using voxloom::testing::run_node;

BricksPtr synthetic(Index3 dims, int brick, ErrorFormula error = shell_error, glm::dvec3 spacing = glm::dvec3(1)) {
    return std::make_shared<SyntheticBricks>(dims, glm::ivec3(brick), std::move(error), spacing);
}

// Looks at the middle from a direction; `distance` in diagonals.
CameraPtr camera_at(const BricksDesc& desc, glm::dvec3 from, double distance,
                    Camera::Projection projection = Camera::Projection::perspective) {
    const SamplingBox box = sampling_box(desc.volume);
    const glm::dmat4& m = desc.volume.index_to_world;
    const double diagonal = glm::length(glm::dmat3(m) * (box.hi - box.lo));
    auto camera = std::make_shared<Camera>();
    camera->projection = projection;
    camera->target = glm::dvec3(m * glm::dvec4(0.5 * (box.lo + box.hi), 1));
    camera->eye = camera->target + glm::normalize(from) * diagonal * distance;
    camera->up = {0.1, 0.2, 0.9};
    camera->vertical_fov = 0.7;
    camera->height = diagonal;
    return camera;
}

NodeRun run(const NodeType& node, const BricksPtr& bricks, const CameraPtr& camera, const std::string& params,
            const TransferPtr& transfer = nullptr) {
    NodeInputs inputs{{"bricks", {bricks}}};
    if (camera) inputs["camera"] = {camera};
    if (transfer) inputs["transfer"] = {transfer};
    return run_node(node, params_from_yaml(node, params), inputs);
}
SelectionPtr selection_of(const NodeRun& run) { return run.output<Selection>("selection"); }

// What every entry draws, in voxels of level 0.
std::vector<Box> boxes_of(const SelectedBrick& b, const BricksDesc& desc) {
    if (b.octants == 0xff || b.id.level == 0) return {desc.fine_box_of(b.id)};
    std::vector<Box> boxes;
    for (int o = 0; o < 8; ++o)
        if (b.octants >> o & 1) boxes.push_back(fine_box_of_octant(desc, b.id, o));
    return boxes;
}

std::size_t distinct_bricks(const Selection& s) {
    std::set<std::array<int, 4>> ids;
    for (const SelectedBrick& b : s.bricks) ids.insert({b.id.level, b.id.index.x, b.id.index.y, b.id.index.z});
    return ids.size();
}

// How often each voxel of level 0 is drawn.
std::vector<int> coverage(const Selection& s) {
    const BricksDesc& desc = *s.of;
    std::vector<int> count(desc.volume.voxels());
    for (const SelectedBrick& b : s.bricks)
        for (const Box& box : boxes_of(b, desc))
            for (auto z = box.lo.z; z < box.hi.z; ++z)
                for (auto y = box.lo.y; y < box.hi.y; ++y)
                    for (auto x = box.lo.x; x < box.hi.x; ++x)
                        ++count[std::size_t((z * desc.volume.dims.y + y) * desc.volume.dims.x + x)];
    return count;
}

// Every voxel that projects into the picture is drawn once, none twice.
void expect_covers_the_view(const Selection& s, const std::string& what) {
    const BricksDesc& desc = *s.of;
    const std::vector<int> count = coverage(s);
    const Camera& c = *s.camera;
    const bool perspective = c.projection == Camera::Projection::perspective;
    const double half = 0.5 * c.unit_height(), wide = half * s.size.x / s.size.y;
    std::size_t i = 0, missing = 0, twice = 0, seen = 0;
    for (std::int64_t z = 0; z < desc.volume.dims.z; ++z)
        for (std::int64_t y = 0; y < desc.volume.dims.y; ++y)
            for (std::int64_t x = 0; x < desc.volume.dims.x; ++x, ++i) {
                const glm::dvec3 p(desc.volume.index_to_world * glm::dvec4(x, y, z, 1));
                const glm::dvec3 eye(glm::dot(p - c.eye, c.right()), glm::dot(p - c.eye, c.true_up()),
                                     glm::dot(p - c.eye, c.forward()));
                const double scale = perspective ? eye.z : 1;
                const bool visible = eye.z > 1e-9 && std::abs(eye.x) < wide * scale && std::abs(eye.y) < half * scale;
                seen += visible;
                missing += visible && count[i] == 0;
                twice += count[i] > 1;
            }
    EXPECT_GT(seen, 0u) << what;
    EXPECT_EQ(missing, 0u) << what;
    EXPECT_EQ(twice, 0u) << what;
}

const glm::dvec3 kDirections[] = {{1, 0, 0}, {0, -1, 0}, {0, 0, 1}, {1, 1, 0}, {1, 1, 1}, {-1, 2, 0.3}, {0.2, -0.1, -1}};

// --- projective --------------------------------------------------------------------------------

TEST(Projective, DrawnBricksAreFineEnoughAndTheirParentsAreNot) {
    for (glm::dvec3 spacing : {glm::dvec3(1), glm::dvec3(0.5, 0.5, 5), glm::dvec3(1e-9)}) {
        const BricksPtr bricks = synthetic({200, 150, 120}, 8, shell_error, spacing);
        const BricksDesc& desc = bricks->desc();
        for (glm::dvec3 from : kDirections)
            for (double distance : {0.05, 0.4, 3.0}) {
                const SelectionPtr s = selection_of(run(projective_node(), bricks, camera_at(desc, from, distance), "{}"));
                const Sight sight(*s->camera, s->size, desc);
                auto pixels = [&](BrickId id) {
                    return sight.pixels(id.level, sight.depth(region_of(desc.volume, desc.fine_box_of(id))));
                };
                for (const SelectedBrick& b : s->bricks) {
                    EXPECT_TRUE(b.id.level == 0 || pixels(b.id) <= 1);
                    if (const auto parent = desc.coarser(b.id)) {
                        EXPECT_GT(pixels(*parent), 1);
                    }
                }
            }
    }
}

TEST(Projective, CoversWhatIsSeenOnce) {
    const BricksPtr bricks = synthetic({60, 37, 41}, 8);
    for (auto projection : {Camera::Projection::perspective, Camera::Projection::orthographic})
        for (glm::dvec3 from : kDirections)
            for (double distance : {0.0, 0.2, 0.6, 4.0}) {
                const CameraPtr camera = camera_at(bricks->desc(), from, distance, projection);
                expect_covers_the_view(*selection_of(run(projective_node(), bricks, camera, "{size: [60, 40]}")),
                                       fmt::format("{} {} {} at {}", from.x, from.y, from.z, distance));
            }
}

TEST(Projective, AtTheEyeTheFinestBricksAreDrawn) {
    const BricksPtr bricks = synthetic({256, 256, 256}, 16);
    auto camera = std::make_shared<Camera>(*camera_at(bricks->desc(), {1, 0, 0}, 0.001));
    const SelectionPtr s = selection_of(run(projective_node(), bricks, camera, "{size: [32, 32]}"));
    const Index3 eye(glm::floor(camera->eye));
    bool found = false;
    for (const SelectedBrick& b : s->bricks) {
        const Box box = s->of->fine_box_of(b.id);
        if (box.contains({eye, eye + Index3(1)})) {
            EXPECT_EQ(b.id.level, 0);
            found = true;
        }
    }
    EXPECT_TRUE(found);
}

// --- order -------------------------------------------------------------------------------------

TEST(Order, AlongEveryRayBricksComeBackToFront) {
    const BricksPtr bricks = synthetic({64, 48, 40}, 8);
    std::mt19937 random(1);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (auto projection : {Camera::Projection::perspective, Camera::Projection::orthographic})
        for (glm::dvec3 from : kDirections)
            for (double distance : {0.0, 0.3, 2.0}) {
                // Distance 0 is the middle, a corner of eight bricks.
                CameraPtr camera = camera_at(bricks->desc(), from, distance, projection);
                const SelectionPtr s = selection_of(
                    run(priority_node(), bricks, camera, "{max_bricks: 60, max_error: 0, pixels: 0.0625, size: [32, 32]}"));
                ASSERT_GT(s->bricks.size(), 3u);
                for (int i = 0; i < 60; ++i) {
                    const Ray ray = camera->ray(32 * uniform(random), 32 * uniform(random), 32, 32);
                    std::vector<std::pair<double, std::size_t>> hits;  // where it enters, index in the list
                    for (std::size_t b = 0; b < s->bricks.size(); ++b)
                        for (const Box& box : boxes_of(s->bricks[b], *s->of)) {
                            double in = projection == Camera::Projection::perspective ? 0 : -1e30, out = 1e30;
                            for (int a = 0; a < 3; ++a) {
                                const double t0 = (double(box.lo[a]) - ray.origin[a]) / ray.direction[a];
                                const double t1 = (double(box.hi[a]) - ray.origin[a]) / ray.direction[a];
                                in = std::max(in, std::min(t0, t1));
                                out = std::min(out, std::max(t0, t1));
                            }
                            if (out > in + 1e-6) hits.emplace_back(in, b);
                        }
                    std::ranges::sort(hits);
                    for (std::size_t h = 1; h < hits.size(); ++h) EXPECT_GE(hits[h - 1].second, hits[h].second);
                }
            }
}

// --- priority ----------------------------------------------------------------------------------

TEST(Priority, TwoLevelsAreRefinedAsTheBestOfAllSubsets) {
    // One root, eight children without error: the best choice of n bricks is found by trying all.
    std::mt19937 random(7);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (int trial = 0; trial < 20; ++trial) {
        std::array<double, 8> errors;
        for (double& e : errors) e = uniform(random);
        const BricksPtr bricks = synthetic({16, 16, 16}, 8, [&](int, glm::dvec3 m) {
            return errors[std::size_t(int(m.x > 0.5) | int(m.y > 0.5) << 1 | int(m.z > 0.5) << 2)];
        });
        const CameraPtr camera = camera_at(bricks->desc(), kDirections[std::size_t(trial % 7)], 2);
        const Sight sight(*camera, {4096, 4096}, bricks->desc());
        for (int budget = 1; budget <= 8; ++budget) {
            double best = 1e300;
            for (unsigned subset = 0; subset < 256; ++subset) {
                const int count = std::popcount(subset) + (subset != 255);
                if (count > budget) continue;
                double sum = 0;
                for (int o = 0; o < 8; ++o)
                    if (!(subset >> o & 1)) {
                        const Region r = region_of(bricks->desc().volume, fine_box_of_octant(bricks->desc(), {1, {0, 0, 0}}, o));
                        sum += std::pow(errors[std::size_t(o)] * sight.nearness(sight.depth(r)), 2) * 512;
                    }
                best = std::min(best, sum);
            }
            PriorityLimits limits;
            limits.bricks = budget;
            const PriorityResult result = select_by_priority(bricks->desc(), value_errors(bricks), sight, limits);
            EXPECT_NEAR(result.sum, std::sqrt(best), 1e-9 * std::sqrt(best)) << budget;
            EXPECT_LE(std::int64_t(result.cut.bricks()), budget);
        }
    }
}

TEST(Priority, ErrorFallsWithTheBudgetWhichIsKept) {
    // Errors that are not monotone along the tree, as those of some filters.
    const BricksPtr bricks = synthetic({250, 130, 190}, 8, [](int level, glm::dvec3 m) {
        return 0.02 + 0.01 * std::sin(40 * m.x + level) * std::cos(31 * m.y) + (m.z > 0.7 ? 0.1 : 0.0);
    });
    for (double distance : {0.1, 1.0}) {
        const CameraPtr camera = camera_at(bricks->desc(), {1, 0.5, 0.2}, distance);
        double last = 1e300;
        std::size_t most = 0;
        for (int budget : {1, 2, 3, 5, 8, 13, 21, 50, 100, 400, 1000}) {
            const NodeRun r = run(priority_node(), bricks, camera,
                                  fmt::format("{{max_bricks: {}, max_error: 0, pixels: 0.0625}}", budget));
            EXPECT_LE(distinct_bricks(*selection_of(r)), std::size_t(budget));
            EXPECT_LE(r.measured("sum"), last);
            EXPECT_TRUE(r.warnings.empty());
            last = r.measured("sum");
            most = std::max(most, distinct_bricks(*selection_of(r)));
        }
        EXPECT_GT(most, 900u);
    }
}

TEST(Priority, CoversWhatIsSeenOnceAtEveryBudget) {
    const BricksPtr bricks = synthetic({60, 37, 41}, 8);
    for (glm::dvec3 from : kDirections)
        for (double distance : {0.0, 0.2, 2.0})
            for (int budget : {1, 4, 11, 200})
                expect_covers_the_view(
                    *selection_of(run(priority_node(), bricks, camera_at(bricks->desc(), from, distance),
                                      fmt::format("{{max_bricks: {}, max_error: 0, size: [60, 40], pixels: 0.0625}}", budget))),
                    fmt::format("budget {}", budget));
}

TEST(Priority, NoBrickIsWorseThanItsPromiseWhereTheBudgetAllows) {
    const BricksPtr bricks = synthetic({256, 256, 256}, 8);
    for (double error : {0.05, 0.02, 0.004}) {
        const NodeRun r = run(priority_node(), bricks, camera_at(bricks->desc(), {1, 0, 0}, 1.2),
                              fmt::format("{{max_bricks: 1000000, max_error: {}, size: [2048, 2048]}}", error));
        EXPECT_LE(r.measured("predicted pixel error"), error);
        EXPECT_GT(r.measured("predicted pixel error"), 0.1 * error) << "far more than was asked for";
    }
}

TEST(Priority, GoesWhereTheErrorIs) {
    const BricksPtr bricks = synthetic({256, 256, 256}, 16, [](int level, glm::dvec3 m) {
        return glm::distance(m, glm::dvec3(0.8, 0.8, 0.8)) < 0.05 * (1 << level) ? 0.1 : 0.0;
    });
    const SelectionPtr s = selection_of(run(priority_node(), bricks, camera_at(bricks->desc(), {1, 1, 1}, 1),
                                            "{max_bricks: 40, max_error: 0, pixels: 0.0625}"));
    for (const SelectedBrick& b : s->bricks)
        if (b.id.level == 0) {
            EXPECT_LT(glm::distance(glm::dvec3(b.id.index) * 16.0, glm::dvec3(0.8 * 256)), 80);
        }
    EXPECT_TRUE(std::ranges::any_of(s->bricks, [](const SelectedBrick& b) { return b.id.level == 0; }));
}

TEST(Priority, IsTheSameEveryTimeAndAHairsBreadthAsideIsMuchTheSame) {
    const BricksPtr bricks = synthetic({128, 128, 128}, 8);
    for (glm::dvec3 from : kDirections) {
        auto listing = [&](double aside) {
            auto camera = std::make_shared<Camera>(*camera_at(bricks->desc(), from, 1));
            camera->eye.y += aside;
            std::vector<std::array<int, 5>> ids;
            const SelectionPtr s = selection_of(run(priority_node(), bricks, camera, "{max_bricks: 200, max_error: 0}"));
            for (const SelectedBrick& b : s->bricks)
                ids.push_back({b.id.level, b.id.index.x, b.id.index.y, b.id.index.z, b.octants});
            return ids;
        };
        const auto first = listing(0);
        EXPECT_EQ(first, listing(0));
        auto a = first, b = listing(1e-7);
        std::ranges::sort(a);
        std::ranges::sort(b);
        std::vector<std::array<int, 5>> common;
        std::ranges::set_intersection(a, b, std::back_inserter(common));
        EXPECT_GT(double(common.size()), 0.9 * double(a.size()));
    }
}

TEST(Priority, TakesVolumesWithoutVoxelsOrLevels) {
    const BricksPtr empty = synthetic({0, 5, 5}, 8);
    auto camera = std::make_shared<Camera>();
    EXPECT_TRUE(selection_of(run(priority_node(), empty, camera, "{}"))->bricks.empty());
    const BricksPtr one = synthetic({1, 1, 1}, 8);
    camera = std::make_shared<Camera>(*camera_at(one->desc(), {1, 0, 0}, 3));
    EXPECT_EQ(selection_of(run(priority_node(), one, camera, "{}"))->bricks.size(), 1u);
    const BricksPtr flat = std::make_shared<SyntheticBricks>(Index3(64, 64, 64), glm::ivec3(16), shell_error, glm::dvec3(1), true);
    const NodeRun r = run(priority_node(), flat, camera_at(flat->desc(), {1, 1, 1}, 3), "{max_bricks: 10}");
    EXPECT_EQ(selection_of(r)->bricks.size(), 64u);
    ASSERT_EQ(r.warnings.size(), 1u);
    EXPECT_THAT(r.warnings[0], HasSubstr("64 bricks"));
}

TEST(Priority, ThinAndAnisotropicVolumesHalveTheAxesTheyCan) {
    for (Index3 dims : {Index3(512, 512, 1), Index3(300, 1, 1), Index3(97, 101, 3)}) {
        const BricksPtr bricks = synthetic(dims, 16, [](int l, glm::dvec3) { return 0.01 * l; }, {0.5, 0.5, 5});
        const SelectionPtr s = selection_of(run(priority_node(), bricks, camera_at(bricks->desc(), {0.3, 0.2, 1}, 1),
                                                "{max_error: 0, size: [2048, 2048], max_bricks: 100000}"));
        EXPECT_TRUE(std::ranges::all_of(s->bricks, [](const SelectedBrick& b) { return b.id.level == 0; }));
        EXPECT_EQ(s->predicted_error, 0);
    }
}

// --- after classification ------------------------------------------------------------------------

TransferPtr transfer(std::vector<TransferFunction1D::Point> points) {
    auto tf = std::make_shared<TransferFunction>();
    tf->one.points = std::move(points);
    return tf;
}

TEST(TransferAware, LargestChangeBoundsWhatSamplingFinds) {
    const TransferPtr tf = transfer({{0, Emission(0)}, {0.3, Emission(0)}, {0.3, {0.1, 0, 0.4, 0.5}},
                                     {0.5, {1, 0.2, 0, 2}}, {0.9, Emission(0)}});
    std::mt19937 random(3);
    std::uniform_real_distribution<double> uniform(-0.2, 1.2);
    for (int i = 0; i < 2000; ++i) {
        double lo = uniform(random), hi = uniform(random);
        if (lo > hi) std::swap(lo, hi);
        const double distance = 0.5 * std::abs(uniform(random));
        const double bound = largest_change(*tf, lo, hi, distance);
        for (int k = 0; k < 20; ++k) {
            const double a = lo + (hi - lo) * k / 19, b = std::min(hi, a + distance);
            const Emission d = glm::abs(tf->one.at(a) - tf->one.at(b));
            EXPECT_LE(std::max({d.r, d.g, d.b}) + d.a, bound + 1e-12);
        }
    }
    EXPECT_EQ(largest_change(*tf, 0.95, 2, 1), 0);
    EXPECT_EQ(largest_change(*tf, 0, 1, 0), 0);
    EXPECT_EQ(largest_change(*tf, -1e308, 1e308, std::numeric_limits<double>::infinity()), 3);
}

TEST(TransferAware, TransparentBricksAreLeftOutAndCostNothing) {
    // Values rise along x from 0 to 1; the transfer function begins at 0.75.
    const VolumePtr volume = make_volume({129, 40, 40}, ScalarType::f32, [](auto x, auto, auto) { return double(x) / 128; });
    const BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(16), PyramidFilter::average);
    const TransferPtr tf = transfer({{0.75, Emission(0)}, {1, Emission(1)}});
    const SelectionPtr s = selection_of(run(transfer_aware_node(), bricks, camera_at(bricks->desc(), {0, 0, 1}, 1.5),
                                            "{max_error: 0, max_bricks: 100000, pixels: 0.0625}", tf));
    ASSERT_FALSE(s->bricks.empty());
    for (const SelectedBrick& b : s->bricks)
        for (const Box& box : boxes_of(b, *s->of)) EXPECT_GT(double(box.hi.x) / 128, 0.75 - 16.0 / 128);
    // What is seen is there.
    const std::vector<int> count = coverage(*s);
    for (std::size_t i = 0; i < count.size(); ++i)
        if (double(i % 129) / 128 > 0.75) {
            EXPECT_EQ(count[i], 1);
        }
    EXPECT_TRUE(selection_of(run(transfer_aware_node(), bricks, camera_at(bricks->desc(), {0, 0, 1}, 1.5), "{}",
                                 transfer({{0, Emission(0)}})))->bricks.empty());
}

// --- plane -----------------------------------------------------------------------------------------

TEST(Plane, ItsPointsAreCoveredOnceWhateverItsPlace) {
    const BricksPtr bricks = synthetic({64, 48, 33}, 8);
    const BricksDesc& desc = bricks->desc();
    std::mt19937 random(5);
    std::uniform_real_distribution<double> uniform(0, 1);
    // On faces, edges and corners of bricks, on diagonals, and anywhere.
    struct {
        glm::dvec3 normal, origin;
    } planes[] = {{{0, 0, 1}, {0, 0, 16.0 / 32}}, {{1, 0, 0}, {32.0 / 63, 0, 0}}, {{-1, 0, 0}, {32.0 / 63, 0, 0}},
                  {{0, 1, 0}, {0, 0, 0}}, {{0, 1, 0}, {0, 1, 0}}, {{1, 1, 0}, {0.5, 0.5, 0.5}}, {{1, 1, 1}, {0.5, 0.5, 0.5}},
                  {{1, -1, 0}, {0, 0, 0}}, {{0.3, -0.7, 0.2}, {0.4, 0.6, 0.2}}};
    for (const auto& plane : planes)
        for (double kappa : {0.0, 1.0, 3.0}) {
            const SelectionPtr s = selection_of(run(plane_node(), bricks, nullptr,
                fmt::format("{{normal: [{}, {}, {}], origin: [{}, {}, {}], point: [0.3, 0.6, 0.5], distance_factor: {}}}",
                            plane.normal.x, plane.normal.y, plane.normal.z, plane.origin.x, plane.origin.y, plane.origin.z, kappa)));
            ASSERT_TRUE(s->plane);
            const glm::dvec3 n(*s->plane);
            int tried = 0;
            for (int i = 0; i < 400; ++i) {
                glm::dvec3 p(uniform(random) * 63, uniform(random) * 47, uniform(random) * 32);
                p -= n * (glm::dot(n, p) + s->plane->w);
                if (glm::any(glm::lessThan(p, glm::dvec3(0))) || glm::any(glm::greaterThan(p, glm::dvec3(63, 47, 32)))) continue;
                ++tried;
                int inside = 0;
                for (const SelectedBrick& b : s->bricks) {
                    const Region r = region_of(desc.volume, desc.fine_box_of(b.id));
                    inside += glm::all(glm::lessThanEqual(r.lo, p + 1e-9)) && glm::all(glm::lessThanEqual(p - 1e-9, r.hi));
                }
                EXPECT_EQ(inside, 1) << p.x << " " << p.y << " " << p.z << " kappa " << kappa;
            }
            EXPECT_GT(tried, 20);
        }
}

TEST(Plane, IsFinestAboutThePointAndFinerWithALargerFactor) {
    const BricksPtr bricks = synthetic({512, 512, 256}, 16);
    std::size_t last = 0;
    for (double kappa : {0.0, 0.5, 1.0, 2.0, 1e9}) {
        const SelectionPtr s = selection_of(run(plane_node(), bricks, nullptr, fmt::format("{{distance_factor: {}}}", kappa)));
        EXPECT_GE(s->bricks.size(), last);
        last = s->bricks.size();
        int finest_far = 0;
        for (const SelectedBrick& b : s->bricks) {
            const Box box = s->of->fine_box_of(b.id);
            const double distance = glm::distance(0.5 * glm::dvec3(box.lo + box.hi), glm::dvec3(255.5, 255.5, 127.5));
            finest_far += b.id.level == 0 && distance > (kappa * 2 + 2) * 2 * glm::length(glm::dvec3(16));
        }
        EXPECT_EQ(finest_far, 0);
    }
    EXPECT_EQ(last, 32u * 32u);  // all that it meets
}

TEST(Plane, FollowsAPickedPoint) {
    const BricksPtr bricks = synthetic({256, 256, 64}, 16);
    CameraPtr camera = camera_at(bricks->desc(), {0, 0, 1}, 2);
    auto finest = [&](const std::string& params) {
        glm::dvec3 sum(0);
        double n = 0;
        const SelectionPtr s = selection_of(run(plane_node(), bricks, camera, params));
        for (const SelectedBrick& b : s->bricks)
            if (b.id.level == 0) {
                sum += glm::dvec3(b.id.index) * 16.0 + 8.0;
                ++n;
            }
        return sum / n;
    };
    const glm::dvec3 middle = finest("{interest: camera}");
    EXPECT_LT(glm::distance(middle, {128, 128, 32}), 32);
    const Ray ray = camera->ray(0.6 * 512, 0.45 * 512, 512, 512);
    const glm::dvec3 want = ray.origin + ray.direction * ((31.5 - ray.origin.z) / ray.direction.z);
    EXPECT_LT(glm::distance(finest("{interest: picked, pick: [0.6, 0.45]}"), want), 40);
}

// --- statistics ------------------------------------------------------------------------------------

TEST(Statistics, RowsAddUpToTheWholeVolume) {
    const BricksPtr bricks = synthetic({60, 37, 41}, 8);
    const SelectionPtr s = selection_of(run(priority_node(), bricks, camera_at(bricks->desc(), {1, 1, 1}, 3),
                                            "{max_bricks: 31, max_error: 0, pixels: 0.0625}"));
    const NodeRun r = run_node(statistics_node(), params_from_yaml(statistics_node(), "{}"), {{"selection", {s}}});
    const TablePtr table = r.output<Table>("table");
    ASSERT_GE(table->rows.size(), 3u);
    double share = 0;
    std::int64_t n = 0;
    for (std::size_t i = 0; i + 1 < table->rows.size(); ++i) {
        n += std::get<std::int64_t>(table->rows[i][1]);
        share += std::get<double>(table->rows[i][5]);
    }
    EXPECT_EQ(n, std::get<std::int64_t>(table->rows.back()[1]));
    EXPECT_EQ(std::size_t(n), distinct_bricks(*s));
    EXPECT_NEAR(share, 1, 1e-12);
}

}  // namespace
}  // namespace voxloom::lod
