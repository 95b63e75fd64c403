#include <gtest/gtest.h>

#include <clocale>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

#include "plugins/writers/table_text.h"
#include "plugins/writers/writers.h"
#include "tests/support/run_node.h"
#include "tests/support/volumes.h"

namespace voxloom {
namespace {

Table sample() {
    constexpr double inf = std::numeric_limits<double>::infinity();
    Table table;
    table.columns = {{"codec, coder", ""}, {"time", "s"}, {"bricks", ""}};
    table.rows = {
        {std::string("paper \"fast\""), 0.1, std::int64_t(9007199254740993)},
        {std::string("two\nlines"), std::numeric_limits<double>::quiet_NaN(), std::int64_t(-1)},
        {std::string(), -inf, std::int64_t(0)}};
    return table;
}

TEST(Csv, QuotesWhatMustBeAndKeepsNumbersExact) {
    EXPECT_EQ(to_csv(sample()),
              "\"codec, coder\",time [s],bricks\r\n"
              "\"paper \"\"fast\"\"\",0.1,9007199254740993\r\n"
              "\"two\nlines\",nan,-1\r\n"
              ",-inf,0\r\n");
    EXPECT_EQ(to_csv(Table{}), "\r\n");
}

TEST(Csv, DoesNotDependOnTheLocale) {
    if (!std::setlocale(LC_ALL, "de_DE.UTF-8") && !std::setlocale(LC_ALL, "fr_FR.UTF-8"))
        GTEST_SKIP() << "no locale with a decimal comma is installed";
    const std::string csv = to_csv(sample()), json = to_json(sample());
    std::setlocale(LC_ALL, "C");
    EXPECT_EQ(csv, to_csv(sample()));
    EXPECT_EQ(json, to_json(sample()));
}

TEST(Json, ParsesBackToTheSameRows) {
    auto json = nlohmann::json::parse(to_json(sample()));
    EXPECT_EQ(json["columns"][1]["name"], "time");
    EXPECT_EQ(json["columns"][1]["unit"], "s");
    ASSERT_EQ(json["rows"].size(), 3u);
    EXPECT_EQ(json["rows"][0][0], "paper \"fast\"");
    EXPECT_EQ(json["rows"][0][1].get<double>(), 0.1);
    EXPECT_EQ(json["rows"][0][2].get<std::int64_t>(), 9007199254740993);
    EXPECT_TRUE(json["rows"][1][1].is_null());
    EXPECT_EQ(json["rows"][2][1], "-inf");
    Table broken;
    broken.columns = {{"\xff\xfe", ""}};
    EXPECT_NO_THROW(nlohmann::json::parse(to_json(broken)));
    EXPECT_EQ(nlohmann::json::parse(to_json(Table{}))["rows"].size(), 0u);
}

TEST(WriteTable, TakesTheFormatFromTheExtension) {
    Registry registry;
    add_table_writer(registry);
    testing::TempFolder folder;
    testing::RunNodeOptions options;
    options.output_folder = folder.path();
    const TablePtr table = std::make_shared<const Table>(sample());
    auto text = [&](const std::string& name) {
        testing::run_node(registry, "writers.table", "{path: " + name + "}", {{"table", {table}}},
                          options);
        std::ifstream in(folder.path() / name, std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(in), {});
    };
    EXPECT_EQ(text("a.csv"), to_csv(sample()));
    EXPECT_EQ(text("a.json"), to_json(sample()));
    EXPECT_THROW(text("a.xls"), Error);
}

}  // namespace
}  // namespace voxloom
