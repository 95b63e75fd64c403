// JPEG 2000 by OpenJPEG: a brick's slices are the components of one picture, which are transformed each by itself
// and given bits together.
#include <openjpeg.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <memory>

#include "plugins/codec-baseline/samples.h"

namespace voxloom::baseline {

namespace {

constexpr int kMostSlices = 16384;  // components of a picture

struct CodecCloser {
    void operator()(opj_codec_t* codec) const { opj_destroy_codec(codec); }
};
struct StreamCloser {
    void operator()(opj_stream_t* stream) const { opj_stream_destroy(stream); }
};
struct ImageCloser {
    void operator()(opj_image_t* image) const { opj_image_destroy(image); }
};
using CodecOwner = std::unique_ptr<opj_codec_t, CodecCloser>;
using StreamOwner = std::unique_ptr<opj_stream_t, StreamCloser>;
using ImageOwner = std::unique_ptr<opj_image_t, ImageCloser>;

// Memory as OpenJPEG's stream: it writes back and forth in `out`, or reads `in`.
struct Memory {
    Bytes out;
    std::span<const std::byte> in;
    std::size_t at = 0;
};
OPJ_SIZE_T write_some(void* from, OPJ_SIZE_T size, void* user) {
    auto& memory = *static_cast<Memory*>(user);
    memory.out.resize(std::max(memory.out.size(), memory.at + size));
    std::memcpy(memory.out.data() + memory.at, from, size);
    memory.at += size;
    return size;
}
OPJ_SIZE_T read_some(void* to, OPJ_SIZE_T size, void* user) {
    auto& memory = *static_cast<Memory*>(user);
    const std::size_t n = std::min<std::size_t>(size, memory.in.size() - memory.at);
    if (n == 0) return OPJ_SIZE_T(-1);  // its sign of the end
    std::memcpy(to, memory.in.data() + memory.at, n);
    memory.at += n;
    return n;
}
OPJ_BOOL seek(OPJ_OFF_T to, void* user) {
    auto& memory = *static_cast<Memory*>(user);
    const std::size_t end = memory.in.data() ? memory.in.size() : std::numeric_limits<std::size_t>::max() / 2;
    if (to < 0 || std::size_t(to) > end) return OPJ_FALSE;
    memory.at = std::size_t(to);
    return OPJ_TRUE;
}
OPJ_OFF_T skip(OPJ_OFF_T by, void* user) {
    return seek(OPJ_OFF_T(static_cast<Memory*>(user)->at) + by, user) ? by : -1;
}
StreamOwner stream_of(Memory& memory, bool input) {
    StreamOwner stream(opj_stream_create(1 << 16, input ? OPJ_STREAM_READ : OPJ_STREAM_WRITE));
    if (!stream) fail("OpenJPEG has no memory");
    opj_stream_set_user_data(stream.get(), &memory, nullptr);
    opj_stream_set_user_data_length(stream.get(), memory.in.size());
    if (input)
        opj_stream_set_read_function(stream.get(), read_some);
    else
        opj_stream_set_write_function(stream.get(), write_some);
    opj_stream_set_skip_function(stream.get(), skip);
    opj_stream_set_seek_function(stream.get(), seek);
    return stream;
}

// The library's first complaint, for the sentence.
void listen(opj_codec_t* codec, std::string& complaint) {
    opj_set_error_handler(codec, [](const char* message, void* user) {
        auto& text = *static_cast<std::string*>(user);
        if (text.empty()) text = message;
        while (!text.empty() && (text.back() == '\n' || text.back() == '.')) text.pop_back();
    }, &complaint);
}

std::size_t slices_of(const Form& form) {
    const std::size_t slices = std::size_t(form.dims.z) * std::size_t(form.components);
    if (slices > kMostSlices) fail("a picture of JPEG 2000 has up to {} components, and a brick has {} slices; take thinner bricks",
                                   kMostSlices, slices);
    return slices;
}

Bytes encode(const Form& form, const Setting& setting, std::span<const std::byte> voxels) {
    const std::vector<std::uint16_t> samples = samples_of(form, voxels);
    const std::size_t slices = slices_of(form), each = samples.size() / slices;
    opj_image_cmptparm_t plane{};
    plane.dx = plane.dy = 1;
    plane.w = OPJ_UINT32(form.dims.x);
    plane.h = OPJ_UINT32(form.dims.y);
    plane.prec = OPJ_UINT32(form.bits());
    std::vector<opj_image_cmptparm_t> planes(slices, plane);
    const ImageOwner image(opj_image_create(OPJ_UINT32(slices), planes.data(), OPJ_CLRSPC_GRAY));
    if (!image) fail("OpenJPEG has no memory for a brick");
    image->x1 = plane.w;
    image->y1 = plane.h;
    for (std::size_t s = 0; s < slices; ++s) std::copy_n(samples.data() + s * each, each, image->comps[s].data);

    opj_cparameters_t parameters;
    opj_set_default_encoder_parameters(&parameters);
    parameters.tcp_numlayers = 1;
    parameters.numresolution = std::min(6, int(std::bit_width(std::min(plane.w, plane.h))));
    if (setting.mode == 0) {
        parameters.cp_disto_alloc = 1;
        parameters.tcp_rates[0] = 0;
    } else {
        parameters.irreversible = 1;
        parameters.cp_fixed_quality = 1;
        parameters.tcp_distoratio[0] = float(setting.amount);
    }
    std::string complaint;
    const CodecOwner codec(opj_create_compress(OPJ_CODEC_J2K));
    if (!codec) fail("OpenJPEG has no memory");
    listen(codec.get(), complaint);
    Memory memory;
    {
        const StreamOwner stream = stream_of(memory, false);
        if (!opj_setup_encoder(codec.get(), &parameters, image.get()) ||
            !opj_start_compress(codec.get(), image.get(), stream.get()) || !opj_encode(codec.get(), stream.get()) ||
            !opj_end_compress(codec.get(), stream.get()))
            fail("OpenJPEG could not compress a brick: {}", complaint);
    }
    return std::move(memory.out);
}

void decode(const Form& form, const Setting&, std::span<const std::byte> bytes, std::span<std::byte> voxels) {
    if (form.bits() > kSampleBits) fail("it has more than {} bits", kSampleBits);
    const std::size_t slices = slices_of(form), each = form.values() / slices;
    std::string complaint;
    const CodecOwner codec(opj_create_decompress(OPJ_CODEC_J2K));
    if (!codec) fail("OpenJPEG has no memory");
    listen(codec.get(), complaint);
    opj_dparameters_t parameters;
    opj_set_default_decoder_parameters(&parameters);
    Memory memory;
    memory.in = bytes;
    const StreamOwner stream = stream_of(memory, true);
    opj_image_t* header = nullptr;
    const bool read = opj_setup_decoder(codec.get(), &parameters) && opj_read_header(stream.get(), codec.get(), &header);
    const ImageOwner image(header);
    if (!read) fail("OpenJPEG could not read it: {}", complaint);
    // Checked before any memory is taken for samples.
    bool fits = image->numcomps == slices && image->x0 == 0 && image->y0 == 0;
    for (OPJ_UINT32 c = 0; fits && c < image->numcomps; ++c) {
        const opj_image_comp_t& plane = image->comps[c];
        fits = plane.w == form.dims.x && plane.h == form.dims.y && plane.prec == OPJ_UINT32(form.bits()) && !plane.sgnd &&
               plane.dx == 1 && plane.dy == 1;
    }
    if (!fits) fail("its picture is not that of such a brick");
    if (!opj_decode(codec.get(), stream.get(), image.get())) fail("OpenJPEG could not decompress it: {}", complaint);
    std::vector<std::uint16_t> samples(form.values());
    for (std::size_t s = 0; s < slices; ++s) {
        const opj_image_comp_t& plane = image->comps[s];
        if (!plane.data || std::size_t(plane.w) * plane.h != each) fail("OpenJPEG gave no samples");
        std::transform(plane.data, plane.data + each, samples.data() + s * each,
                       [](OPJ_INT32 v) { return std::uint16_t(std::clamp(v, 0, 65535)); });
    }
    voxels_of(form, samples, voxels);
}

Setting direct(const Form&, Target, double) { return {}; }

// One quality for all bricks, in decibels over the samples' bits.
Scale scale(const Form&, Target) {
    return {721, [](int i) { return Setting{1, 10 + i / 8.0, {}}; }};
}

}  // namespace

const Codec& jpeg2000_codec() {
    static const Codec codec = {
        .name = "jpeg2000",
        .title = "JPEG 2000",
        .library = std::string("OpenJPEG ") + opj_version(),
        .doc = "Compresses the slices of bricks with JPEG 2000, without loss or to an error or a rate.",
        .method = "A brick's slices are the components of one picture: each has a wavelet transform of its own (5/3 without "
                  "loss, 9/7 otherwise), and embedded block coding spends bits where they reduce the error most. Every "
                  "brick is coded to the same error, which a search finds for `psnr`, `bpv` and `ratio`. Bricks one slice "
                  "thick ([512, 512, 1]) are compressed best, cubes are fetched faster. Only for integers that span up to "
                  "16 bits.",
        .reference = "Taubman, High performance scalable image compression with EBCOT, IEEE TIP 9(7), 2000.",
        .keywords = {"OpenJPEG", "wavelet", "EBCOT", "image"},
        .targets = {Target::lossless, Target::psnr, Target::bpv, Target::ratio},
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
