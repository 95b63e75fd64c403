#include "plugins/codec-wavelet/exact_layer.h"

#include <bit>
#include <cstring>
#include <type_traits>

#include "core/base/error.h"
#include "plugins/codec-wavelet/adaptive_number.h"
#include "core/base/byte_io.h"
#include "plugins/codec-wavelet/range_coder.h"

namespace voxloom::wavelet {

namespace {

// Bits of a number such that neighbours in order are neighbours in value; -0 below +0.
template <class T>
using KeyOf = std::conditional_t<sizeof(T) <= 4, std::uint32_t, std::uint64_t>;

template <class T>
KeyOf<T> key_of(T v) {
    using Key = KeyOf<T>;
    if constexpr (std::is_integral_v<T>) {
        return Key(v);
    } else {
        constexpr Key sign = Key(1) << (8 * sizeof(T) - 1);
        const Key bits = std::bit_cast<Key>(v);
        return bits & sign ? Key(~bits) : Key(bits | sign);
    }
}
template <class T>
T from_key(KeyOf<T> key) {
    using Key = KeyOf<T>;
    if constexpr (std::is_integral_v<T>) {
        return T(key);
    } else {
        constexpr Key sign = Key(1) << (8 * sizeof(T) - 1);
        return std::bit_cast<T>(key & sign ? Key(key & ~sign) : Key(~key));
    }
}

template <class T>
const T& at(const std::byte* values, std::size_t i) {
    return reinterpret_cast<const T*>(values)[i];
}

}  // namespace

void encode_patches(ScalarType type, const std::byte* values, std::span<const std::uint8_t> needed, Bytes& out) {
    with_type(type, [&](auto t) {
        using T = decltype(t);
        ByteWriter writer(out);
        std::size_t written = 0;
        for (std::size_t i = 0; i < needed.size();) {
            if (!needed[i]) {
                ++i;
                continue;
            }
            std::size_t end = i + 1;
            while (end < needed.size() && needed[end] && std::memcmp(&at<T>(values, i), &at<T>(values, end), sizeof(T)) == 0)
                ++end;
            writer.varint(i - written);
            writer.varint(end - i);
            writer.number(at<T>(values, i));
            written = i = end;
        }
    });
}

void decode_patches(ScalarType type, std::span<const std::byte> in, std::byte* values, std::size_t count) {
    with_type(type, [&](auto t) {
        using T = decltype(t);
        ByteReader reader(in);
        std::uint64_t position = 0;
        while (reader.left() > 0) {
            const std::uint64_t gap = reader.varint(), run = reader.varint();
            if (gap > count - position || run > count - position - gap) fail("a patch lies outside of its brick");
            position += gap;
            const T value = reader.number<T>();
            for (std::uint64_t i = 0; i < run; ++i) reinterpret_cast<T*>(values)[position++] = value;
        }
    });
}

void encode_distances(ScalarType type, const std::byte* exact, const std::byte* near, std::size_t count, Bytes& out) {
    if (std::memcmp(exact, near, count * bytes_of(type)) == 0) return;
    with_type(type, [&](auto t) {
        using T = decltype(t);
        using Key = KeyOf<T>;
        RangeEncoder encoder(out);
        AdaptiveNumber model;
        for (std::size_t i = 0; i < count; ++i) {
            const Key distance = Key(key_of(at<T>(exact, i)) - key_of(at<T>(near, i)));
            const Key folded = Key(distance << 1) ^ (distance >> (8 * sizeof(Key) - 1) ? Key(~Key(0)) : Key(0));
            model.code(encoder, folded);
        }
        encoder.finish();
        // An empty stream means that there is nothing to do.
        if (out.empty()) out.push_back(std::byte(0));
    });
}

void decode_distances(ScalarType type, std::span<const std::byte> in, std::byte* values, std::size_t count) {
    if (in.empty()) return;
    with_type(type, [&](auto t) {
        using T = decltype(t);
        using Key = KeyOf<T>;
        RangeDecoder decoder(in);
        AdaptiveNumber model;
        for (std::size_t i = 0; i < count; ++i) {
            const Key folded = model.code(decoder, Key(0));
            const Key distance = Key(folded >> 1) ^ (folded & 1 ? Key(~Key(0)) : Key(0));
            T& v = reinterpret_cast<T*>(values)[i];
            v = from_key<T>(Key(key_of(v) + distance));
        }
    });
}

}  // namespace voxloom::wavelet
