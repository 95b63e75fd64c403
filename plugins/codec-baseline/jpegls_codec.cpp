// JPEG-LS by CharLS: a brick's slices, one below the other, are one picture of grey values.
#include <charls/charls.h>

#include <algorithm>
#include <cmath>

#include "plugins/codec-baseline/samples.h"

namespace voxloom::baseline {

namespace {

charls::frame_info frame_of(const Form& form) {
    const auto width = std::uint32_t(form.dims.x);
    return {width, std::uint32_t(form.values() / width), std::max(2, form.bits()), 1};
}

// The largest error that a sample may have; the standard allows no more.
int most_error(const Form& form) { return std::min(255, ((1 << std::max(2, form.bits())) - 1) / 2); }

// CharLS takes bytes for up to 8 bits.
Bytes packed(const Form& form, std::span<const std::uint16_t> samples) {
    if (form.bits() > 8) {
        const auto bytes = std::as_bytes(samples);
        return {bytes.begin(), bytes.end()};
    }
    Bytes bytes(samples.size());
    std::ranges::transform(samples, bytes.begin(), [](std::uint16_t v) { return std::byte(v); });
    return bytes;
}

Bytes encode(const Form& form, const Setting& setting, std::span<const std::byte> voxels) {
    const Bytes samples = packed(form, samples_of(form, voxels));
    try {
        charls::jpegls_encoder encoder;
        encoder.frame_info(frame_of(form)).near_lossless(setting.mode ? int(setting.amount) : 0);
        Bytes bytes(encoder.estimated_destination_size() + samples.size());  // noise may grow
        encoder.destination(bytes);
        bytes.resize(encoder.encode(samples));
        return bytes;
    } catch (const charls::jpegls_error& e) {
        fail("CharLS could not compress a brick: {}", e.what());
    }
}

void decode(const Form& form, const Setting&, std::span<const std::byte> bytes, std::span<std::byte> voxels) {
    if (form.bits() > kSampleBits) fail("it has more than {} bits", kSampleBits);
    const charls::frame_info wanted = frame_of(form);
    std::vector<std::uint16_t> samples(form.values());
    try {
        charls::jpegls_decoder decoder;
        decoder.source(bytes.data(), bytes.size());
        decoder.read_header();
        const charls::frame_info frame = decoder.frame_info();
        if (frame.width != wanted.width || frame.height != wanted.height || frame.bits_per_sample != wanted.bits_per_sample ||
            frame.component_count != 1)
            fail("its picture is not that of such a brick");
        if (form.bits() > 8) {
            decoder.decode(samples.data(), samples.size() * sizeof samples[0]);
        } else {
            Bytes narrow(samples.size());
            decoder.decode(narrow);
            std::ranges::transform(narrow, samples.begin(), [](std::byte v) { return std::uint16_t(v); });
        }
    } catch (const charls::jpegls_error& e) {
        fail("CharLS could not decompress it: {}", e.what());
    }
    voxels_of(form, samples, voxels);
}

Setting direct(const Form& form, Target target, double amount) {
    if (target != Target::max_error || amount < 1) return {};
    return {1, std::min(std::floor(amount), double(most_error(form))), {}};
}

Scale scale(const Form& form, Target) {
    const int most = most_error(form);
    return {most, [most](int i) { return Setting{1, double(most - i), {}}; }};
}

}  // namespace

const Codec& jpegls_codec() {
    static const Codec codec = {
        .name = "jpegls",
        .title = "JPEG-LS",
        .library = std::string("CharLS ") + charls_get_version_string(),
        .doc = "Compresses the slices of bricks with JPEG-LS, without loss or within an error.",
        .method = "Each sample is predicted from its neighbours in the slice, and what is left is coded by adaptive Golomb "
                  "codes and run lengths. A brick's slices, one below the other, are one picture; bricks one slice thick "
                  "([512, 512, 1]) are compressed best, cubes are fetched faster. `max-error` bounds every voxel (up to "
                  "255); `psnr`, `bpv` and `ratio` search for that bound. Only for integers that span up to 16 bits.",
        .reference = "Weinberger, Seroussi, Sapiro, The LOCO-I lossless image compression algorithm, IEEE TIP 9(8), 2000.",
        .keywords = {"CharLS", "LOCO-I", "near-lossless", "image"},
        .targets = {Target::lossless, Target::psnr, Target::max_error, Target::bpv, Target::ratio},
        .params = {},
        .options = [](const Params&) { return Setting::Options{}; },
        .problem = problem_with_samples,
        .direct = direct,
        .scale = scale,
        .encode = encode,
        .decode = decode,
    };
    return codec;
}

}  // namespace voxloom::baseline
