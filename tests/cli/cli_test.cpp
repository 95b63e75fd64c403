// The command line as a user meets it: what it prints, and its exit status.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdio>
#include <fstream>

#include "core/base/error.h"
#include "tests/support/volumes.h"

namespace voxloom {
namespace {

using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
namespace fs = std::filesystem;

struct Ran {
    int status;
    std::string out, err;
};

struct Cli : ::testing::Test {
    testing::TempFolder folder;

    fs::path write(const std::string& name, const std::string& text) {
        std::ofstream(folder.path() / name, std::ios::binary) << text;
        return folder.path() / name;
    }
    static std::string slurp(const fs::path& file) {
        std::ifstream in(file, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }
    Ran run(const std::string& arguments, const std::string& environment = "") {
        const std::string out = (folder.path() / ".stdout").string(), err = (folder.path() / ".stderr").string();
        const std::string command = "cd " + folder.path().string() + " && " + environment +
                                    " " VOXLOOM_BINARY_DIR "/bin/voxloom " + arguments + " >" + out + " 2>" + err;
        const int status = std::system(command.c_str());
        return {WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status), slurp(out), slurp(err)};
    }
    fs::path graph_reading(const std::string& path) {
        return write("g.yaml", "voxloom: 1\nnodes:\n  - id: ct\n    type: readers.volume\n    set: { path: " +
                                   path + " }\n");
    }
};

TEST_F(Cli, helpTeachesWithExamples) {
    Ran r = run("--help");
    EXPECT_EQ(r.status, 0);
    EXPECT_THAT(r.out, AllOf(HasSubstr("voxloom run"), HasSubstr("--set"), HasSubstr("voxloom nodes")));
    for (const char* command : {"run", "check", "nodes", "info", "compress", "decompress", "edit"})
        EXPECT_EQ(run(std::string(command) + " --help").status, 0) << command;
}

TEST_F(Cli, anEditorWithoutADisplayIsOneSentence) {
    Ran r = run("edit", "env -u DISPLAY -u WAYLAND_DISPLAY");
    EXPECT_EQ(r.status, 1);
    EXPECT_THAT(r.err, ContainsRegex("is there a display|without the editor"));
}

TEST_F(Cli, aWrongOptionIsAUsageError) {
    EXPECT_EQ(run("run --no-such").status, 2);
    EXPECT_EQ(run("").status, 2);
}

TEST_F(Cli, aMisspeltCommandIsToldTheNearest) {
    Ran r = run("chek g.yaml");
    EXPECT_EQ(r.status, 2);
    EXPECT_THAT(r.err, AllOf(HasSubstr("'chek'"), HasSubstr("did you mean 'check'?")));
}

TEST_F(Cli, aPlaceThatTakesNoFilesIsRefusedBeforeAnythingRuns) {
    write("g.yaml", "voxloom: 1\nnodes:\n  - { id: p, type: readers.phantom, set: { dims: [4, 4, 4] } }\n");
    write("taken", "a file");
    for (const char* place : {"--out taken/deep", "--report taken/report.json"}) {
        Ran r = run(std::string("run g.yaml ") + place);
        EXPECT_EQ(r.status, 1) << place;
        EXPECT_THAT(r.err, AllOf(HasSubstr("choose another place"), Not(HasSubstr("node")))) << place;
        EXPECT_THAT(r.out, IsEmpty()) << place;
    }
}

TEST_F(Cli, aMissingGraphIsOneSentence) {
    Ran r = run("run nowhere.yaml");
    EXPECT_EQ(r.status, 1);
    EXPECT_THAT(r.err, HasSubstr("nowhere.yaml"));
    EXPECT_THAT(r.out, IsEmpty());
}

TEST_F(Cli, everyProblemOfAGraphIsSaidWithItsPlace) {
    write("bad.yaml", R"(voxloom: 1
nodes:
  - id: a
    type: readers.phantm
  - id: b
    type: readers.phantom
    set: { knd: ramp, dims: [8, 8] }
  - id: c
    type: bricks.decode
    in: { bricks: b.volume }
  - id: d
    type: bricks.pyramid
    in: { volume: e.volume }
)");
    Ran r = run("check bad.yaml");
    EXPECT_EQ(r.status, 1);
    EXPECT_THAT(r.err, AllOf(HasSubstr("bad.yaml:4:"), HasSubstr("did you mean 'readers.phantom'?")));
    EXPECT_THAT(r.err, AllOf(HasSubstr("bad.yaml:7:"), HasSubstr("did you mean 'kind'?")));
    EXPECT_THAT(r.err, AllOf(HasSubstr("bad.yaml:10:"), HasSubstr("Bricks")));
    EXPECT_THAT(r.err, AllOf(HasSubstr("bad.yaml:13:"), HasSubstr("'e'")));
}

TEST_F(Cli, aCycleIsNamed) {
    write("cycle.yaml", R"(voxloom: 1
nodes:
  - { id: a, type: bricks.decode, in: { bricks: b.bricks } }
  - { id: b, type: bricks.pyramid, in: { volume: a.volume } }
)");
    Ran r = run("run cycle.yaml");
    EXPECT_EQ(r.status, 1);
    EXPECT_THAT(r.err, AllOf(HasSubstr("cycle"), HasSubstr("a"), HasSubstr("b")));
}

TEST_F(Cli, runWritesWhatWasAskedForAndSaysWhere) {
    write("g.yaml", R"(voxloom: 1
nodes:
  - { id: p, type: readers.phantom, set: { kind: ramp, dims: [5, 4, 3], type: u16 } }
)");
    Ran r = run("run g.yaml --out results --report results/r.json");
    EXPECT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.out, HasSubstr("results/p.volume.nrrd"));
    EXPECT_THAT(slurp(folder.path() / "results/p.volume.nrrd"), HasSubstr("sizes: 5 4 3"));
    EXPECT_THAT(slurp(folder.path() / "results/r.json"), HasSubstr("\"state\": \"done\""));
    Ran info = run("info results/p.volume.nrrd --values");
    EXPECT_EQ(info.status, 0) << info.err;
    EXPECT_THAT(info.out, AllOf(HasSubstr("5 x 4 x 3"), HasSubstr("u16"), HasSubstr("mean")));
}

TEST_F(Cli, setChangesOneRun) {
    write("g.yaml", "voxloom: 1\nnodes:\n  - { id: p, type: readers.phantom, set: { dims: [5, 4, 3] } }\n");
    Ran r = run("check g.yaml --set p.dims=[7,6,5]");
    EXPECT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.out, HasSubstr("7 x 6 x 5"));
    r = run("run g.yaml --set p.dimz=[7,6,5]");
    EXPECT_EQ(r.status, 1);
    EXPECT_THAT(r.err, HasSubstr("did you mean 'dims'?"));
    EXPECT_EQ(run("run g.yaml --output q.volume").status, 1);
}

TEST_F(Cli, aSweepWritesFilesAndARowForEachStep) {
    write("g.yaml", R"(voxloom: 1
outputs: [level.volume, rarely.volume]
nodes:
  - { id: field, type: readers.phantom, set: { kind: ramp, dims: [32, 32, 32] } }
  - { id: pyramid, type: bricks.pyramid, in: { volume: field.volume }, set: { brick: [8, 8, 8] } }
  - { id: level, type: bricks.decode, in: { bricks: pyramid.bricks } }
  - { id: rarely, type: bricks.decode, in: { bricks: pyramid.bricks } }
)");
    Ran r = run("run g.yaml --quiet --sweep level.level=0..2 --every rarely=2");
    EXPECT_EQ(r.status, 0) << r.err;
    for (const char* file : {"level.volume.0000.nrrd", "level.volume.0001.nrrd", "level.volume.0002.nrrd",
                             "rarely.volume.0000.nrrd", "rarely.volume.0002.nrrd"})
        EXPECT_TRUE(fs::exists(folder.path() / "out" / file)) << file;
    EXPECT_FALSE(fs::exists(folder.path() / "out" / "rarely.volume.0001.nrrd"));
    const std::string table = slurp(folder.path() / "out" / "sweep.csv");
    EXPECT_EQ(std::ranges::count(table, '\n'), 4);
    EXPECT_THAT(table, AllOf(HasSubstr("step,level.level,seconds"), HasSubstr("level cpu seconds"), HasSubstr("\n2,2,")));

    for (const char* wrong : {"level.level=0", "level.level=a..b", "level.level=0..2..-1", "level.level=0..2..0"}) {
        r = run(std::string("run g.yaml --quiet --sweep ") + wrong);
        EXPECT_EQ(r.status, 1) << wrong;
        EXPECT_THAT(r.err, HasSubstr("--sweep")) << wrong;
    }
    EXPECT_EQ(run("run g.yaml --quiet --sweep level.level=0..9").status, 1);  // there are fewer levels
    EXPECT_EQ(run("run g.yaml --sweep level.level=0..1 --every nobody=2").status, 1);
}

TEST_F(Cli, jsonIsAllThatStandsOnStandardOutput) {
    write("g.yaml", "voxloom: 1\nnodes:\n  - { id: p, type: readers.phantom, set: { dims: [5, 4, 3] } }\n");
    for (const char* command : {"run g.yaml --json", "check g.yaml --json", "nodes --json"}) {
        Ran r = run(command);
        EXPECT_EQ(r.status, 0) << r.err;
        ASSERT_FALSE(r.out.empty());
        EXPECT_THAT(r.out.front(), ::testing::AnyOf('{', '[')) << command;
    }
}

TEST_F(Cli, nodesTellsHowToUseOne) {
    Ran r = run("nodes readers.phantom");
    EXPECT_EQ(r.status, 0);
    EXPECT_THAT(r.out, AllOf(HasSubstr("`dims`"), HasSubstr("marschner-lobb")));
    r = run("nodes readers.fantom");
    EXPECT_EQ(r.status, 1);
    EXPECT_THAT(r.err, HasSubstr("readers.phantom"));
}

TEST_F(Cli, badFilesAreOneSentenceEachAndNothingIsWritten) {
    write("empty.nrrd", "");
    write("magic.nrrd", "PNG not a volume at all");
    write("cut.nrrd", "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 100 100 100\nencoding: raw\n\nabc");
    write("huge.raw.yaml", "dims: [4000000000, 4000000000, 4000000000]\ntype: f64\n");
    write("huge.raw", "x");
    write("text.txt", "hello");
    fs::create_directory(folder.path() / "no-images");
    for (const char* path : {"missing.nrrd", "empty.nrrd", "magic.nrrd", "cut.nrrd", "huge.raw", "text.txt", "no-images"}) {
        graph_reading(path);
        Ran r = run("run g.yaml --out results");
        EXPECT_EQ(r.status, 1) << path;
        EXPECT_THAT(r.err, AllOf(HasSubstr(path), HasSubstr("'ct'"))) << path;
        EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << path << ": " << r.err;
        EXPECT_FALSE(fs::exists(folder.path() / "results/ct.volume.nrrd")) << path;
        EXPECT_EQ(run(std::string("info ") + path).status, 1) << path;
    }
}

TEST_F(Cli, interruptEndsARunAndLeavesNothingHalf) {
    write("g.yaml", "voxloom: 1\nnodes:\n  - { id: p, type: readers.phantom, set: { kind: ct-head, dims: [900, 900, 900] } }\n");
    Ran r = run("run g.yaml --out results & pid=$!; sleep 1; kill -INT $pid; wait $pid; echo status $?");
    EXPECT_THAT(slurp(folder.path() / ".stdout") + r.out, HasSubstr("status 130"));
    EXPECT_TRUE(!fs::exists(folder.path() / "results") || fs::is_empty(folder.path() / "results"));
}

TEST_F(Cli, compressAndDecompressGiveTheSameFileBack) {
    std::string voxels(20 * 17 * 9, '\0');
    for (std::size_t i = 0; i < voxels.size(); ++i) voxels[i] = char(i * i % 51);
    const fs::path raw = write("v.nrrd", "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 20 17 9\nencoding: raw\n\n" + voxels);
    const Ran packed = run("compress v.nrrd v.vxw --coder fast");
    EXPECT_EQ(packed.status, 0) << packed.err;
    EXPECT_EQ(run("decompress v.vxw back.nrrd").status, 0);
    EXPECT_THAT(slurp(folder.path() / "back.nrrd"), ::testing::EndsWith(voxels));
    EXPECT_EQ(run("decompress v.vxw half.nrrd --level 1").status, 0);
    EXPECT_THAT(slurp(folder.path() / "half.nrrd"), HasSubstr("sizes: 10 9 9"));
    const auto lossless = fs::file_size(folder.path() / "v.vxw");
    EXPECT_EQ(run("compress v.nrrd v.vxw --max-error 20").status, 0);
    EXPECT_LT(fs::file_size(folder.path() / "v.vxw"), lossless);
}

TEST_F(Cli, everyCodecCompressesAndTellsWhatIsInside) {
    std::string voxels(20 * 17 * 9, '\0');
    for (std::size_t i = 0; i < voxels.size(); ++i) voxels[i] = char(i * i % 51);
    write("v.nrrd", "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 20 17 9\nencoding: raw\n\n" + voxels);
    for (const std::string codec : {"raw", "zfp", "blosc", "jpeg2000", "jpegls", "jpegxl"}) {
        if (run("nodes " + codec + ".encode").status != 0) continue;  // its library is not there
        const Ran packed = run("compress v.nrrd v.vxb --brick 16 --codec " + codec);
        EXPECT_EQ(packed.status, 0) << packed.err;
        EXPECT_THAT(run("info v.vxb").out, AllOf(HasSubstr(codec + ".encode"), HasSubstr("16 x 16 x 16"), HasSubstr("20 x 17 x 9")));
        EXPECT_EQ(run("decompress v.vxb back.nrrd").status, 0);
        EXPECT_THAT(slurp(folder.path() / "back.nrrd"), ::testing::EndsWith(voxels)) << codec;
    }
}

TEST_F(Cli, optionsThatACodecDoesNotHaveAreSaid) {
    write("v.nrrd", "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 1\nencoding: raw\n\nabcd");
    if (run("nodes blosc.encode").status == 0) {
        EXPECT_EQ(run("compress v.nrrd v.vxb --codec blosc --coder lz4 --set level=9").status, 0);
        EXPECT_THAT(run("compress v.nrrd v.vxb --codec blosc --psnr 50").err, HasSubstr("takes no --psnr"));
        EXPECT_THAT(run("compress v.nrrd v.vxb --codec blosc --coder lz5").err, HasSubstr("lz4"));
        EXPECT_THAT(run("compress v.nrrd v.vxb --codec blosc --set leve=1").err, HasSubstr("did you mean 'level'?"));
    }
    EXPECT_THAT(run("compress v.nrrd v.vxb --codec raw --coder lz4").err, HasSubstr("has no --coder"));
    if (run("nodes zfp.encode").status == 0) {
        EXPECT_THAT(run("compress v.nrrd v.vxb --codec zfp --threshold 3").err, AllOf(HasSubstr("no --threshold"), HasSubstr("--psnr")));
    }
    write("bad.vxb", "voxbrick and then nothing");
    for (const char* command : {"decompress bad.vxb b.nrrd", "info bad.vxb"})
        EXPECT_THAT(run(command).err, HasSubstr("not a brick file")) << command;
}

TEST_F(Cli, compressingNonsenseIsOneSentence) {
    EXPECT_EQ(run("compress a.nrrd b.vxw --psnr 40 --lossless").status, 2);
    EXPECT_THAT(run("compress a.nrrd b.vxw --codec none").err, HasSubstr("no codec 'none'"));
    write("a.vxw", "nothing of the kind");
    const Ran r = run("decompress a.vxw b.nrrd");
    EXPECT_EQ(r.status, 1);
    EXPECT_THAT(r.err, HasSubstr("a.vxw"));
    EXPECT_FALSE(fs::exists(folder.path() / "b.nrrd"));
}

TEST_F(Cli, aPluginFolderWithoutPluginsIsSaid) {
    fs::create_directory(folder.path() / "plugins");
    Ran r = run("nodes", "VOXLOOM_PLUGIN_PATH=" + (folder.path() / "plugins").string());
    EXPECT_EQ(r.status, 0);  // the install folder still has them
    write("plugins/bad.so", "not a library");
    r = run("nodes", "VOXLOOM_PLUGIN_PATH=" + (folder.path() / "plugins").string());
    EXPECT_EQ(r.status, 0);
    EXPECT_THAT(r.err, AllOf(HasSubstr("bad.so"), HasSubstr("cannot be loaded")));
}

}  // namespace
}  // namespace voxloom
