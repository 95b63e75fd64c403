// JPEG XL by libjxl: a brick's slices, one below the other, are one picture of grey values.
#include <jxl/decode_cxx.h>
#include <jxl/encode_cxx.h>

#include <algorithm>
#include <cmath>

#include "plugins/codec-baseline/samples.h"

namespace voxloom::baseline {

namespace {

// Of any bits, between 0 and 1: exact for up to 16.
constexpr JxlPixelFormat kFormat = {1, JXL_TYPE_FLOAT, JXL_NATIVE_ENDIAN, 0};

float most_of(const Form& form) { return float((1 << form.bits()) - 1); }
std::uint32_t height_of(const Form& form) { return std::uint32_t(form.values() / std::size_t(form.dims.x)); }

Bytes encode(const Form& form, const Setting& setting, std::span<const std::byte> voxels) {
    const std::vector<std::uint16_t> samples = samples_of(form, voxels);
    std::vector<float> grey(samples.size());
    const float most = most_of(form);
    std::ranges::transform(samples, grey.begin(), [most](std::uint16_t v) { return float(v) / most; });

    const auto done = [](JxlEncoderStatus status) {
        if (status != JXL_ENC_SUCCESS) fail("libjxl could not compress a brick");
    };
    const JxlEncoderPtr encoder = JxlEncoderMake(nullptr);
    JxlBasicInfo info;
    JxlEncoderInitBasicInfo(&info);
    info.xsize = std::uint32_t(form.dims.x);
    info.ysize = height_of(form);
    info.bits_per_sample = std::uint32_t(form.bits());
    info.num_color_channels = 1;
    info.uses_original_profile = setting.mode == 0;
    done(JxlEncoderSetBasicInfo(encoder.get(), &info));
    JxlColorEncoding color;
    JxlColorEncodingSetToSRGB(&color, JXL_TRUE);
    done(JxlEncoderSetColorEncoding(encoder.get(), &color));
    JxlEncoderFrameSettings* frame = JxlEncoderFrameSettingsCreate(encoder.get(), nullptr);
    done(JxlEncoderFrameSettingsSetOption(frame, JXL_ENC_FRAME_SETTING_EFFORT, setting.options.effort));
    done(setting.mode == 0 ? JxlEncoderSetFrameLossless(frame, JXL_TRUE)
                           : JxlEncoderSetFrameDistance(frame, float(setting.amount)));
    done(JxlEncoderAddImageFrame(frame, &kFormat, grey.data(), grey.size() * sizeof(float)));
    JxlEncoderCloseInput(encoder.get());

    Bytes bytes(4096);
    std::size_t used = 0;
    for (;;) {
        auto* next = reinterpret_cast<std::uint8_t*>(bytes.data() + used);
        std::size_t left = bytes.size() - used;
        const JxlEncoderStatus status = JxlEncoderProcessOutput(encoder.get(), &next, &left);
        used = bytes.size() - left;
        if (status == JXL_ENC_SUCCESS) break;
        if (status != JXL_ENC_NEED_MORE_OUTPUT) fail("libjxl could not compress a brick");
        bytes.resize(2 * bytes.size());
    }
    bytes.resize(used);
    return bytes;
}

// Takes the decoder up to the next event, which must be `wanted`.
void expect(JxlDecoder* decoder, JxlDecoderStatus wanted) {
    if (JxlDecoderProcessInput(decoder) != wanted) fail("libjxl could not decompress it");
}

void decode(const Form& form, const Setting&, std::span<const std::byte> bytes, std::span<std::byte> voxels) {
    if (form.bits() > kSampleBits) fail("it has more than {} bits", kSampleBits);
    const JxlDecoderPtr decoder = JxlDecoderMake(nullptr);
    if (JxlDecoderSubscribeEvents(decoder.get(), JXL_DEC_BASIC_INFO | JXL_DEC_FULL_IMAGE) != JXL_DEC_SUCCESS ||
        JxlDecoderSetInput(decoder.get(), reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()) != JXL_DEC_SUCCESS)
        fail("libjxl could not begin");
    JxlDecoderCloseInput(decoder.get());
    expect(decoder.get(), JXL_DEC_BASIC_INFO);
    JxlBasicInfo info;
    if (JxlDecoderGetBasicInfo(decoder.get(), &info) != JXL_DEC_SUCCESS || info.xsize != form.dims.x ||
        info.ysize != height_of(form) || info.num_color_channels != 1 || info.bits_per_sample != std::uint32_t(form.bits()))
        fail("its picture is not that of such a brick");
    expect(decoder.get(), JXL_DEC_NEED_IMAGE_OUT_BUFFER);
    std::vector<float> grey(form.values());
    if (JxlDecoderSetImageOutBuffer(decoder.get(), &kFormat, grey.data(), grey.size() * sizeof(float)) != JXL_DEC_SUCCESS)
        fail("libjxl could not decompress it");
    expect(decoder.get(), JXL_DEC_FULL_IMAGE);
    const float most = most_of(form);
    std::vector<std::uint16_t> samples(grey.size());
    std::ranges::transform(grey, samples.begin(), [most](float v) {
        return std::uint16_t(v > 0 ? std::min(v, 1.0F) * most + 0.5F : 0.0F);  // NaN is not above 0
    });
    voxels_of(form, samples, voxels);
}

Setting direct(const Form&, Target target, double amount) {
    return target == Target::distance && amount > 0 ? Setting{1, amount, {}} : Setting{};
}

// Distances from 25 down to 0.01, sixteen an octave.
Scale scale(const Form&, Target) {
    return {181, [](int i) { return Setting{1, 25 * std::exp2(-i / 16.0), {}}; }};
}

std::string library() {
    const std::uint32_t version = JxlEncoderVersion();
    return fmt::format("libjxl {}.{}.{}", version / 1000000, version / 1000 % 1000, version % 1000);
}

}  // namespace

const Codec& jpegxl_codec() {
    static const Codec codec = {
        .name = "jpegxl",
        .title = "JPEG XL",
        .library = library(),
        .doc = "Compresses the slices of bricks with JPEG XL, without loss or to a visual distance, an error or a rate.",
        .method = "A brick's slices, one below the other, are one picture of grey values. Without loss it is coded by the "
                  "modular mode, with a decision tree that is learned for each brick; with loss by the cosine transform of "
                  "varying size, quantised for the eye, so that `psnr`, for which a search finds the distance, is not what "
                  "it was made for. Bricks one slice thick ([512, 512, 1]) are compressed best, cubes are fetched faster. "
                  "Only for integers that span up to 16 bits.",
        .reference = "Alakuijala et al., JPEG XL next-generation image compression architecture and coding tools, 2019.",
        .keywords = {"libjxl", "image"},
        .targets = {Target::lossless, Target::psnr, Target::bpv, Target::ratio, Target::distance},
        .params = {param::integer("effort", 7, "How hard the encoder tries, from 1 to 9.").range(1, 9).slider(1, 9)},
        .options = [](const Params& params) { return Setting::Options{int(params.integer("effort")), 0, 0}; },
        .problem = problem_with_samples,
        .direct = direct,
        .scale = scale,
        .encode = encode,
        .decode = decode,
    };
    return codec;
}

}  // namespace voxloom::baseline
