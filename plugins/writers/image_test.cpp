#include <gtest/gtest.h>
#include <png.h>

#ifdef VOXLOOM_WITH_EXR
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#endif

#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>

#include "plugins/writers/image_codec.h"
#include "plugins/writers/writers.h"
#include "tests/support/run_node.h"
#include "tests/support/volumes.h"

namespace voxloom {
namespace {

using testing::TempFolder;

// Reads any PNG of ours back through libpng: straight RGBA, 16 bits a channel as stored.
struct Png {
    int width = 0, height = 0, bits = 0, channels = 0;
    std::vector<unsigned> samples;
    unsigned at(int x, int y, int c) const {
        return samples[std::size_t((y * width + x) * channels + c)];
    }
};
Png read_png(const std::string& bytes) {
    struct Source {
        const std::string& bytes;
        std::size_t at = 0;
    } source{bytes};
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
    png_infop info = png_create_info_struct(png);
    png_set_read_fn(png, &source, [](png_structp p, png_bytep out, png_size_t n) {
        auto* s = static_cast<Source*>(png_get_io_ptr(p));
        if (s->at + n > s->bytes.size()) png_error(p, "short");
        std::memcpy(out, s->bytes.data() + s->at, n);
        s->at += n;
    });
    png_read_info(png, info);
    Png image;
    image.width = int(png_get_image_width(png, info));
    image.height = int(png_get_image_height(png, info));
    image.bits = png_get_bit_depth(png, info);
    image.channels = png_get_channels(png, info);
    std::vector<png_byte> row(png_get_rowbytes(png, info));
    for (int y = 0; y < image.height; ++y) {
        png_read_row(png, row.data(), nullptr);
        for (std::size_t i = 0; i < row.size(); i += std::size_t(image.bits / 8))
            image.samples.push_back(image.bits == 8 ? row[i] : unsigned(row[i]) << 8 | row[i + 1]);
    }
    png_read_end(png, nullptr);
    png_destroy_read_struct(&png, &info, nullptr);
    return image;
}

std::shared_ptr<Image> gradient(glm::ivec2 size) {
    auto image = std::make_shared<Image>(size, Image::Format::rgba32f);
    for (int y = 0; y < size.y; ++y)
        for (int x = 0; x < size.x; ++x) {
            float a = float(x + 1) / float(size.x);
            image->rgba32f()[std::size_t(y * size.x + x)] = {a * 0.25f,
                                                             a * float(y) / float(size.y), a, a};
        }
    return image;
}

TEST(Png, StoresStraightAlphaRoundedToTheNearest) {
    auto image = gradient({5, 4});
    for (int bits : {8, 16}) {
        Png png = read_png(png_bytes(*image, {bits, false, {}}));
        EXPECT_EQ(png.bits, bits);
        EXPECT_EQ(png.channels, 4);
        ASSERT_EQ(glm::ivec2(png.width, png.height), glm::ivec2(5, 4));
        const double white = bits == 8 ? 255 : 65535;
        for (int y = 0; y < 4; ++y)
            for (int x = 0; x < 5; ++x) {
                EXPECT_NEAR(png.at(x, y, 0), 0.25 * white, 0.51) << x << y;
                EXPECT_NEAR(png.at(x, y, 1), y / 4.0 * white, 0.51);
                EXPECT_EQ(png.at(x, y, 2), unsigned(white));
                EXPECT_NEAR(png.at(x, y, 3), (x + 1) / 5.0 * white, 0.51);
            }
    }
}

TEST(Png, FlatteningLaysThePictureOverTheBackground) {
    auto image = gradient({5, 4});
    Png png = read_png(png_bytes(*image, {8, true, {1, 0.5, 0}}));
    EXPECT_EQ(png.channels, 3);
    for (int x = 0; x < 5; ++x) {
        const double a = (x + 1) / 5.0;
        EXPECT_NEAR(png.at(x, 0, 0), (a * 0.25 + (1 - a)) * 255, 0.51);
        EXPECT_NEAR(png.at(x, 0, 1), (1 - a) * 0.5 * 255, 0.51);
    }
}

TEST(Png, ClampsWhatIsOutsideAndTurnsNaNToZero) {
    constexpr float nan = std::numeric_limits<float>::quiet_NaN(),
                    inf = std::numeric_limits<float>::infinity();
    Image image({4, 1}, Image::Format::rgba32f);
    image.rgba32f()[0] = {2, -1, nan, 1};
    image.rgba32f()[1] = {1, 1, 1, nan};
    image.rgba32f()[2] = {inf, 0, 0, 1};
    image.rgba32f()[3] = {0.5, 0.5, 0.5,
                          0};  // light without cover cannot be said in straight alpha
    Png png = read_png(png_bytes(image));
    EXPECT_EQ(png.samples,
              (std::vector<unsigned>{255, 0, 0, 255, 0, 0, 0, 0, 255, 0, 0, 255, 0, 0, 0, 0}));
}

TEST(Png, OpaqueBytesPassUnchanged) {
    Image image({256, 1}, Image::Format::rgba8);
    for (int i = 0; i < 256; ++i)
        image.rgba8()[std::size_t(i)] = glm::u8vec4(i, 255 - i, i / 2, 255);
    Png png = read_png(png_bytes(image));
    for (int i = 0; i < 256; ++i) {
        ASSERT_EQ(png.at(i, 0, 0), unsigned(i));
        ASSERT_EQ(png.at(i, 0, 1), unsigned(255 - i));
        ASSERT_EQ(png.at(i, 0, 2), unsigned(i / 2));
    }
}

TEST(Png, TheSamePictureGivesTheSameBytes) {
    EXPECT_EQ(png_bytes(*gradient({64, 48})), png_bytes(*gradient({64, 48})));
    EXPECT_THROW(png_bytes(*gradient({0, 5})), Error);
}

#ifdef VOXLOOM_WITH_EXR
TEST(Exr, KeepsPremultipliedFloatsAndDepthExactly) {
    TempFolder folder;
    auto image = gradient({7, 5});
    image->rgba32f()[3] = {-1.5f, 1e20f, 3e-39f, std::numeric_limits<float>::infinity()};
    image->depth.resize(35);
    for (std::size_t i = 0; i < 35; ++i) image->depth[i] = float(i) * 0.1f;
    const std::string file = (folder.path() / "a.exr").string();
    const std::string bytes = exr_bytes(*image);
    EXPECT_EQ(bytes, exr_bytes(*image));
    std::ofstream(file, std::ios::binary) << bytes;

    Imf::InputFile exr(file.c_str());
    Imf::FrameBuffer frame;
    std::vector<float> planes(5 * 35);
    const char* names[] = {"R", "G", "B", "A", "Z"};
    for (std::size_t k = 0; k < 5; ++k) {
        ASSERT_NE(exr.header().channels().findChannel(names[k]), nullptr);
        frame.insert(names[k], Imf::Slice(Imf::FLOAT,
                                          reinterpret_cast<char*>(planes.data() + 35 * k), 4, 28));
    }
    exr.setFrameBuffer(frame);
    exr.readPixels(0, 4);
    for (std::size_t i = 0; i < 35; ++i) {
        for (int k = 0; k < 4; ++k)
            EXPECT_EQ(planes[35 * std::size_t(k) + i], image->rgba32f()[i][k]);
        EXPECT_EQ(planes[35 * 4 + i], image->depth[i]);
    }
    EXPECT_LT(exr_bytes(*gradient({64, 64}), 16).size(), exr_bytes(*gradient({64, 64}), 32).size());
    EXPECT_THROW(exr_bytes(*gradient({3, 0})), Error);
}
#endif

TEST(WriteImage, TakesTheFormatFromTheExtensionAndRefusesWhatItLacks) {
    Registry registry;
    add_image_writer(registry);
    TempFolder folder;
    testing::RunNodeOptions options;
    options.output_folder = folder.path();
    auto write = [&](const std::string& params) {
        testing::run_node(registry, "writers.image", params,
                          {{"image", {ImagePtr(gradient({4, 4}))}}}, options);
    };
    write("{path: A.PNG, bits: '16', alpha: flatten, background: [1, 1, 1]}");
    std::ifstream in(folder.path() / "A.PNG", std::ios::binary);
    Png png = read_png({std::istreambuf_iterator<char>(in), {}});
    EXPECT_EQ(png.bits, 16);
    EXPECT_EQ(png.channels, 3);
    if (has_exr()) {
        write("{path: b.exr}");
        EXPECT_TRUE(std::filesystem::exists(folder.path() / "b.exr"));
        EXPECT_THROW(write("{path: b.exr, bits: '8'}"), Error);
        EXPECT_THROW(write("{path: b.exr, alpha: flatten}"), Error);
    } else {
        EXPECT_THROW(write("{path: b.exr}"), Error);
    }
    EXPECT_THROW(write("{path: c.gif}"), Error);
    EXPECT_THROW(write("{path: c.png, bits: '32'}"), Error);
}

}  // namespace
}  // namespace voxloom
