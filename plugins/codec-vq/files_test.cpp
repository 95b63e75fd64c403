// Files: what is written comes back, and damage is found.
#include <gmock/gmock.h>

#include <cstdlib>
#include <fstream>

#include "core/data/brick_file.h"
#include "plugins/codec-vq/test_volumes.h"
#include "tests/support/linked_plugin.h"
#include "tests/support/run_node.h"

namespace voxloom::vq {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;

Bytes bytes_of_file(const std::filesystem::path& path) {
    std::ifstream in(path, std::ios::binary);
    const std::string text((std::istreambuf_iterator<char>(in)), {});
    const auto bytes = std::as_bytes(std::span(text));
    return {bytes.begin(), bytes.end()};
}

TEST(VqFile, ComesBackAsItWasWritten) {
    const voxloom::testing::TempFolder folder;
    const std::filesystem::path path = folder.path() / "a.vxq";
    for (const ScalarType type : {ScalarType::u8, ScalarType::i16, ScalarType::f64}) {
        const VolumePtr plain = scene({20, 17, 9}, type, 2);
        VolumeDesc desc = plain->desc();
        desc.name = "density";
        desc.unit = "mm";
        desc.significant_bits = 6;
        Buffer voxels(desc.dense_bytes());
        plain->read(Box::of(desc.dims), voxels.bytes(), {});
        EncodeOptions options = small();
        options.macroblocks = {2, 1, 2};
        const Encoded e = encoded(DenseVolume(desc, std::move(voxels)), options);
        write_file(*e.bricks, path);
        EXPECT_EQ(std::filesystem::file_size(path), e.bricks->desc().compressed_bytes);
        const VqBricksPtr opened = open_file(path);
        EXPECT_EQ(opened->desc().compressed_bytes, e.bricks->desc().compressed_bytes);
        EXPECT_EQ(opened->desc().volume.name, "density");
        EXPECT_EQ(opened->desc().volume.unit, "mm");
        EXPECT_EQ(opened->desc().volume.significant_bits, 6);
        EXPECT_EQ(opened->desc().volume.index_to_world, desc.index_to_world);
        EXPECT_EQ(opened->desc().volume.range, e.bricks->desc().volume.range);
        EXPECT_EQ(opened->index().loop, Loop::closed);
        EXPECT_EQ(opened->index().macroblocks, glm::ivec3(2, 1, 2));
        EXPECT_THAT(opened->index().provenance, HasSubstr("16 codewords, closed loop, 2 x 1 x 2 macroblocks, from density"));
        EXPECT_EQ(decoded(opened), decoded(e.bricks));
        for (std::size_t i = 0; i < e.bricks->index().bricks.infos.size(); ++i) {
            const BrickInfo &a = e.bricks->index().bricks.infos[i], &b = opened->index().bricks.infos[i];
            EXPECT_EQ(a.range, b.range);
            EXPECT_EQ(a.l2, b.l2);
            EXPECT_EQ(a.max_error, b.max_error);
            EXPECT_EQ(a.compressed_bytes, b.compressed_bytes);
        }
        EXPECT_EQ(file_of(*opened), file_of(*e.bricks));
    }
}

TEST(VqFile, NodesWriteAndOpenIt) {
    const voxloom::testing::TempFolder folder;
    const Registry& plugin = voxloom::testing::linked_plugin();
    const std::string path = (folder.path() / "a.vxq").string(), params = "{path: " + path + "}";
    const auto encode = voxloom::testing::run_node(plugin, "vq.encode", "{codewords: 32, brick: '8'}", {{"volume", {scene({20, 17, 9})}}});
    const auto bricks = encode.output<Bricks>("bricks");
    const auto write = voxloom::testing::run_node(plugin, "vq.write", params, {{"bricks", {bricks}}});
    EXPECT_EQ(write.measured("bytes"), double(std::filesystem::file_size(path)));
    const auto opened = voxloom::testing::run_node(plugin, "vq.open", params);
    EXPECT_EQ(decoded(opened.output<Bricks>("bricks")), decoded(bricks));
    EXPECT_EQ(encode.measured("bits per voxel"), 8 * double(std::filesystem::file_size(path)) / (20 * 17 * 9));
    EXPECT_GT(encode.measured("psnr"), 20);
}

// Of the head every bit, of bricks one bit a byte: an Error that names the file or the brick, never other voxels.
TEST(VqFile, AFlippedBitAndATruncationAreFound) {
    const Encoded e = encoded(*scene({9, 4, 3}, ScalarType::u8), small(4));
    const Bytes file = file_of(*e.bricks);
    const std::size_t front = file.size() - e.bricks->payload().size();
    for (std::size_t i = 0; i < file.size(); ++i) {
        for (int bit = 0; bit < 8; ++bit) {
            if (i >= front && bit != int(i % 8)) continue;
            Bytes damaged = file;
            damaged[i] ^= std::byte(1 << bit);
            try {
                decoded(open_bytes(damaged, nullptr, "a.vxq"));
                ADD_FAILURE() << "byte " << i;
            } catch (const Error& error) {
                EXPECT_THAT(error.what(), AnyOf(HasSubstr("a.vxq"), HasSubstr("brick 0 0 0"), HasSubstr("brick 1 0 0")));
            }
        }
        EXPECT_THROW(open_bytes(std::span(file).first(i), nullptr, "a.vxq"), Error);
    }
}

// Behind checksums that agree: an Error or other voxels, and nothing worse.
TEST(VqFile, ForgedBricksAreRefusedOrDecoded) {
    for (const ScalarType type : {ScalarType::u8, ScalarType::f32}) {
        const VolumePtr volume = volume_of({8, 6, 5}, type, 2, [](Index3 i, int c) {
            return i == Index3(1, 2, 4) && c ? NAN : double((i.x * i.y + i.z) % 13);
        });
        const Encoded e = encoded(*volume, small());
        const Bytes whole(e.bricks->payload().begin(), e.bricks->payload().end());
        const BrickForm form = e.bricks->index().form({8, 6, 5});
        Buffer out(form.values() * bytes_of(type));
        const auto books = e.bricks->index().books_of({});
        decode_brick(form, books, whole, out.bytes());
        for (std::size_t i = 0; i < whole.size(); ++i) {
            for (const int change : {1, 128, 255}) {
                Bytes forged = whole;
                forged[i] ^= std::byte(change);
                try {
                    decode_brick(form, books, forged, out.bytes());
                } catch (const Error& error) {
                    EXPECT_STRNE(error.what(), "");
                }
            }
            EXPECT_THROW(decode_brick(form, books, std::span(whole).first(i), out.bytes()), Error);
        }
    }
}

// Heads that an honest writer would not make, with the checksum that fits.
TEST(VqFile, ForgedHeadsAreRefused) {
    const Encoded e = encoded(*scene({9, 9, 9}), small());
    const auto refused = [&](const std::function<void(VqIndex&)>& forge, const char* why) {
        const VqIndex& own = e.bricks->index();
        VqIndex index = own;
        forge(index);
        Bytes file = front_of(index, e.bricks->payload().size());
        file.insert(file.end(), e.bricks->payload().begin(), e.bricks->payload().end());
        try {
            open_bytes(file, nullptr, "a.vxq");
            ADD_FAILURE() << why;
        } catch (const Error& error) {
            EXPECT_THAT(error.what(), HasSubstr(why));
        }
    };
    refused([](VqIndex& i) { i.unit = 0; }, "unit");
    refused([](VqIndex& i) { i.unit = 2; }, "unit");
    refused([](VqIndex& i) { i.loop = Loop(7); }, "loop");
    refused([](VqIndex& i) { i.macroblocks.x = 0; }, "macroblocks");
    refused([](VqIndex& i) { i.macroblocks.y = 3; }, "macroblocks");
    refused([](VqIndex& i) { i.desc.brick.x = 6; }, "multiples of 4");
    refused([](VqIndex& i) { i.desc.brick.x = -8; }, "not possible");
    refused([](VqIndex& i) { i.desc.volume.dims = Index3(1 << 20); }, "too short");
    refused([](VqIndex& i) { i.books[0].voxels.words.clear(); }, "0 codewords");
    refused([](VqIndex& i) { i.books[0].voxels.words.resize(64 * 300); }, "300 codewords");
    refused([](VqIndex& i) { i.books[0].octants.words.back() = NAN; }, "codeword");
    refused([](VqIndex& i) { i.books[0].octants.words.back() = 1e20f; }, "codeword");
    refused([](VqIndex& i) { i.bricks.places[0].size += 1000000; }, "beyond its end");
    refused([](VqIndex& i) { i.bricks.places[0].size -= 1, i.bricks.places[1].size += 1; }, "a brick is too short");
    refused([](VqIndex& i) { i.bricks.places.pop_back(); }, "too short");
    refused([](VqIndex& i) { i.bricks.infos[0].max_error = NAN; }, "statistics");
}

TEST(VqFile, AFailedWriteLeavesTheOldFile) {
    const voxloom::testing::TempFolder folder;
    const std::filesystem::path path = folder.path() / "a.vxq";
    write_file(*encoded(*scene({9, 9, 9}), small()).bricks, path);
    const Bytes before = bytes_of_file(path);
    std::stop_source stop;
    stop.request_stop();
    EXPECT_THROW(write_file(*encoded(*scene({10, 9, 9}), small()).bricks, path, stop.get_token()), Cancelled);
    EXPECT_EQ(bytes_of_file(path), before);
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(VqFile, WhatIsNoneIsSaid) {
    const voxloom::testing::TempFolder folder;
    EXPECT_THROW(open_file(folder.path() / "missing.vxq"), Error);
    EXPECT_THROW(open_file(folder.path()), Error);
    std::ofstream(folder.path() / "empty.vxq");
    EXPECT_THROW(open_file(folder.path() / "empty.vxq"), Error);
}

// Files of every version stay readable, to the same voxels. Set VOXLOOM_WRITE_GOLDEN to write those of a new version.
TEST(VqFile, GoldenFilesStayReadable) {
    for (const ScalarType type : {ScalarType::u8, ScalarType::i16, ScalarType::f32}) {
        const VolumePtr volume = volume_of({11, 9, 6}, type, 1, [](Index3 i, int) {
            return i == Index3(9, 0, 5) ? NAN : double((i.x * i.x + 3 * i.y + i.x * i.z) % 97 + (i.x > 5 ? 20 : 0));
        });
        const auto golden = std::filesystem::path(VOXLOOM_SOURCE_DIR) / "plugins/codec-vq/golden" / fmt::format("v1-{}.vxq", name_of(type));
        EncodeOptions options = small(4);
        options.macroblocks = {2, 1, 1};
        const Encoded e = encoded(*volume, options);
        if (std::getenv("VOXLOOM_WRITE_GOLDEN")) write_file(*e.bricks, golden);
        const VqBricksPtr opened = open_file(golden);
        // The voxels are those that its statistics speak of.
        const auto before = numbers(bytes_of_volume(*volume), type), after = numbers(decoded(opened), type);
        double squares = 0, told = 0;
        for (std::size_t i = 0; i < before.size(); ++i)
            if (std::isfinite(before[i])) squares += (before[i] - after[i]) * (before[i] - after[i]);
        for (const BrickInfo& info : opened->index().bricks.infos) told += info.l2 * info.l2;
        EXPECT_NEAR(squares, told, 1e-9 * told) << golden;
        EXPECT_GT(told, 0);
        // The encoder gives the same bytes on every processor.
        EXPECT_TRUE(file_of(*e.bricks) == bytes_of_file(golden)) << golden;
    }
}

}  // namespace
}  // namespace voxloom::vq
