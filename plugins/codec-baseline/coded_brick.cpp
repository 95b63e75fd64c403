#include "plugins/codec-baseline/coded_brick.h"

#include <algorithm>
#include <cmath>

#include "core/base/meter.h"

namespace voxloom::baseline {

namespace {

bool all_finite(const Form& form, std::span<const std::byte> voxels) {
    return with_type(form.type, [&](auto t) {
        using T = decltype(t);
        if constexpr (std::is_floating_point_v<T>) {
            const T* values = reinterpret_cast<const T*>(voxels.data());
            return std::all_of(values, values + form.values(), [](T v) { return std::isfinite(v); });
        }
        return true;
    });
}

// Does what came back hold what was promised?
bool is_good(const Form& form, const Setting& setting, double bound, std::span<const std::byte> voxels,
             std::span<const std::byte> decoded) {
    if (setting.mode == 0) return std::ranges::equal(voxels, decoded);
    return all_finite(form, decoded) && error_of(form, voxels, decoded).largest <= bound;
}

}  // namespace

BrickError error_of(const Form& form, std::span<const std::byte> truth, std::span<const std::byte> given) {
    BrickError error;
    with_type(form.type, [&](auto t) {
        using T = decltype(t);
        const T* a = reinterpret_cast<const T*>(truth.data());
        const T* b = reinterpret_cast<const T*>(given.data());
        for (std::size_t i = 0; i < form.values(); ++i) {
            if constexpr (std::is_floating_point_v<T>)
                if (!std::isfinite(a[i])) continue;
            const double e = std::abs(double(a[i]) - double(b[i]));
            error.squares += e * e;
            error.largest = std::max(error.largest, e);
            ++error.finite;
        }
    });
    return error;
}

CodedBrick code_brick(const Codec& codec, const Form& form, const Setting& setting, double bound,
                      std::span<const std::byte> voxels) {
    CodedBrick brick;
    brick.decoded = Buffer(voxels.size(), "brick");
    const auto attempt = [&](const Setting& set, Kept kept) {
        const std::int64_t start = thread_cpu_ns();
        const Bytes coded = codec.encode(form, set, voxels);
        brick.codec_ns += thread_cpu_ns() - start;
        if (coded.size() > voxels.size()) return false;
        codec.decode(form, set, coded, brick.decoded.bytes());
        if (!is_good(form, set, bound, voxels, brick.decoded.bytes())) return false;
        brick.bytes.assign(1, std::byte(kept));
        ByteWriter(brick.bytes).bytes(coded);
        brick.kept = kept;
        return true;
    };
    if ((setting.mode == 0 || all_finite(form, voxels)) && attempt(setting, Kept::as_set)) return brick;
    if (setting.mode != 0 && attempt({0, 0, setting.options}, Kept::lossless)) return brick;
    brick.bytes.assign(1, std::byte(Kept::raw));
    ByteWriter(brick.bytes).bytes(voxels);
    std::ranges::copy(voxels, brick.decoded.data());
    brick.kept = Kept::raw;
    return brick;
}

void decode_brick(const Codec& codec, const Form& form, const Setting& setting, std::span<const std::byte> bytes,
                  std::span<std::byte> voxels) {
    ByteReader reader(bytes);
    switch (reader.number<std::uint8_t>()) {
        case std::uint8_t(Kept::as_set): return codec.decode(form, setting, reader.bytes(reader.left()), voxels);
        case std::uint8_t(Kept::lossless): return codec.decode(form, {}, reader.bytes(reader.left()), voxels);
        case std::uint8_t(Kept::raw): return raw_codec().decode(form, {}, reader.bytes(reader.left()), voxels);
        default: fail("its first byte is not known");
    }
}

}  // namespace voxloom::baseline
