// What every peer looks like: the voxels of one brick in, bytes out. A codec is a row of a table; how it is
// aimed at a target, and what becomes of bricks that it cannot hold, is the same for all (encoder.h).
#pragma once

#include <bit>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "core/base/byte_io.h"
#include "core/data/volume.h"
#include "core/graph/params.h"

namespace voxloom::baseline {

enum class Target : std::uint8_t { lossless, psnr, max_error, bpv, ratio, precision, distance };
std::string_view name_of(Target target);  // "max-error"

// How a codec is set. `mode` 0 gives every bit back; what else mode and amount mean is the codec's affair,
// and kept in files. The options speed up or slow down encoding; decoders do without.
struct Setting {
    std::uint8_t mode = 0;
    double amount = 0;
    struct Options {
        int effort = 0, coder = 0, shuffle = 0;
    } options;
};

// What a codec is given: voxels x fastest, components interleaved.
struct Form {
    Index3 dims{0};
    ScalarType type = ScalarType::u8;
    int components = 1;
    ValueRange range;  // of the finite values of the whole volume

    std::size_t values() const { return std::size_t(Box::of(dims).voxels()) * std::size_t(components); }
    std::size_t bytes() const { return values() * bytes_of(type); }
    // Integers are coded as `bits` bits above `low()`.
    std::int64_t low() const { return std::int64_t(range.min); }
    int bits() const { return std::max(1, int(std::bit_width(std::uint64_t(std::int64_t(range.max) - low())))); }
};

// Settings to search, from the coarsest to the finest.
struct Scale {
    int count = 0;
    std::function<Setting(int)> at;
};

struct Codec {
    std::string_view name;     // of the nodes: zfp.encode, zfp.write; and in files
    std::string_view title;    // for people
    std::string library;       // with its version
    std::string_view doc, method, reference;
    std::vector<std::string> keywords;
    // What people may ask for; the first is the default. A codec with one choice shows none.
    std::vector<Target> targets;
    std::vector<ParamSpec> params;                      // of its own
    Setting::Options (*options)(const Params&);         // from those
    // Why it cannot hold such voxels ("it takes integers alone"), or empty. `range` may be unknown.
    std::string (*problem)(const VolumeDesc& volume);
    // The setting for a target that needs no search; of the others, the settings to search.
    Setting (*direct)(const Form&, Target, double amount);
    Scale (*scale)(const Form&, Target);
    Bytes (*encode)(const Form&, const Setting&, std::span<const std::byte> voxels);
    // Throws Error for bytes that encode() does not give.
    void (*decode)(const Form&, const Setting&, std::span<const std::byte> bytes, std::span<std::byte> voxels);
};

// Those that this build has, and one of them by name; null where it is not there.
const std::vector<const Codec*>& codecs();
const Codec* find_codec(std::string_view name);

// One a source file, each there where its library is.
const Codec& raw_codec();
const Codec& zfp_codec();
const Codec& blosc_codec();
const Codec& jpeg2000_codec();
const Codec& jpegls_codec();
const Codec& jpegxl_codec();

}  // namespace voxloom::baseline
