// Transfer functions as people make them: ranges, presets, colour maps, shapes over two dimensions.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/base/text.h"
#include "core/data/dense_pyramid.h"
#include "plugins/scene/classification.h"
#include "plugins/scene/nodes.h"
#include "plugins/scene/presets.h"
#include "tests/support/run_node.h"
#include "tests/support/volumes.h"

namespace voxloom::scene {
namespace {

using testing::make_volume;
using testing::NodeRun;
using testing::params_from_yaml;

// Values 10 to 90 along x, 3 units apart.
VolumePtr ramp_volume() {
    return make_volume({9, 2, 2}, ScalarType::u8, [](auto x, auto, auto) { return 10 + 10 * x; },
                       {3, 7, 8});
}

NodeRun run(const std::string& yaml, Value fit = {}) {
    NodeType node = transfer_node();
    testing::NodeInputs inputs;
    if (!is_empty(fit)) inputs["fit"] = {fit};
    return testing::run_node(node, params_from_yaml(node, yaml), inputs);
}
TransferFunction transfer(const std::string& yaml, Value fit = {}) {
    return *run(yaml, fit).output<TransferFunction>("transfer");
}
std::vector<std::string> problems(const std::string& yaml) {
    NodeType node = transfer_node();
    return testing::describe_node(node, params_from_yaml(node, yaml), {}).problems;
}

TEST(Transfer, LaysRelativePointsOverTheDatasRange) {
    NodeRun r = run("{points: [[0, 0, 0, 0, 0], [0.5, 1, 0, 0, 0.5], [1, 0, 0, 1, 0.25]]}",
                    ramp_volume());
    const TransferFunction f = *r.output<TransferFunction>("transfer");
    EXPECT_EQ(f.reference_length, 3);  // the smallest spacing
    EXPECT_NEAR(opacity_of(f.one.at(50).a, 3), 0.5, 1e-15);
    EXPECT_NEAR(opacity_of(f.one.at(90).a, 3), 0.25, 1e-15);
    EXPECT_NEAR(opacity_of(f.one.at(200).a, 3), 0.25, 1e-15);
    EXPECT_EQ(f.one.at(10).a, 0);
    EXPECT_EQ(color_of(f.one.at(50)), glm::dvec3(1, 0, 0));
    EXPECT_EQ(r.measured("range_min"), 10);
    EXPECT_EQ(r.measured("range_max"), 90);
    EXPECT_TRUE(r.warnings.empty());
}

TEST(Transfer, TakesTheRangeThatIsGiven) {
    TransferFunction f = transfer("{range: [20, 40], points: [[0, 0], [1, 0.5]]}", ramp_volume());
    EXPECT_EQ(f.one.at(20).a, 0);
    EXPECT_NEAR(opacity_of(f.one.at(40).a, f.reference_length), 0.5, 1e-15);
}

TEST(Transfer, NeverReadsTheDataForExplicitValues) {
    struct Unreadable final : Volume {
        using Volume::Volume;
        void read(const Box&, std::span<std::byte>, const std::stop_token&) const override {
            fail("read");
        }
    };
    VolumeDesc desc;
    desc.dims = Index3(4);
    auto volume = std::make_shared<Unreadable>(desc);
    EXPECT_NO_THROW(run("{domain: values, points: [[7, 0.5]]}", volume));
    EXPECT_NO_THROW(run("{preset: ct-bone}", volume));
    EXPECT_THROW(run("{}", volume), Error);
}

TEST(Transfer, WarnsWhenItKnowsNothingOfTheData) {
    NodeRun r = run("{}");
    ASSERT_EQ(r.warnings.size(), 1u);
    EXPECT_THAT(r.warnings[0], ::testing::HasSubstr("wire the volume to 'fit'"));
    EXPECT_TRUE(run("{range: [0, 255]}").warnings.empty());
}

TEST(Transfer, SurvivesDataWithoutRangeOrExtent) {
    auto constant = [](double v, Index3 dims) {
        return make_volume(dims, ScalarType::f32, [v](auto...) { return v; });
    };
    for (double v : {0.0, -7.0, 1e30, std::nan("")})
        for (Index3 dims : {Index3(0), Index3(1), Index3(3)})
            for (const char* set : {"{}", "{preset: isosurfaces}", "{preset: ramp}",
                                    "{preset: materials}",
                                    "{widgets: [[0, 1, 0, 1, 1, 1, 1, 0.5]]}"}) {
                TransferFunction f = transfer(set, constant(v, dims));
                for (const auto& p : f.one.points) {
                    EXPECT_TRUE(std::isfinite(p.value));
                    EXPECT_TRUE(std::isfinite(p.emission.a));
                }
                // The lower end is transparent; without a finite value it is 0.
                bool empty = std::isnan(v) || dims.x == 0;
                EXPECT_EQ(f.one.at(empty ? 0.0 : double(float(v))).a, 0) << set;
            }
}

TEST(Transfer, TakesRangeAndBoundariesOfBricks) {
    auto volume = make_volume({70, 33, 9}, ScalarType::u8, [](auto x, auto, auto) { return 3 * x; });
    BricksPtr bricks = make_dense_pyramid(volume, glm::ivec3(16), PyramidFilter::subsample);
    NodeRun r = run("{preset: materials}", bricks);
    EXPECT_EQ(r.measured("range_min"), 0);
    EXPECT_EQ(r.measured("range_max"), 207);
    EXPECT_LT(r.measured("boundary_1"), r.measured("boundary_3"));
    // Bricks without a finite value say nothing of the range; bricks of zeros do.
    auto half_known = make_volume({64, 16, 16}, ScalarType::f32, [](auto x, auto, auto) {
        return x < 32 ? std::nan("") : 100.0 + double(x);
    });
    auto half_zero = make_volume({64, 16, 16}, ScalarType::f32, [](auto x, auto, auto) {
        return x < 32 ? 0.0 : 100.0 + double(x);
    });
    auto smallest = [](VolumePtr v) {
        return run("{}", make_dense_pyramid(v, glm::ivec3(8), PyramidFilter::subsample))
            .measured("range_min");
    };
    EXPECT_EQ(smallest(half_known), 132);
    EXPECT_EQ(smallest(half_zero), 0);
    for (Index3 dims : {Index3(0), Index3(1)}) {
        auto small = make_volume(dims, ScalarType::i16, [](auto...) { return 5; });
        for (const char* set : {"{}", "{preset: materials}"})
            EXPECT_NO_THROW(run(set, make_dense_pyramid(small, glm::ivec3(16), PyramidFilter::average)));
    }
}

TEST(Transfer, UnitesTheRangesOfASeries) {
    class Steps final : public Series {
      public:
        explicit Steps(SeriesDesc desc) : Series(std::move(desc)) {}
        Value fetch(std::size_t i, const std::stop_token&) const override {
            return make_volume({2, 1, 1}, ScalarType::i16,
                               [i](auto x, auto, auto) { return double(i) * 10 + double(x); });
        }
    };
    SeriesDesc desc;
    desc.times = {0, 1, 4, 9};
    desc.step = ValueDesc(make_volume({2, 1, 1}, ScalarType::i16, [](auto...) { return 0; })->desc());
    SeriesPtr series = std::make_shared<Steps>(desc);
    EXPECT_EQ(run("{}", series).measured("range_max"), 31);
    EXPECT_EQ(run("{range_steps: 1}", series).measured("range_max"), 1);
    EXPECT_EQ(run("{range_steps: 2}", series).measured("range_max"), 31);
    EXPECT_NO_THROW(run("{preset: materials}", series));
    desc.times.clear();
    EXPECT_NO_THROW(run("{preset: materials}", SeriesPtr(std::make_shared<Steps>(desc))));
}

TEST(Transfer, IsDenserByItsScaleAndTheSameForEveryReferenceLength) {
    const char* points = "domain: values, points: [[0, 0.2]]";
    double tau = transfer(fmt::format("{{{}}}", points)).one.at(0).a;
    EXPECT_DOUBLE_EQ(transfer(fmt::format("{{{}, opacity_scale: 3}}", points)).one.at(0).a, 3 * tau);
    EXPECT_DOUBLE_EQ(transfer(fmt::format("{{{}, reference_length: 4}}", points)).one.at(0).a, tau / 4);
}

TEST(Transfer, FollowsTheColourMapBetweenTwoPoints) {
    TransferFunction f = transfer("{range: [0, 100], colormap: viridis, points: [[0, 0.3], [1, 0.3]]}");
    for (int i = 0; i <= 200; ++i) {
        glm::dvec3 shown = color_of(f.one.at(i * 0.5));
        EXPECT_LT(glm::distance(shown, color_map("viridis").at(i / 200.0)), 1e-12);
    }
    // ... without changing the extinction between them.
    TransferFunction rising = transfer("{range: [0, 100], points: [[0, 0], [1, 0.3]]}");
    for (double v : {3.0, 31.0, 77.0})
        EXPECT_NEAR(rising.one.at(v).a, extinction_of(0.3, 1) * v / 100, 1e-15);
    // Reversed, the ends change places.
    TransferFunction back =
        transfer("{range: [0, 100], colormap_reversed: true, points: [[0, 0.3], [1, 0.3]]}");
    EXPECT_LT(glm::distance(color_of(back.one.at(100)), color_map("viridis").at(0)), 1e-12);
    EXPECT_LT(glm::distance(color_of(back.one.at(25)), color_map("viridis").at(0.75)), 1e-12);
}

TEST(Transfer, SortsPointsAndKeepsTheOrderOfSteps) {
    TransferFunction f = transfer("{domain: values, points: [[5, 0.5], [2, 0], [2, 0.5], [5, 0]]}");
    EXPECT_EQ(f.one.at(1.99).a, 0);
    EXPECT_GT(f.one.at(2).a, 0);
    EXPECT_GT(f.one.at(4.99).a, 0);
    EXPECT_EQ(f.one.at(5).a, 0);
}

TEST(Transfer, SaysWhichRowIsWrong) {
    EXPECT_EQ(problems("{points: []}").at(0),
              "points: there is no point; give at least one, [value, opacity]");
    EXPECT_EQ(problems("{points: [[0, 0], [1, 0.5, 1]]}").at(0),
              "points: row 2 has 3 numbers; write [value, opacity] or [value, r, g, b, opacity]");
    EXPECT_EQ(problems("{points: [[0, 1.5]]}").at(0),
              "points: row 1 has the opacity 1.5, which must be between 0 and 1");
    EXPECT_EQ(problems("{points: [[]]}").size(), 1u);
    EXPECT_EQ(problems("{range: [5, 1]}").at(0), "range: goes from 5 down to 1; swap them");
    EXPECT_EQ(problems("{widgets: [[1, 0, 0, 1, 1, 1, 1, 1]]}").at(0),
              "widgets: row 1 has values from 1 down to 0; swap them");
    EXPECT_EQ(problems("{widgets: [[0, 1, 1, 1, 1, 1, 1, 1]]}").size(), 1u);
    EXPECT_EQ(problems("{widgets: [[0, 1, 1]]}").size(), 1u);
    EXPECT_TRUE(problems("{}").empty());
}

TEST(Transfer, NamesTheNearestMap) {
    NodeType node = transfer_node();
    try {
        params_from_yaml(node, "{colormap: virdis}");
        FAIL();
    } catch (const Error& e) {
        EXPECT_THAT(e.what(), ::testing::HasSubstr("did you mean 'viridis'?"));
    }
}

TEST(Transfer, WarnsOfPointsThatAPresetHides) {
    EXPECT_EQ(run("{preset: ramp, range: [0, 1], points: [[0, 1]]}").warnings.size(), 1u);
}

TEST(Transfer, RampsBetweenItsEnds) {
    TransferFunction f = transfer("{preset: ramp, range: [0, 100], ramp_start: 0.2, ramp_end: 0.6, "
                                  "ramp_opacity: 0.5}");
    EXPECT_EQ(f.one.at(19).a, 0);
    EXPECT_NEAR(f.one.at(40).a, extinction_of(0.5, 1) / 2, 1e-15);
    EXPECT_NEAR(f.one.at(99).a, extinction_of(0.5, 1), 1e-15);
    TransferFunction falling = transfer("{preset: ramp, range: [0, 100], ramp_start: 0.6, "
                                        "ramp_end: 0.2}");
    EXPECT_EQ(falling.one.at(70).a, 0);
    EXPECT_GT(falling.one.at(10).a, 0);
}

TEST(Transfer, PeaksOfIsosurfacesKeepTheirIntegralWhateverTheirWidth) {
    auto integral = [](double width) {
        TransferFunction f = transfer(fmt::format(
            "{{preset: isosurfaces, range: [0, 100], iso_values: [0.5], iso_width: {}, "
            "iso_opacity: 0.3}}", width));
        EXPECT_EQ(f.one.max_extinction(0, 50 - 60 * width), 0);
        EXPECT_EQ(f.one.max_extinction(50 + 60 * width, 100), 0);
        return f.one.integral(0, 100).a;
    };
    // 10 value units per unit length: crossing the peak gains an opacity of 0.3.
    EXPECT_NEAR(opacity_of(integral(0.1) / 10, 1), 0.3, 1e-12);
    for (double width : {0.05, 0.01, 1e-4, 1e-6})
        EXPECT_NEAR(integral(width), integral(0.1), 1e-6 * integral(0.1));
}

TEST(Transfer, SpreadsIsosurfacesAndAddsUpWhereTheyOverlap) {
    TransferFunction f = transfer("{preset: isosurfaces, range: [0, 100], iso_count: 3, iso_width: 0.1}");
    for (double v : {25.0, 50.0, 75.0}) EXPECT_GT(f.one.at(v).a, 0);
    for (double v : {0.0, 31.0, 44.0, 62.5, 100.0}) EXPECT_EQ(f.one.at(v).a, 0);
    EXPECT_EQ(f.one.max_extinction(30, 45), 0);  // exactly nothing between them
    TransferFunction1D two = sum_of_peaks(std::vector<Peak>{{10, 4, Emission(1.0)}, {11, 4, Emission(1.0)}});
    EXPECT_DOUBLE_EQ(two.at(10).a, 1.5);
    EXPECT_DOUBLE_EQ(two.at(10.5).a, 1.5);
    EXPECT_DOUBLE_EQ(two.integral(0, 20).a, 4);
}

TEST(Transfer, FindsTheBoundariesOfMaterials) {
    // Four materials: air fills most of the volume, the densest one a hundredth of it.
    auto four = make_volume({100, 10, 10}, ScalarType::i16, [](auto x, auto y, auto z) {
        double noise = double((x * 7 + y * 3 + z * 5) % 11);
        return (x < 80 ? 0 : x < 90 ? 300 : x < 99 ? 600 : 1500) + noise;
    });
    NodeRun r = run("{preset: materials}", four);
    auto within = [&](const char* name, double lo, double hi) {
        EXPECT_GT(r.measured(name), lo) << name;
        EXPECT_LT(r.measured(name), hi) << name;
    };
    within("boundary_1", 10, 300);
    within("boundary_2", 310, 600);
    within("boundary_3", 610, 1500);
    const TransferFunction f = *r.output<TransferFunction>("transfer");
    EXPECT_EQ(f.one.max_extinction(0, 10), 0);
    EXPECT_GT(f.one.at(1500).a, f.one.at(600).a);
    EXPECT_EQ(problems("{preset: materials}").size(), 1u);  // nothing to look at
}

TEST(Transfer, PlacesHounsfieldPresetsWhereTheyBelong) {
    TransferFunction bone = transfer("{preset: ct-bone}");
    EXPECT_EQ(bone.one.max_extinction(-1000, 130), 0);
    EXPECT_GT(bone.one.at(1000).a, bone.one.at(300).a);
    TransferFunction shifted = transfer("{preset: ct-bone, value_offset: 1024}");
    for (double v : {200.0, 500.0, 2000.0})
        EXPECT_DOUBLE_EQ(shifted.one.at(v + 1024).a, bone.one.at(v).a);
    for (const Preset& preset : presets())
        EXPECT_EQ(transfer(fmt::format("{{preset: {}, range: [0, 1]}}", preset.name)).one.points.size(),
                  preset.points.size());
}

TEST(ColorMaps, ArePublishedColoursAtTheirEnds) {
    auto is = [](const char* name, double t, int rgb) {
        glm::dvec3 c(rgb >> 16, rgb >> 8 & 255, rgb & 255);
        EXPECT_LT(glm::distance(color_map(name).at(t), c / 255.0), 1e-12) << name;
    };
    is("viridis", 0, 0x440154);
    is("viridis", 1, 0xfde725);
    is("plasma", 0, 0x0d0887);
    is("plasma", 1, 0xf0f921);
    is("inferno", 0, 0x000004);
    is("magma", 1, 0xfcfdbf);
    is("gray", 0.2, 0x333333);
}

TEST(ColorMaps, AreWellFormed) {
    for (const std::string& name : color_map_names()) {
        const ColorMap& map = color_map(name);
        EXPECT_EQ(map.knots.front().position, 0) << name;
        EXPECT_EQ(map.knots.back().position, 1) << name;
        for (std::size_t i = 0; i < map.knots.size(); ++i) {
            if (i > 0) {
                EXPECT_LT(map.knots[i - 1].position, map.knots[i].position) << name;
            }
            for (int c = 0; c < 3; ++c) {
                EXPECT_GE(map.knots[i].color[c], 0) << name;
                EXPECT_LE(map.knots[i].color[c], 1) << name;
            }
        }
        EXPECT_EQ(map.at(-5), map.knots.front().color);
        EXPECT_EQ(map.at(5), map.knots.back().color);
    }
}

TEST(ColorMaps, OfThePerceptualFamilyOnlyGetLighter) {
    for (const char* name : {"viridis", "plasma", "inferno", "magma", "cividis", "gray", "hot", "bone"})
        for (int i = 0; i < 100; ++i) {
            auto luma = [&](int k) {
                return glm::dot(color_map(name).at(k / 100.0), glm::dvec3(0.2126, 0.7152, 0.0722));
            };
            EXPECT_GE(luma(i + 1), luma(i) - 1e-3) << name << " at " << i;
        }
}

TEST(Widgets, WeighHardAndSoftShapes) {
    Shape box{{2, 4}, {2, 4}, {1, 3}, Emission(1.0), 0};
    EXPECT_DOUBLE_EQ(box.mean(2, 4, 2), 1);
    EXPECT_DOUBLE_EQ(box.mean(0, 10, 1), 0.2);
    EXPECT_EQ(box.mean(0, 2, 2), 0);
    EXPECT_EQ(box.mean(2, 4, 3.01), 0);
    Shape triangle{{3, 3}, {1, 5}, {0, 4}, Emission(1.0), 0};
    EXPECT_DOUBLE_EQ(triangle.mean(0, 8, 2), 2.0 / 8);
    EXPECT_DOUBLE_EQ(triangle.mean(0, 8, 4), 4.0 / 8);
    EXPECT_EQ(triangle.mean(0, 8, 0), 0);
    Shape tent = box;
    tent.edge = 1;
    EXPECT_DOUBLE_EQ(tent.mean(2, 4, 2), 0.5);
    EXPECT_DOUBLE_EQ(tent.mean(2, 3, 2), 0.5);
    EXPECT_DOUBLE_EQ(tent.mean(2, 2.5, 2), 0.25);
    EXPECT_DOUBLE_EQ(tent.mean(2, 4, 1.5), 0.25);
    Shape half = box;
    half.edge = 0.5;
    EXPECT_DOUBLE_EQ(half.mean(2, 2.5, 2), 0.5);
    EXPECT_DOUBLE_EQ(half.mean(2.5, 3.5, 2), 1);
}

TEST(Widgets, ClassifyByValueAndGradient) {
    TransferFunction f = transfer("{domain: values, widget_edge: 0, reference_length: 1, "
                                  "widgets: [[100, 200, 5, 9, 1, 0, 0, 0.5]]}");
    ASSERT_TRUE(f.two);
    double tau = extinction_of(0.5, 1);
    EXPECT_NEAR(f.two->at(150, 7).a, tau, 1e-12);
    EXPECT_LT(glm::distance(color_of(f.two->at(150, 7)), glm::dvec3(1, 0, 0)), 1e-12);
    for (auto [v, g] : {std::pair(50.0, 7.0), {250.0, 7.0}, {150.0, 2.0}, {150.0, 20.0},
                        {-1e9, 7.0}, {1e9, 1e9}})
        EXPECT_EQ(f.two->at(v, g).a, 0) << v << " " << g;
    EXPECT_EQ(f.max_extinction(0, 90), 0);
    EXPECT_NEAR(f.max_extinction(0, 150), tau, 1e-12);
}

TEST(Widgets, AreRelativeToTheDatasRangeAndVoxels) {
    // Range 10 to 90, voxels 3 apart: a relative gradient of 1 is 80/3.
    TransferFunction f = transfer("{widget_edge: 0, widgets: [[0.5, 1, 0, 1, 1, 1, 1, 0.5]]}",
                                  ramp_volume());
    double tau = extinction_of(0.5, 3);
    EXPECT_NEAR(f.two->at(90, 80.0 / 3).a, tau, 1e-12);  // no margin where data ends
    EXPECT_NEAR(f.two->at(70, 0).a, tau, 1e-12);
    EXPECT_EQ(f.two->at(45, 5).a, 0);
}

TEST(Widgets, KeepTheIntegralOfWhatIsNarrowerThanACell) {
    // A wide box sets the grid; a sliver down to a 300th of a cell lies within it.
    auto integral = [](double width) {
        std::vector<Shape> shapes{{{0, 100}, {0, 100}, {0, 10}, Emission(0.0), 0},
                                  {{50 - width / 2, 50 + width / 2}, {50 - width / 2, 50 + width / 2},
                                   {0, 10}, Emission(1 / width), 0}};
        constexpr double most = std::numeric_limits<double>::max();
        TransferFunction2D f = rasterize(shapes, {{-most, most}, {0, most}}, {32, 8}, {});
        double sum = 0, step = f.value.extent() / 31;
        for (int i = 0; i < 32; ++i) sum += f.samples[std::size_t(4 * 32 + i)].a * step;
        return sum;
    };
    for (double width : {30.0, 3.0, 0.3, 0.01}) EXPECT_NEAR(integral(width), 1, 1e-9);
}

TEST(Widgets, AddUpWhereTheyOverlap) {
    TransferFunction f = transfer("{domain: values, widget_edge: 0, widgets: "
                                  "[[0, 10, 0, 10, 1, 0, 0, 0.5], [5, 15, 0, 10, 0, 0, 1, 0.5]]}");
    double tau = extinction_of(0.5, 1);
    EXPECT_NEAR(f.two->at(7.5, 5).a, 2 * tau, 1e-12);
    EXPECT_LT(glm::distance(color_of(f.two->at(7.5, 5)), glm::dvec3(0.5, 0, 0.5)), 1e-12);
}

}  // namespace
}  // namespace voxloom::scene
