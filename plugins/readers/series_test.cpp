// The nodes: readers.volume, readers.series and series.step, and the patterns of numbered files.
#include <fmt/format.h>

#include <set>
#include <thread>

#include "core/graph/node.h"
#include "loaded.h"
#include "reader_test_files.h"
#include "series_source.h"
#include "tests/support/run_node.h"
#include "tests/support/volumes.h"
#include "volume_nodes.h"

namespace voxloom::testing {
namespace {

namespace fs = std::filesystem;

const Registry& readers() {
    static const Registry registry = [] {
        Registry r;
        add_volume_readers(r);
        return r;
    }();
    return registry;
}

// Step t of `steps` raw files t0.raw ... with voxels 10 t, 10 t + 1, ...
void write_steps(const fs::path& folder, int steps) {
    for (int t = 0; t < steps; ++t) {
        std::vector<double> values(8);
        for (int i = 0; i < 8; ++i) values[std::size_t(i)] = 10 * t + i;
        write_file(folder / fmt::format("t{}.raw", t), bytes_of_values<std::uint8_t>(values));
        write_file(folder / fmt::format("t{}.raw.yaml", t), "dims: [2, 2, 2]\ntype: u8\n");
    }
}

std::string failure(std::string_view type, const std::string& params, const NodeInputs& inputs = {}) {
    try {
        run_node(readers(), type, params, inputs);
        return {};
    } catch (const Error& e) {
        return e.what();
    }
}

TEST(Pattern, TakesTheNumberOfANameThatFits) {
    EXPECT_EQ(number_in("t_0012.nrrd", "t_####.nrrd"), 12);
    EXPECT_EQ(number_in("t_0012.nrrd", "t_%04d.nrrd"), 12);
    EXPECT_EQ(number_in("t_12345.nrrd", "t_%04d.nrrd"), 12345);
    EXPECT_EQ(number_in("t_7.nrrd", "t_#.nrrd"), 7);
    EXPECT_EQ(number_in("t_7.nrrd", "t_%d.nrrd"), 7);
    EXPECT_EQ(number_in("t_7.nrrd", "t_##.nrrd"), -1);
    EXPECT_EQ(number_in("t_.nrrd", "t_#.nrrd"), -1);
    EXPECT_EQ(number_in("t_-7.nrrd", "t_#.nrrd"), -1);
    EXPECT_EQ(number_in("u_7.nrrd", "t_#.nrrd"), -1);
    EXPECT_EQ(number_in("t_7.nrr", "t_#.nrrd"), -1);
    EXPECT_EQ(number_in("t_99999999999999999999.nrrd", "t_#.nrrd"), -1);
    for (const char* wrong : {"t.nrrd", "t_#_#.nrrd", "t_%d_%d.nrrd", "t_%s.nrrd", "t_%", "t_%99d", "#%d"})
        EXPECT_THROW(number_in("t_1.nrrd", wrong), Error) << wrong;
}

TEST(VolumeReader, DescribesWhatItReads) {
    TempFolder folder;
    write_steps(folder.path(), 1);
    NodeRun run = run_node(readers(), "readers.volume", "{path: " + (folder.path() / "t0.raw").string() + "}");
    EXPECT_EQ(run.described.at("volume").volume()->dims, Index3(2));
    EXPECT_EQ(samples(*run.volume()), (std::vector<double>{0, 1, 2, 3, 4, 5, 6, 7}));
}

TEST(VolumeReader, ProblemsStandAtThePath) {
    const NodeType& type = *readers().find("readers.volume");
    auto problems = [&](const std::string& params) {
        return describe_node(type, params_from_yaml(type, params), {}).problems;
    };
    ASSERT_EQ(problems("{}").size(), 1u);
    EXPECT_EQ(problems("{}")[0], "path: no file is given; set 'path'");
    ASSERT_EQ(problems("{path: /nowhere/at/all.nrrd}").size(), 1u);
    EXPECT_EQ(problems("{path: /nowhere/at/all.nrrd}")[0], "path: /nowhere/at/all.nrrd is not there");
}

TEST(VolumeReader, NamesEveryFileItDependsOn) {
    TempFolder folder;
    write_steps(folder.path(), 3);
    const NodeType& type = *readers().find("readers.volume");
    auto files = type.files(params_from_yaml(type, "{path: " + (folder.path() / "t1.raw").string() + "}"));
    EXPECT_EQ(std::set<fs::path>(files.begin(), files.end()),
              (std::set<fs::path>{folder.path() / "t1.raw", folder.path() / "t1.raw.yaml"}));
    const NodeType& series = *readers().find("readers.series");
    files = series.files(params_from_yaml(series, "{path: " + folder.path().string() + "}"));
    EXPECT_EQ(files.size(), 7u);  // the folder, three descriptions, three files of voxels
    EXPECT_TRUE(type.files(params_from_yaml(type, "{path: /nowhere}")).empty());
}

TEST(VolumeReader, SendsSeriesToTheirReader) {
    TempFolder folder;
    write_file(folder.path() / "t.raw", std::string(16, 'x'));
    write_file(folder.path() / "t.raw.yaml", "dims: [2, 2, 2, 2]\ntype: u8\n");
    EXPECT_NE(failure("readers.volume", "{path: " + (folder.path() / "t.raw").string() + "}").find("readers.series"),
              std::string::npos);
}

TEST(SeriesReader, NumberedFilesComeInOrderOfTheirNumbersWithGivenTimes) {
    TempFolder folder;
    write_steps(folder.path(), 12);
    const std::string path = folder.path().string();
    for (const std::string& params :
         {"{path: " + path + ", time_step: 0.5, time_unit: s}",
          "{path: " + path + ", pattern: 't#.raw', time_step: 0.5, time_unit: s}",
          "{path: " + path + ", times: [0, 0.5, 1, 1.5, 2, 2.5, 3, 3.5, 4, 4.5, 5, 5.5], time_unit: s}"}) {
        SCOPED_TRACE(params);
        NodeRun run = run_node(readers(), "readers.series", params);
        auto series = run.output<Series>("series");
        ASSERT_EQ(series->desc().times.size(), 12u);
        EXPECT_EQ(series->desc().times[11], 5.5);
        EXPECT_EQ(series->desc().time_unit, "s");
        for (int t : {11, 2, 10, 0})
            EXPECT_EQ(samples(*std::get<VolumePtr>(series->fetch(std::size_t(t))))[0], 10 * t);
        NodeRun step = run_node(readers(), "series.step", "{index: 10}", {{"series", {Value(SeriesPtr(series))}}});
        EXPECT_EQ(samples(*step.volume())[3], 103);
        EXPECT_EQ(step.measured("time"), 5.0);
        EXPECT_THROW(series->fetch(12), Error);
    }
}

TEST(SeriesReader, WhatDoesNotFitTogetherIsSaid) {
    TempFolder folder;
    write_steps(folder.path(), 3);
    const std::string path = folder.path().string();
    EXPECT_NE(failure("readers.series", "{path: " + path + ", times: [0, 1]}").find("one time a step"), std::string::npos);
    EXPECT_NE(failure("readers.series", "{path: " + path + ", times: [0, 2, 1]}").find("must increase"), std::string::npos);
    EXPECT_NE(failure("readers.series", "{path: " + path + ", pattern: 'x#.raw'}").find("no file that fits"), std::string::npos);
    EXPECT_NE(failure("readers.series", "{path: " + path + "/t0.raw, pattern: 't#.raw'}").find("goes with a folder"), std::string::npos);
    write_file(folder.path() / "other.nrrd", "NRRD0004\n");
    EXPECT_NE(failure("readers.series", "{path: " + path + "}").find("several kinds"), std::string::npos);

    write_file(folder.path() / "t1.raw.yaml", "dims: [2, 4, 1]\ntype: u8\n");
    auto series = run_node(readers(), "readers.series", "{path: " + path + ", pattern: 't#.raw'}").output<Series>("series");
    EXPECT_NO_THROW(series->fetch(2));
    try {
        series->fetch(1);
        ADD_FAILURE();
    } catch (const Error& e) {
        EXPECT_NE(std::string(e.what()).find("t1.raw is 2 x 4 x 1"), std::string::npos) << e.what();
    }
}

TEST(StepOfSeries, OutOfRangeIsAProblemBeforeAnythingIsRead) {
    TempFolder folder;
    write_steps(folder.path(), 3);
    auto series = run_node(readers(), "readers.series", "{path: " + folder.path().string() + "}").output<Series>("series");
    const NodeType& type = *readers().find("series.step");
    auto described = describe_node(type, params_from_yaml(type, "{index: 3}"), {{"series", {ValueDesc(series->desc())}}});
    ASSERT_EQ(described.problems.size(), 1u);
    EXPECT_EQ(described.problems[0], "index: the series has 3 steps, so 'index' must be from 0 to 2, not 3");
}

TEST(LoadOnce, ThreadsThatAskTogetherLoadOnceAndAFailureIsTriedAgain) {
    std::atomic<int> loads = 0;
    auto source = std::make_shared<LoadOnce>(8, "test", [&](std::span<std::byte> out, const std::stop_token& stop) {
        if (++loads == 1) fail("the first time fails");
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
        check_stop(stop);
        std::fill(out.begin(), out.end(), std::byte(7));
    });
    VolumeDesc desc;
    desc.dims = Index3(2);
    VolumePtr volume = loaded_volume(desc, source);
    Buffer out(8);
    EXPECT_THROW(volume->read(Box::of(desc.dims), out.bytes(), {}), Error);
    EXPECT_EQ(volume->resident_bytes(), 0u);
    std::stop_source stop;
    stop.request_stop();
    EXPECT_THROW(volume->read(Box::of(desc.dims), out.bytes(), stop.get_token()), Cancelled);
    EXPECT_EQ(loads, 1);
    std::vector<std::thread> threads;
    std::atomic<int> right = 0;
    for (int i = 0; i < 8; ++i)
        threads.emplace_back([&] {
            Buffer mine(8);
            volume->read(Box::of(desc.dims), mine.bytes(), {});
            right += mine.as<std::uint8_t>()[7] == 7;
        });
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(right, 8);
    EXPECT_EQ(loads, 2);
}

TEST(SliceVolume, SlicesAreReadOnceWhileBricksOfALayerAreRead) {
    VolumeDesc desc;
    desc.dims = {64, 64, 40};
    std::vector<int> reads(40, 0);
    VolumePtr volume = slice_volume(desc, [&](std::int64_t z, std::span<std::byte> out) {
        ++reads[std::size_t(z)];
        std::fill(out.begin(), out.end(), std::byte(z));
    });
    Buffer brick(16 * 16 * 16);
    for (std::int64_t z = 0; z + 16 <= 40; z += 16)
        for (std::int64_t y = 0; y < 64; y += 16)
            for (std::int64_t x = 0; x < 64; x += 16) {
                volume->read({{x, y, z}, {x + 16, y + 16, z + 16}}, brick.bytes(), {});
                EXPECT_EQ(brick.as<std::uint8_t>()[15 * 256], z + 15);
            }
    for (std::size_t z = 0; z < 32; ++z) EXPECT_EQ(reads[z], 1) << z;
    EXPECT_EQ(volume->resident_bytes(), 32u * 64 * 64);
}

TEST(PackedSteps, CancelledUnpackingStopsAndCanBeTriedAgain) {
    TempFolder folder;
    write_file(folder.path() / "a.raw", gzip(bytes_of_values<std::uint8_t>(ramp(4096))));
    write_file(folder.path() / "a.raw.yaml", "dims: [8, 8, 8, 8]\ntype: u8\ncompression: gzip\n");
    VolumeFilePtr file = open_volume_file(folder.path() / "a.raw");
    std::stop_source stop;
    stop.request_stop();
    Buffer out(512);
    VolumePtr step = file->volume(5);
    EXPECT_THROW(step->read(Box::of(step->desc().dims), out.bytes(), stop.get_token()), Cancelled);
    const std::vector<double> all = ramp(4096);
    EXPECT_EQ(samples(*step), std::vector<double>(all.begin() + 5 * 512, all.begin() + 6 * 512));
}

}  // namespace
}  // namespace voxloom::testing
