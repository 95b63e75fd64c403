// Brick files: what is written comes back, and damage is found.
#include <gmock/gmock.h>

#include <cstdlib>
#include <cstring>
#include <fstream>

#include "core/base/hash.h"
#include "core/data/brick_file.h"
#include "plugins/codec-baseline/test_volumes.h"

namespace voxloom::baseline {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;

Bytes bytes_of_file(const std::filesystem::path& path) {
    std::ifstream in(path, std::ios::binary);
    const std::string text((std::istreambuf_iterator<char>(in)), {});
    const auto bytes = std::as_bytes(std::span(text));
    return {bytes.begin(), bytes.end()};
}
Bytes file_of(const FlatBricks& bricks) {
    Bytes file = front_of(bricks.index(), bricks.payload().size());
    file.insert(file.end(), bricks.payload().begin(), bricks.payload().end());
    return file;
}

class BrickFile : public EveryCodec {
  protected:
    std::filesystem::path path() const { return folder_.path() / "a.vxb"; }
    voxloom::testing::TempFolder folder_;
};
INSTANTIATE_TEST_SUITE_P(Codecs, BrickFile, ::testing::ValuesIn(codecs()), name_of_instance);

TEST_P(BrickFile, ComesBackAsItWasWritten) {
    const VolumePtr plain = scene({20, 17, 9});
    VolumeDesc desc = plain->desc();
    desc.name = "density";
    desc.unit = "mm";
    desc.significant_bits = 12;
    Buffer voxels(desc.dense_bytes());
    plain->read(Box::of(desc.dims), voxels.bytes(), {});
    const DenseVolume volume(desc, std::move(voxels));
    const Encoded e = encoded(volume, codec(), fast(codec().targets.size() > 1 ? Target::psnr : Target::lossless, 40));
    write_file(*e.bricks, path());
    EXPECT_EQ(std::filesystem::file_size(path()), e.bricks->desc().compressed_bytes);
    const FlatBricksPtr opened = open_file(path());
    EXPECT_EQ(opened->desc().compressed_bytes, e.bricks->desc().compressed_bytes);
    EXPECT_EQ(opened->desc().volume.name, "density");
    EXPECT_EQ(opened->desc().volume.unit, "mm");
    EXPECT_EQ(opened->desc().volume.significant_bits, 12);
    EXPECT_EQ(opened->desc().volume.index_to_world, desc.index_to_world);
    EXPECT_EQ(opened->desc().volume.range, e.bricks->desc().volume.range);
    EXPECT_EQ(opened->index().codec, &codec());
    EXPECT_EQ(decoded(opened), decoded(e.bricks));
    for (std::size_t i = 0; i < e.bricks->index().bricks.infos.size(); ++i) {
        const BrickInfo &a = e.bricks->index().bricks.infos[i], &b = opened->index().bricks.infos[i];
        EXPECT_EQ(a.range, b.range);
        EXPECT_EQ(a.l2, b.l2);
        EXPECT_EQ(a.max_error, b.max_error);
        EXPECT_EQ(a.compressed_bytes, b.compressed_bytes);
    }
    EXPECT_THAT(provenance_of(path()).value_or(""), AllOf(HasSubstr(std::string(codec().name) + ".encode"), HasSubstr("density")));
}

// One bit of each byte; of the head all bits, once for all codecs, below.
TEST_P(BrickFile, AFlippedBitAndATruncationAreFound) {
    const Encoded e = encoded(*scene({5, 4, 3}, ScalarType::u8), codec(), fast(Target::lossless, 0, 4));
    const Bytes file = file_of(*e.bricks);
    for (std::size_t i = 0; i < file.size(); ++i) {
        Bytes damaged = file;
        damaged[i] ^= std::byte(1 << i % 8);
        try {
            decoded(open_bytes(damaged, nullptr, "a.vxb"));
            ADD_FAILURE() << "byte " << i;
        } catch (const Error& error) {
            EXPECT_THAT(error.what(), AnyOf(HasSubstr("a.vxb"), HasSubstr("brick 0 0 0"), HasSubstr("brick 1 0 0")));
        }
        EXPECT_THROW(open_bytes(std::span(file).first(i), nullptr, "a.vxb"), Error);
    }
}

TEST(BrickFiles, EveryBitOfTheHeadIsChecked) {
    const Encoded e = encoded(*scene({5, 4, 3}, ScalarType::u8), raw_codec(), fast(Target::lossless, 0, 4));
    const Bytes front = front_of(e.bricks->index(), e.bricks->payload().size());
    for (std::size_t i = 0; i < 8 * front.size(); ++i) {
        Bytes damaged = file_of(*e.bricks);
        damaged[i / 8] ^= std::byte(1 << i % 8);
        EXPECT_THROW(open_bytes(damaged, nullptr, "a.vxb"), Error);
    }
}

// Behind checksums that agree: an Error or other voxels, and nothing worse. CharLS may not come back from what
// nobody encoded, so it is left out.
TEST_P(BrickFile, ForgedBricksAreRefusedOrDecoded) {
    if (codec().name == "jpegls") return;
    const VolumePtr volume = scene({8, 8, 4});
    const Encoded e = encoded(*volume, codec(), fast());
    const Bytes whole(e.bricks->payload().begin(), e.bricks->payload().end());
    const Form form = e.bricks->index().form({8, 8, 4});
    Buffer out(form.bytes());
    for (std::size_t i = 0; i < whole.size(); ++i) {
        Bytes forged = whole;
        forged[i] ^= std::byte(1 << i % 8);
        try {
            decode_brick(codec(), form, e.bricks->index().setting, forged, out.bytes());
        } catch (const Error& error) {
            EXPECT_STRNE(error.what(), "");
        }
        try {
            decode_brick(codec(), form, e.bricks->index().setting, std::span(whole).first(i), out.bytes());
        } catch (const Error& error) {
            EXPECT_STRNE(error.what(), "");
        }
    }
}

TEST_P(BrickFile, AFailedWriteLeavesTheOldFile) {
    const Encoded e = encoded(*scene({9, 9, 9}), codec(), fast());
    write_file(*e.bricks, path());
    const Bytes before = bytes_of_file(path());
    std::stop_source stop;
    stop.request_stop();
    EXPECT_THROW(write_file(*encoded(*scene({10, 9, 9}), codec(), fast()).bricks, path(), stop.get_token()), Cancelled);
    EXPECT_EQ(bytes_of_file(path()), before);
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_.path()), {}), 1);
}

TEST(BrickFiles, WhatIsNoBrickFileIsSaid) {
    const voxloom::testing::TempFolder folder;
    EXPECT_THROW(open_file(folder.path() / "missing.vxb"), Error);
    EXPECT_THROW(open_file(folder.path()), Error);
    std::ofstream(folder.path() / "empty.vxb");
    EXPECT_THROW(open_file(folder.path() / "empty.vxb"), Error);
    EXPECT_EQ(provenance_of(folder.path() / "empty.vxb"), std::nullopt);
}

TEST(BrickFiles, ACodecThatIsNotBuiltIsNamed) {
    static const Codec other = [] {
        Codec codec = raw_codec();
        codec.name = "squeezer";
        return codec;
    }();
    const Encoded e = encoded(*scene({4, 4, 4}), other, fast());
    try {
        open_bytes(file_of(*e.bricks), nullptr, "a.vxb");
        ADD_FAILURE();
    } catch (const Error& error) {
        EXPECT_THAT(error.what(), HasSubstr("squeezer"));
    }
}

// Files of every version stay readable, whatever the library that decodes them. Set VOXLOOM_WRITE_GOLDEN to write
// those of a new version.
TEST_P(BrickFile, GoldenFilesStayReadable) {
    for (const ScalarType type : {ScalarType::u8, ScalarType::i16, ScalarType::f32}) {
        const VolumePtr volume = volume_of({11, 9, 6}, type, 1, [](Index3 i, int) {
            return double((i.x * i.x + 3 * i.y + i.x * i.z) % 97 + (i.x > 5 ? 20 : 0));
        });
        if (!holds(codec(), volume->desc())) continue;
        const std::filesystem::path golden = std::filesystem::path(VOXLOOM_SOURCE_DIR) / "plugins/codec-baseline/golden" /
                                             fmt::format("v1-{}-{}.vxb", codec().name, voxloom::name_of(type));
        if (std::getenv("VOXLOOM_WRITE_GOLDEN")) write_file(*encoded(*volume, codec(), fast()).bricks, golden);
        EXPECT_EQ(decoded(open_file(golden)), bytes_of_volume(*volume)) << golden;
    }
}

}  // namespace
}  // namespace voxloom::baseline
