#include "core/base/error.h"
#include "plugins/writers/image_codec.h"

#ifdef VOXLOOM_WITH_EXR

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfOutputFile.h>

#include <vector>

namespace voxloom {

namespace {

class MemoryStream final : public Imf::OStream {
  public:
    MemoryStream() : Imf::OStream("picture") {}
    void write(const char data[], int n) override {
        if (position_ + std::size_t(n) > bytes.size()) bytes.resize(position_ + std::size_t(n));
        bytes.replace(position_, std::size_t(n), data, std::size_t(n));
        position_ += std::size_t(n);
    }
    std::uint64_t tellp() override { return position_; }
    void seekp(std::uint64_t position) override { position_ = position; }

    std::string bytes;

  private:
    std::size_t position_ = 0;
};

}  // namespace

bool has_exr() {
    return true;
}

std::string exr_bytes(const Image& image, int bits) {
    const glm::ivec2 size = image.size();
    if (size.x < 1 || size.y < 1)
        fail("a picture of {} x {} pixels cannot be an EXR", size.x, size.y);
    // Channels as planes: EXR stores them so.
    const std::size_t pixels = std::size_t(size.x) * std::size_t(size.y);
    const bool depth = image.depth.size() == pixels;
    constexpr const char* names[] = {"R", "G", "B", "A", "Z"};
    const std::size_t channels = depth ? 5 : 4, bytes = bits == 16 ? 2 : 4;
    std::vector<char> planes(channels * pixels * bytes);
    auto put = [&](std::size_t channel, std::size_t pixel, float v) {
        char* at = planes.data() + (channel * pixels + pixel) * bytes;
        if (bits == 16)
            new (at) Imath::half(v);
        else
            new (at) float(v);
    };
    for (int y = 0; y < size.y; ++y)
        for (int x = 0; x < size.x; ++x) {
            const std::size_t i = std::size_t(y) * std::size_t(size.x) + std::size_t(x);
            const glm::vec4 c = image.at(x, y);
            for (int k = 0; k < 4; ++k) put(std::size_t(k), i, c[k]);
            if (depth) put(4, i, image.depth[i]);
        }

    const Imf::PixelType type = bits == 16 ? Imf::HALF : Imf::FLOAT;
    Imf::Header header(size.x, size.y);
    header.compression() = Imf::ZIP_COMPRESSION;
    Imf::FrameBuffer frame;
    for (std::size_t k = 0; k < channels; ++k) {
        header.channels().insert(names[k], Imf::Channel(type));
        frame.insert(names[k], Imf::Slice(type, planes.data() + k * pixels * bytes, bytes,
                                          bytes * std::size_t(size.x)));
    }
    MemoryStream stream;
    try {
        Imf::OutputFile file(stream, header, 0);  // no threads of its own
        file.setFrameBuffer(frame);
        file.writePixels(size.y);
    } catch (const std::exception& e) {
        fail("OpenEXR: {}", e.what());
    }
    return std::move(stream.bytes);
}

}  // namespace voxloom

#else

namespace voxloom {

bool has_exr() {
    return false;
}

std::string exr_bytes(const Image&, int) {
    fail("this build has no OpenEXR; install libopenexr-dev and build again, or write .png");
}

}  // namespace voxloom

#endif
