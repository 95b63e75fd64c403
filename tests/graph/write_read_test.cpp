// What writers.volume writes, readers.volume reads: voxels, type, components and place in the
// world.
#include <gtest/gtest.h>

#include <glm/gtc/matrix_transform.hpp>

#include "tests/support/run_node.h"
#include "tests/support/sample_values.h"
#include "tests/support/volumes.h"

namespace voxloom {
namespace {

using testing::built_plugins;
using testing::run_node;
using testing::TempFolder;

// Any bits for integers; for floats all kinds of values, special ones too.
VolumePtr awkward_volume(Index3 dims, ScalarType type, int components) {
    VolumeDesc desc;
    desc.dims = dims;
    desc.type = type;
    desc.components = components;
    desc.color = components >= 3 && !is_float(type);
    desc.unit = "mm";
    desc.name = "head of 'Ada', 1 : 2";
    desc.significant_bits = type == ScalarType::u16 ? 12 : 0;
    desc.index_to_world =
        glm::scale(glm::rotate(glm::translate(glm::dmat4(1.0), glm::dvec3(-12.1, 0.3, 1e3)), 0.7,
                               glm::normalize(glm::dvec3(3, -1, 2))),
                   glm::dvec3(0.1, 2.5, -1.0 / 3));
    Buffer voxels(desc.dense_bytes());
    std::uint64_t state = 12345;
    for (std::byte& b : voxels.bytes())
        b = std::byte((state = state * 6364136223846793005u + 1442695040888963407u) >> 56);
    return std::make_shared<DenseVolume>(desc, std::move(voxels));
}

// The volume as it comes back from a file, and what the reader had to say.
testing::NodeRun through_file(VolumePtr volume, const TempFolder& folder, const std::string& name,
                              const std::string& more = {}, const std::string& read_name = {}) {
    testing::RunNodeOptions options;
    options.output_folder = options.graph_folder = folder.path();
    run_node(built_plugins(), "writers.volume", "{path: " + name + more + "}",
             {{"volume", {volume}}}, options);
    return run_node(built_plugins(), "readers.volume",
                    "{path: " + (read_name.empty() ? name : read_name) + "}", {}, options);
}

void expect_equal(const Volume& a, const Volume& b, bool nameless) {
    ASSERT_EQ(a.desc().dims, b.desc().dims);
    ASSERT_EQ(a.desc().type, b.desc().type);
    ASSERT_EQ(a.desc().components, b.desc().components);
    std::vector<std::byte> va(a.desc().dense_bytes()), vb(va.size());
    a.read(Box::of(a.desc().dims), va, {});
    b.read(Box::of(b.desc().dims), vb, {});
    EXPECT_EQ(va, vb);
    for (int c = 0; c < 4; ++c)
        for (int r = 0; r < 4; ++r)
            EXPECT_NEAR(a.desc().index_to_world[c][r], b.desc().index_to_world[c][r], 1e-12)
                << c << " " << r;
    if (nameless) return;
    EXPECT_EQ(a.desc().color, b.desc().color);
    EXPECT_EQ(a.desc().unit, b.desc().unit);
    EXPECT_EQ(a.desc().name, b.desc().name);
}

class WriteRead : public ::testing::TestWithParam<const char*> {};

TEST_P(WriteRead, KeepsEveryTypeAndComponentCount) {
    const std::string extension = GetParam();
    TempFolder folder;
    for (int t = 0; t < kScalarTypes; ++t)
        for (int components : {1, 2, 3, 4}) {
            SCOPED_TRACE(fmt::format("{} {} x {}", extension, name_of(ScalarType(t)), components));
            VolumePtr volume = awkward_volume({7, 5, 3}, ScalarType(t), components);
            expect_equal(*volume, *through_file(volume, folder, "v." + extension).volume(),
                         extension[0] == 'm');
        }
}

TEST_P(WriteRead, KeepsThinAndPrimeSizes) {
    const std::string extension = GetParam();
    TempFolder folder;
    for (Index3 dims : {Index3(1, 1, 1), Index3(1, 7, 5), Index3(17, 1, 1), Index3(13, 11, 1),
                        Index3(31, 1, 3)}) {
        SCOPED_TRACE(fmt::format("{} {} {} {}", extension, dims.x, dims.y, dims.z));
        VolumePtr volume = awkward_volume(dims, ScalarType::i16, 1);
        expect_equal(*volume, *through_file(volume, folder, "v." + extension).volume(),
                     extension[0] == 'm');
    }
}

INSTANTIATE_TEST_SUITE_P(Formats, WriteRead, ::testing::Values("nrrd", "nhdr", "mha", "mhd", "raw"),
                         [](const auto& format) { return std::string(format.param); });

TEST(WriteReadGzip, KeepsTheVoxels) {
    TempFolder folder;
    VolumePtr volume = awkward_volume({40, 30, 20}, ScalarType::u16, 1);
    for (const char* name : {"v.nrrd", "v.nhdr", "v.raw"}) {
        SCOPED_TRACE(name);
        expect_equal(*volume, *through_file(volume, folder, name, ", compression: gzip").volume(),
                     false);
    }
}

TEST(WriteReadRaw, KeepsSignificantBitsAndVolumesWithoutVoxels) {
    TempFolder folder;
    EXPECT_EQ(through_file(awkward_volume({3, 3, 3}, ScalarType::u16, 1), folder, "v.raw")
                  .volume()
                  ->desc()
                  .significant_bits,
              12);
    // An empty file says nothing of itself; its description does.
    VolumePtr none = through_file(awkward_volume({0, 3, 3}, ScalarType::u8, 1), folder, "none.raw",
                                  "", "none.raw.yaml")
                         .volume();
    EXPECT_EQ(none->desc().dims, Index3(0, 3, 3));
}

TEST(WriteReadStream, ALargePhantomIsWrittenAndReadByRegionWithoutBeingHeld) {
    TempFolder folder;
    VolumePtr phantom = run_node(built_plugins(), "readers.phantom",
                                 "{kind: ct-head, type: i16, dims: [301, 307, 257]}")
                            .volume();
    const std::uint64_t before = buffer_bytes_in_use();
    VolumePtr back = through_file(phantom, folder, "head.nrrd").volume();
    EXPECT_TRUE(back->reads_by_region());
    const Box box{{100, 110, 120}, {133, 143, 153}};
    std::vector<std::byte> a(box.voxels() * 2), b(a.size());
    phantom->read(box, a, {});
    back->read(box, b, {});
    EXPECT_EQ(a, b);
    EXPECT_LT(buffer_bytes_in_use() - before, phantom->desc().dense_bytes() / 4);
}

}  // namespace
}  // namespace voxloom
