#include <gtest/gtest.h>
#include <sys/resource.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstring>
#include <fstream>
#include <limits>

#include "core/base/output_file.h"
#include "plugins/writers/volume_header.h"
#include "plugins/writers/writers.h"
#include "tests/support/run_node.h"
#include "tests/support/volumes.h"

namespace voxloom {
namespace {

namespace fs = std::filesystem;
using testing::NodeRun;
using testing::TempFolder;

const Registry& writers() {
    static const Registry registry = [] {
        Registry r;
        add_volume_writer(r);
        return r;
    }();
    return registry;
}

NodeRun write(VolumePtr volume, const fs::path& folder, const std::string& params,
              std::stop_token stop = {}) {
    testing::RunNodeOptions options;
    options.output_folder = folder;
    options.stop = std::move(stop);
    return testing::run_node(writers(), "writers.volume", params, {{"volume", {volume}}}, options);
}

std::string content(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    EXPECT_TRUE(in) << file;
    return {std::istreambuf_iterator<char>(in), {}};
}

std::vector<std::string> names_in(const fs::path& folder) {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder))
        names.push_back(entry.path().filename().string());
    std::sort(names.begin(), names.end());
    return names;
}

VolumePtr ramp(Index3 dims, ScalarType type) {
    return testing::make_volume(dims, type,
                                [](auto x, auto y, auto z) { return double(x + 3 * y - 7 * z); });
}

TEST(WriteVolume, ANrrdIsItsHeaderAndItsVoxels) {
    TempFolder folder;
    VolumePtr volume = ramp({3, 2, 2}, ScalarType::i16);
    write(volume, folder.path(), "{path: a.nrrd}");
    EXPECT_EQ(names_in(folder.path()), std::vector<std::string>{"a.nrrd"});
    const std::string text = content(folder.path() / "a.nrrd");
    const std::size_t end = text.find("\n\n");
    ASSERT_NE(end, std::string::npos);
    EXPECT_EQ(text.substr(0, end),
              "NRRD0005\n# written by voxloom\ntype: int16\ndimension: 3\nspace dimension: "
              "3\nsizes: 3 2 2\n"
              "space directions: (1,0,0) (0,1,0) (0,0,1)\nkinds: domain domain domain\nspace "
              "origin: (0,0,0)\n"
              "encoding: raw\nendian: little");
    EXPECT_EQ(text.substr(end + 2), std::string(reinterpret_cast<const char*>(volume->data()), 24));
}

TEST(WriteVolume, HeadersKeepTheWholeDescription) {
    VolumeDesc desc;
    desc.dims = {5, 4, 3};
    desc.type = ScalarType::u16;
    desc.components = 3;
    desc.color = true;
    desc.unit = "mm";
    desc.name = "two\nlines";
    desc.significant_bits = 12;
    desc.index_to_world = glm::dmat4(0, 0.1, 0, 0, -2, 0, 0, 0, 0, 0, 3, 0, 7, 8.5, -9, 1);
    const std::string nrrd = nrrd_header(desc, true, "x.raw.gz");
    for (const char* line :
         {"\ndimension: 4\n", "\nsizes: 3 5 4 3\n", "\ncontent: two lines\n",
          "\nspace directions: none (0,0.1,0) (-2,0,0) (0,0,3)\n",
          "\nkinds: RGB-color domain domain domain\n", "\nspace units: \"mm\" \"mm\" \"mm\"\n",
          "\nspace origin: (7,8.5,-9)\n", "\nencoding: gzip\n", "\ndata file: x.raw.gz\n",
          "\nsignificant_bits:=12\n"})
        EXPECT_NE(nrrd.find(line), std::string::npos) << line;
    const std::string meta = meta_header(desc, "");
    for (const char* line :
         {"\nTransformMatrix = 0 1 0 -1 0 0 0 0 1\n", "\nElementSpacing = 0.1 2 3\n",
          "\nOffset = 7 8.5 -9\n", "\nElementNumberOfChannels = 3\n",
          "\nElementType = MET_USHORT\n", "\nDimSize = 5 4 3\n", "\nElementDataFile = LOCAL\n"})
        EXPECT_NE(meta.find(line), std::string::npos) << line;
    const std::string raw = raw_sidecar(desc, true);
    for (const char* line :
         {"\ndims: [5, 4, 3]\n", "\ntype: u16\n", "\ncomponents: 3\n", "\ncolor: true\n",
          "\nspacing: [0.1, 2, 3]\n", "\norigin: [7, 8.5, -9]\n",
          "\ndirection: [0, 1, 0, -1, 0, 0, 0, 0, 1]\n", "\nunit: mm\n",
          "\nname: \"two\\x0alines\"\n", "\nsignificant_bits: 12\n", "\ncompression: gzip\n"})
        EXPECT_NE(raw.find(line), std::string::npos) << line;
}

TEST(WriteVolume, DetachedFormatsAreTwoFilesThatNameEachOther) {
    TempFolder folder;
    VolumePtr volume = ramp({4, 3, 2}, ScalarType::u8);
    write(volume, folder.path(), "{path: deep/er/v.ct.nhdr}");
    EXPECT_EQ(names_in(folder.path() / "deep/er"),
              (std::vector<std::string>{"v.ct.nhdr", "v.ct.raw"}));
    EXPECT_NE(content(folder.path() / "deep/er/v.ct.nhdr").find("data file: v.ct.raw\n"),
              std::string::npos);
    write(volume, folder.path(), "{path: b.mhd}");
    EXPECT_NE(content(folder.path() / "b.mhd").find("ElementDataFile = b.raw\n"),
              std::string::npos);
    write(volume, folder.path(), "{path: c.raw}");
    EXPECT_EQ(content(folder.path() / "c.raw"), content(folder.path() / "b.raw"));
    EXPECT_EQ(content(folder.path() / "c.raw").size(), 24u);
    EXPECT_TRUE(fs::exists(folder.path() / "c.raw.yaml"));
}

TEST(WriteVolume, GzipUnpacksToTheVoxelsAndIsTheSameEachTime) {
    TempFolder folder;
    VolumePtr volume = ramp({61, 50, 40}, ScalarType::f32);
    NodeRun run = write(volume, folder.path(), "{path: a.raw, compression: gzip, level: 9}");
    EXPECT_GT(run.measured("ratio"), 2);
    write(volume, folder.path(), "{path: b.raw, compression: gzip, level: 9}");
    EXPECT_EQ(content(folder.path() / "a.raw"), content(folder.path() / "b.raw"));
    gzFile file = gzopen((folder.path() / "a.raw").c_str(), "rb");
    std::vector<char> voxels(61 * 50 * 40 * 4 + 1);
    EXPECT_EQ(gzread(file, voxels.data(), unsigned(voxels.size())), 488000);
    gzclose(file);
    EXPECT_EQ(std::memcmp(voxels.data(), volume->data(), 488000), 0);
}

// Counts what is asked of it; long rows force slabs that are parts of a row.
class Streamed final : public Volume {
  public:
    explicit Streamed(VolumeDesc desc) : Volume(std::move(desc)) {}
    void read(const Box& box, std::span<std::byte> out, const std::stop_token&) const override {
        largest_ = std::max<std::uint64_t>(largest_, out.size());
        ++reads_;
        if (stop_after_ && reads_ == stop_after_) stop_.request_stop();
        const Index3 n = box.dims();
        std::size_t i = 0;
        for (std::int64_t z = 0; z < n.z; ++z)
            for (std::int64_t y = 0; y < n.y; ++y)
                for (std::int64_t x = 0; x < n.x; ++x)
                    out[i++] = std::byte((box.lo.x + x) * 31 + (box.lo.y + y) * 7 + box.lo.z + z);
    }
    void read_mask(const Box&, std::span<std::uint8_t> out) const override {
        for (std::size_t i = 0; i < out.size(); ++i) out[i] = i % 3 != 0;
    }
    mutable std::uint64_t largest_ = 0;
    mutable int reads_ = 0;
    int stop_after_ = 0;
    mutable std::stop_source stop_;
};

VolumeDesc desc_of(Index3 dims) {
    VolumeDesc desc;
    desc.dims = dims;
    return desc;
}

TEST(WriteVolume, SlabsAreBoundedInMemoryAndCoverTheFileInOrder) {
    for (Index3 dims :
         {Index3(17000001, 1, 1), Index3(5000, 3400, 2), Index3(300, 260, 250), Index3(1, 1, 17)}) {
        TempFolder folder;
        auto volume = std::make_shared<Streamed>(desc_of(dims));
        write(volume, folder.path(), "{path: big.raw}");
        EXPECT_LE(volume->largest_, 16u << 20);
        const std::string bytes = content(folder.path() / "big.raw");
        ASSERT_EQ(bytes.size(), volume->desc().voxels());
        std::size_t wrong = 0, i = 0;
        for (std::int64_t z = 0; z < dims.z; ++z)
            for (std::int64_t y = 0; y < dims.y; ++y)
                for (std::int64_t x = 0; x < dims.x; ++x)
                    wrong += std::uint8_t(bytes[i++]) != std::uint8_t(x * 31 + y * 7 + z);
        EXPECT_EQ(wrong, 0u);
    }
}

TEST(WriteVolume, CancelLeavesNothingBehindAndTheOldFileWhole) {
    TempFolder folder;
    auto volume = std::make_shared<Streamed>(desc_of({6000, 5000, 4}));
    volume->stop_after_ = 3;
    std::ofstream(folder.path() / "v.nrrd") << "old";
    EXPECT_THROW(write(volume, folder.path(), "{path: v.nrrd}", volume->stop_.get_token()),
                 Cancelled);
    EXPECT_EQ(volume->reads_, 3);
    EXPECT_EQ(names_in(folder.path()), std::vector<std::string>{"v.nrrd"});
    EXPECT_EQ(content(folder.path() / "v.nrrd"), "old");
}

TEST(WriteVolume, AFullDiskIsAnErrorThatLeavesNothingBehind) {
    TempFolder folder;
    // A limit on file sizes stands in for the disk's end.
    rlimit before{};
    getrlimit(RLIMIT_FSIZE, &before);
    auto handler = std::signal(SIGXFSZ, SIG_IGN);
    rlimit small = before;
    small.rlim_cur = 100000;
    setrlimit(RLIMIT_FSIZE, &small);
    std::string message;
    try {
        write(ramp({100, 100, 100}, ScalarType::u8), folder.path(), "{path: v.mha}");
    } catch (const Error& e) {
        message = e.what();
    }
    setrlimit(RLIMIT_FSIZE, &before);
    std::signal(SIGXFSZ, handler);
    EXPECT_NE(message.find("v.mha: cannot be written"), std::string::npos) << message;
    EXPECT_NE(message.find("free some space"), std::string::npos) << message;
    EXPECT_TRUE(names_in(folder.path()).empty());
}

TEST(WriteVolume, AMaskBecomesNaNInFloatsAndAWarningInIntegers) {
    TempFolder folder;
    VolumeDesc desc = desc_of({7, 1, 1});
    desc.has_mask = true;
    auto integers = std::make_shared<Streamed>(desc);
    EXPECT_EQ(write(integers, folder.path(), "{path: a.raw}").warnings.size(), 1u);

    desc.type = ScalarType::f32;
    Buffer voxels(desc.dense_bytes()), mask(desc.voxels());
    std::fill_n(voxels.as<float>().data(), 7, 2.5f);
    for (std::size_t i = 0; i < 7; ++i) mask.as<std::uint8_t>()[i] = i != 4;
    auto floats = std::make_shared<DenseVolume>(desc, std::move(voxels), std::move(mask));
    EXPECT_TRUE(write(floats, folder.path(), "{path: b.raw}").warnings.empty());
    const std::string bytes = content(folder.path() / "b.raw");
    for (std::size_t i = 0; i < 7; ++i) {
        float v;
        std::memcpy(&v, bytes.data() + 4 * i, 4);
        if (i == 4)
            EXPECT_TRUE(std::isnan(v));
        else
            EXPECT_EQ(v, 2.5f);
    }
}

TEST(WriteVolume, WhatCannotBeWrittenIsRefusedWithItsMend) {
    TempFolder folder;
    auto message = [&](VolumePtr volume, const std::string& params) -> std::string {
        try {
            write(volume, folder.path(), params);
        } catch (const Error& e) {
            return e.what();
        }
        return "";
    };
    VolumePtr one = ramp({1, 1, 1}, ScalarType::f64), none = ramp({0, 3, 3}, ScalarType::u8);
    EXPECT_NE(message(one, "{path: a.jpg}").find(".nrrd, .nhdr"), std::string::npos);
    EXPECT_NE(message(one, "{path: a.mha, compression: gzip}").find("without compression"),
              std::string::npos);
    EXPECT_NE(message(none, "{path: a.nrrd}").find("only be written as .raw"), std::string::npos);
    fs::create_directory(folder.path() / "d.nrrd");
    EXPECT_NE(message(one, "{path: d.nrrd}").find("it is a folder"), std::string::npos);
    EXPECT_NE(message(one, "{path: /proc/nowhere/a.nrrd}").find("cannot be written"),
              std::string::npos);
    EXPECT_EQ(message(none, "{path: none.raw}"), "");
    EXPECT_EQ(fs::file_size(folder.path() / "none.raw"), 0u);
    EXPECT_EQ(message(one, "{path: one.nhdr}"), "");
}

TEST(OutputFile, ReplacesTheOldFileOnlyWhenCommitted) {
    TempFolder folder;
    const fs::path path = folder.path() / "f";
    {
        OutputFile file(path);
        file.write("first");
        file.commit();
    }
    {
        OutputFile file(path);
        file.write("second, never finished");
    }
    EXPECT_EQ(content(path), "first");
    EXPECT_EQ(names_in(folder.path()), std::vector<std::string>{"f"});
}

}  // namespace
}  // namespace voxloom
