// zfp: blocks of 4^3, block floating point, a decorrelating transform, bit planes.
//
// Each component is an array of its own. Axes of length 1 are left out, since zfp fills blocks up to 4. Integers
// become int32 or, from 25 bits, int64, centred around 0 and, where zfp cuts bit planes off from the top, shifted up to
// 30 or 62 bits as zfp's own promotion does; its accuracy mode takes floating point alone, so there they become float
// or double, exactly.
#include <zfp.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>

#include "plugins/codec-baseline/codec.h"

namespace voxloom::baseline {

namespace {

enum Mode : std::uint8_t { kReversible, kAccuracy, kRate, kPrecision };

// The array that zfp sees.
struct Array {
    zfp_type type;
    int shift = 0;           // of integers that are integers to zfp
    std::int64_t centre = 0; // that becomes 0
};

Array array_of(const Form& form, Mode mode) {
    if (form.type == ScalarType::f32) return {zfp_type_float};
    if (form.type == ScalarType::f64) return {zfp_type_double};
    const int bits = form.bits();
    if (mode == kAccuracy) return {bits <= 24 ? zfp_type_float : zfp_type_double};
    const bool narrow = bits <= 24;
    const int shift = mode == kReversible ? 0 : (narrow ? 31 : 63) - bits;
    return {narrow ? zfp_type_int32 : zfp_type_int64, shift, form.low() + (std::int64_t(1) << (bits - 1))};
}

struct Closer {
    void operator()(zfp_field* field) const { zfp_field_free(field); }
    void operator()(zfp_stream* stream) const { zfp_stream_close(stream); }
    void operator()(bitstream* bits) const { stream_close(bits); }
};
using Field = std::unique_ptr<zfp_field, Closer>;
using Stream = std::unique_ptr<zfp_stream, Closer>;
using Bits = std::unique_ptr<bitstream, Closer>;

struct Shape {
    std::array<std::size_t, 3> n{};
    int axes = 0;
};
Shape shape_of(const Form& form) {
    Shape shape;
    for (int a = 0; a < 3; ++a)
        if (form.dims[a] > 1) shape.n[std::size_t(shape.axes++)] = std::size_t(form.dims[a]);
    if (shape.axes == 0) shape.n[std::size_t(shape.axes++)] = 1;
    return shape;
}
Field field_of(const Form& form, zfp_type type, void* data) {
    const auto [n, axes] = shape_of(form);
    return Field(axes == 1   ? zfp_field_1d(data, type, n[0])
                 : axes == 2 ? zfp_field_2d(data, type, n[0], n[1])
                             : zfp_field_3d(data, type, n[0], n[1], n[2]));
}
Stream stream_of(const Form& form, const Setting& setting, zfp_type type) {
    // Of forged files too: what zfp would make of other numbers is not defined.
    const double most = setting.mode == kRate ? 128 : setting.mode == kPrecision ? 64 : std::numeric_limits<double>::max();
    if (setting.mode != kReversible && !(setting.amount > 0 && setting.amount <= most)) fail("its zfp setting is out of range");
    Stream stream(zfp_stream_open(nullptr));
    switch (setting.mode) {
        case kReversible: zfp_stream_set_reversible(stream.get()); break;
        case kAccuracy: zfp_stream_set_accuracy(stream.get(), setting.amount); break;
        case kRate: zfp_stream_set_rate(stream.get(), setting.amount, type, unsigned(shape_of(form).axes), zfp_false); break;
        case kPrecision: zfp_stream_set_precision(stream.get(), unsigned(setting.amount)); break;
        default: fail("its zfp mode {} is not known", setting.mode);
    }
    return stream;
}

// Calls f(T{}) with the type that zfp's arrays have.
template <class F>
void with_array_type(zfp_type type, F&& f) {
    switch (type) {
        case zfp_type_int32: return f(std::int32_t{});
        case zfp_type_int64: return f(std::int64_t{});
        case zfp_type_float: return f(float{});
        default: return f(double{});
    }
}

// One value to zfp's array and back. What lies outside of the range that the volume is said to have is cut off, so that
// no integer overflows; the encoder sees the difference.
template <class T, class V>
T to_array(const Form& form, const Array& array, V value) {
    if constexpr (std::is_floating_point_v<T> || std::is_floating_point_v<V>) {
        return T(value);
    } else {
        const std::int64_t v = std::clamp(std::int64_t(value), form.low(), std::int64_t(form.range.max));
        return T((v - array.centre) * (std::int64_t(1) << array.shift));
    }
}
template <class V, class T>
V from_array(const Form& form, const Array& array, T value) {
    if constexpr (std::is_floating_point_v<V>) {
        return V(value);
    } else if constexpr (std::is_floating_point_v<T>) {
        const double v = std::nearbyint(double(value));
        return V(std::isnan(v) ? form.range.min : std::clamp(v, form.range.min, form.range.max));
    } else {
        std::int64_t v = value;
        if (array.shift > 0) v = ((v >> (array.shift - 1)) + 1) >> 1;  // rounded
        return V(std::clamp(v, form.low() - array.centre, std::int64_t(form.range.max) - array.centre) + array.centre);
    }
}

Bytes encode(const Form& form, const Setting& setting, std::span<const std::byte> voxels) {
    const Array array = array_of(form, Mode(setting.mode));
    const std::size_t components = std::size_t(form.components), count = form.values() / components;
    Bytes bytes;
    ByteWriter writer(bytes);
    with_array_type(array.type, [&](auto t) {
        using T = decltype(t);
        std::vector<T> plane(count);
        for (std::size_t c = 0; c < components; ++c) {
            with_type(form.type, [&](auto u) {
                const auto* values = reinterpret_cast<const decltype(u)*>(voxels.data()) + c;
                for (std::size_t i = 0; i < count; ++i) plane[i] = to_array<T>(form, array, values[i * components]);
            });
            const Field field = field_of(form, array.type, plane.data());
            const Stream stream = stream_of(form, setting, array.type);
            Bytes part(zfp_stream_maximum_size(stream.get(), field.get()));
            const Bits bits(stream_open(part.data(), part.size()));
            zfp_stream_set_bit_stream(stream.get(), bits.get());
            zfp_stream_rewind(stream.get());
            const std::size_t size = zfp_compress(stream.get(), field.get());
            if (size == 0) fail("zfp could not compress a brick");
            writer.block(std::span(part).first(size));
        }
    });
    return bytes;
}

void decode(const Form& form, const Setting& setting, std::span<const std::byte> bytes, std::span<std::byte> voxels) {
    const Array array = array_of(form, Mode(setting.mode));
    const std::size_t components = std::size_t(form.components), count = form.values() / components;
    ByteReader reader(bytes);
    with_array_type(array.type, [&](auto t) {
        using T = decltype(t);
        std::vector<T> plane(count);
        for (std::size_t c = 0; c < components; ++c) {
            const Field field = field_of(form, array.type, plane.data());
            const Stream stream = stream_of(form, setting, array.type);
            // zfp reads on beyond the end of damaged bytes, at most to what the longest stream would have.
            const auto part = reader.block();
            Bytes padded(std::max(part.size(), zfp_stream_maximum_size(stream.get(), field.get())) + 8);
            std::ranges::copy(part, padded.begin());
            const Bits bits(stream_open(padded.data(), padded.size()));
            zfp_stream_set_bit_stream(stream.get(), bits.get());
            zfp_stream_rewind(stream.get());
            if (zfp_decompress(stream.get(), field.get()) == 0) fail("zfp could not decompress it");
            with_type(form.type, [&](auto u) {
                auto* values = reinterpret_cast<decltype(u)*>(voxels.data()) + c;
                for (std::size_t i = 0; i < count; ++i) values[i * components] = from_array<decltype(u)>(form, array, plane[i]);
            });
        }
    });
    if (reader.left() > 0) fail("it is longer than it should be");
}

Setting direct(const Form& form, Target target, double amount) {
    if (target == Target::precision) return {kPrecision, std::round(amount), {}};
    if (target != Target::max_error) return {};
    if (is_float(form.type)) return {kAccuracy, amount, {}};
    // Nearly half a unit is rounded away again.
    return amount < 1 ? Setting{} : Setting{kAccuracy, std::floor(amount) + 0.49, {}};
}

Scale scale(const Form& form, Target target) {
    if (target == Target::psnr) {
        // Only powers of two make a difference to the accuracy mode.
        const int coarsest = form.range.extent() > 0 ? std::ilogb(form.range.extent()) + 1 : 0;
        const int count = form.type == ScalarType::f32 ? 30 : form.type == ScalarType::f64 ? 60 : form.bits() + 2;
        return {count, [coarsest](int i) { return Setting{kAccuracy, std::ldexp(1.0, coarsest - i), {}}; }};
    }
    const int most = form.type == ScalarType::f64 ? 72 : is_float(form.type) ? 40 : form.bits() + 8;
    return {most * 32, [](int i) { return Setting{kRate, (i + 1) / 32.0, {}}; }};
}

}  // namespace

const Codec& zfp_codec() {
    static const Codec codec = {
        .name = "zfp",
        .title = "zfp",
        .library = "zfp " ZFP_VERSION_STRING,
        .doc = "Compresses bricks with zfp: at a fixed rate, to a precision, within an error, or without loss.",
        .method = "Blocks of 4^3 voxels share an exponent, are decorrelated by a transform near the cosine transform, and "
                  "are coded by bit planes. `max-error` and `psnr` use its accuracy mode, whose tolerance moves in powers "
                  "of two, so `psnr` is often a few dB above what was asked for; `bpv` and `ratio` use its fixed rate, the "
                  "same for every block; `precision` keeps so many bit planes; `lossless` is its reversible mode. "
                  "Integers are promoted to 32 or 64 bits, and to floating point for the accuracy mode.",
        .reference = "Lindstrom, Fixed-Rate Compressed Floating-Point Arrays, IEEE TVCG 20(12), 2014.",
        .keywords = {"fixed rate", "floating point", "error bound"},
        .targets = {Target::lossless, Target::psnr, Target::max_error, Target::bpv, Target::ratio, Target::precision},
        .params = {},
        .options = [](const Params&) { return Setting::Options{}; },
        .problem = [](const VolumeDesc&) { return std::string(); },
        .direct = direct,
        .scale = scale,
        .encode = encode,
        .decode = decode,
    };
    return codec;
}

}  // namespace voxloom::baseline
