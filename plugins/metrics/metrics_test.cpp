// The metric nodes: what they measure reaches table and report, and sizes are checked before.
#include <gtest/gtest.h>

#include <cmath>

#include "core/data/dense_pyramid.h"
#include "plugins/metrics/nodes.h"
#include "tests/support/run_node.h"
#include "tests/support/volumes.h"

namespace voxloom::metrics {
namespace {

using testing::make_volume;
using testing::NodeRun;
using testing::params_from_yaml;
using testing::run_node;

NodeRun run(const NodeType& node, const testing::NodeInputs& inputs, const std::string& yaml = {}) {
    return run_node(node, params_from_yaml(node, yaml), inputs);
}

std::vector<std::string> problems(const NodeType& node, const std::string& yaml,
                                  std::map<std::string, std::vector<ValueDesc>, std::less<>> inputs) {
    return testing::describe_node(node, params_from_yaml(node, yaml), inputs).problems;
}

Table::Cell cell(const Table& table, const std::string& column, std::size_t row = 0) {
    for (std::size_t c = 0; c < table.columns.size(); ++c)
        if (table.columns[c].name == column) return table.rows.at(row).at(c);
    fail("no column '{}'", column);
}

VolumePtr shifted(double by, Index3 dims = {20, 10, 5}) {
    return make_volume(dims, ScalarType::u8, [by](auto x, auto, auto) { return double(x) + by; });
}

ImagePtr gray(glm::ivec2 size, float value) {
    auto image = std::make_shared<Image>(size, Image::Format::rgba32f);
    for (glm::vec4& pixel : image->rgba32f()) pixel = glm::vec4(value);
    return image;
}

TEST(VolumeNode, TabulatesAndReportsTheSameNumbers) {
    NodeRun r = run(volume_node(), {{"volume", {shifted(2)}}, {"reference", {shifted(0)}}},
                    "{label: two off}");
    auto table = r.output<Table>("table");
    ASSERT_EQ(table->rows.size(), 1u);
    EXPECT_EQ(table->rows[0].size(), table->columns.size());
    EXPECT_EQ(std::get<std::string>(cell(*table, "name")), "two off");
    EXPECT_EQ(std::get<double>(cell(*table, "rmse")), 2);
    EXPECT_EQ(std::get<std::int64_t>(cell(*table, "compared")), 1000);
    EXPECT_EQ(r.measured("rmse"), 2);
    EXPECT_EQ(r.measured("max_error"), 2);
    EXPECT_DOUBLE_EQ(r.measured("psnr"), 20 * std::log10(19.0 / 2));
    EXPECT_DOUBLE_EQ(r.measured("psnr_nominal"), 20 * std::log10(255.0 / 2));
    EXPECT_EQ(r.measurements["psnr"].second, "dB");
    EXPECT_FALSE(r.progress.empty());
}

TEST(VolumeNode, ReadsBricksAndStatesTheirRate) {
    VolumePtr v = shifted(1, {70, 40, 33});
    BricksPtr bricks = make_dense_pyramid(v, glm::ivec3(16), PyramidFilter::average);
    NodeRun r = run(volume_node(), {{"volume", {bricks}}, {"reference", {v}}});
    EXPECT_EQ(r.measured("different"), 0);
    EXPECT_EQ(r.measured("psnr"), std::numeric_limits<double>::infinity());
    EXPECT_EQ(r.measured("bits_per_voxel"),
              8 * double(bricks->desc().compressed_bytes) / double(v->desc().voxels()));
    EXPECT_EQ(run(volume_node(), {{"volume", {v}}, {"reference", {bricks}}}).measured("different"), 0);
}

TEST(VolumeNode, ChecksSizesBeforeAnyWork) {
    auto found = problems(volume_node(), "{}",
                          {{"volume", {ValueDesc(shifted(0)->desc())}},
                           {"reference", {ValueDesc(shifted(0, {20, 10, 6})->desc())}}});
    ASSERT_EQ(found.size(), 1u);
    EXPECT_NE(found[0].find("20 x 10 x 5"), std::string::npos);
    EXPECT_NE(found[0].find("20 x 10 x 6"), std::string::npos);
}

TEST(VolumeNode, WarnsWhenTheVolumesLieElsewhere) {
    auto near = make_volume(Index3(3), ScalarType::u8, [](auto...) { return 1; });
    auto far = make_volume(Index3(3), ScalarType::u8, [](auto...) { return 1; }, glm::dvec3(2.0));
    EXPECT_EQ(run(volume_node(), {{"volume", {near}}, {"reference", {far}}}).warnings.size(), 1u);
    EXPECT_TRUE(run(volume_node(), {{"volume", {near}}, {"reference", {near}}}).warnings.empty());
}

TEST(VolumeNode, ComparesNothingAndOneVoxel) {
    for (Index3 dims : {Index3(0), Index3(1)}) {
        NodeRun r = run(volume_node(), {{"volume", {shifted(0, dims)}}, {"reference", {shifted(0, dims)}}});
        EXPECT_EQ(r.measured("compared"), double(dims.x));
        EXPECT_EQ(r.measured("different"), 0);
    }
}

TEST(ImageNode, MeasuresAndDrawsTheDifference) {
    NodeRun r = run(image_node(), {{"image", {gray({8, 4}, 0.5f)}}, {"reference", {gray({8, 4}, 0.25f)}}},
                    "{scale: 2}");
    EXPECT_DOUBLE_EQ(r.measured("rmse"), 0.25);
    EXPECT_EQ(r.measured("share_off"), 1);
    ImagePtr difference = r.image("difference");
    EXPECT_EQ(difference->size(), glm::ivec2(8, 4));
    EXPECT_EQ(difference->at(3, 3), glm::vec4(0.5f, 0.5f, 0.5f, 1.0f));
    EXPECT_EQ(std::get<double>(cell(*r.output<Table>("table"), "rmse")), 0.25);
}

TEST(ImageNode, ChecksSizesBeforeAnyWork) {
    ImageDesc a{{4, 4}}, b{{4, 5}};
    EXPECT_EQ(problems(image_node(), "{}", {{"image", {a}}, {"reference", {b}}}).size(), 1u);
    EXPECT_TRUE(problems(image_node(), "{}", {{"image", {a}}, {"reference", {a}}}).empty());
}

TablePtr small(const std::string& name, const std::string& column, double value) {
    Table table;
    table.columns = {{"name", ""}, {"rmse", ""}, {column, "dB"}};
    table.rows = {{name, 1.5, value}};
    return std::make_shared<Table>(table);
}

TEST(CompareNode, PutsTablesUnderCommonColumns) {
    NodeRun r = run(compare_node(), {{"tables", {small("a", "psnr", 40), small("", "snr", 30)}}});
    auto table = r.output<Table>("table");
    ASSERT_EQ(table->columns.size(), 4u);
    ASSERT_EQ(table->rows.size(), 2u);
    EXPECT_EQ(std::get<std::string>(cell(*table, "name", 0)), "a");
    EXPECT_EQ(std::get<std::string>(cell(*table, "name", 1)), "2");
    EXPECT_EQ(std::get<double>(cell(*table, "psnr", 0)), 40);
    EXPECT_EQ(std::get<std::string>(cell(*table, "psnr", 1)), "");
    EXPECT_EQ(std::get<double>(cell(*table, "snr", 1)), 30);
    for (const auto& row : table->rows) EXPECT_EQ(row.size(), table->columns.size());
}

TEST(CompareNode, NamesAndTurns) {
    NodeRun r = run(compare_node(), {{"tables", {small("a", "psnr", 40), small("b", "psnr", 30)}}},
                    "{names: [one, two], layout: columns}");
    auto table = r.output<Table>("table");
    ASSERT_EQ(table->columns.size(), 4u);
    EXPECT_EQ(table->columns[2].name, "one");
    EXPECT_EQ(table->columns[3].name, "two");
    ASSERT_EQ(table->rows.size(), 2u);
    EXPECT_EQ(std::get<std::string>(table->rows[1][0]), "psnr");
    EXPECT_EQ(std::get<std::string>(table->rows[1][1]), "dB");
    EXPECT_EQ(std::get<double>(table->rows[1][3]), 30);
}

TEST(CompareNode, RefusesNamesThatDoNotMatch) {
    EXPECT_EQ(problems(compare_node(), "{names: [one]}",
                       {{"tables", {ValueDesc(PortType::table), ValueDesc(PortType::table)}}}).at(0),
              "names: there are 1 names for 2 tables; give each table one, or none");
}

}  // namespace
}  // namespace voxloom::metrics
