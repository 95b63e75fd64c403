#include "core/base/types.h"

#include <array>
#include <limits>

#include "core/base/error.h"

namespace voxloom {

namespace {
constexpr std::array<std::string_view, kScalarTypes> kNames = {"u8",  "i8",  "u16", "i16",
                                                               "u32", "i32", "f32", "f64"};
}

std::size_t bytes_of(ScalarType type) {
    return with_type(type, [](auto t) { return sizeof(t); });
}

std::string_view name_of(ScalarType type) { return kNames[std::size_t(type)]; }

std::optional<ScalarType> scalar_type_named(std::string_view name) {
    for (std::size_t i = 0; i < kNames.size(); ++i)
        if (kNames[i] == name) return ScalarType(i);
    return std::nullopt;
}

std::pair<double, double> limits_of(ScalarType type) {
    return with_type(type, [](auto t) {
        using Limits = std::numeric_limits<decltype(t)>;
        return std::pair<double, double>(double(Limits::lowest()), double(Limits::max()));
    });
}

std::uint64_t checked_product(Index3 dims, std::uint64_t bytes_each, std::string_view what) {
    __extension__ unsigned __int128 product = bytes_each;
    for (int a = 0; a < 3; ++a) {
        if (dims[a] < 0) fail("{}: extent {} on axis {} is negative", what, dims[a], "xyz"[a]);
        product *= static_cast<std::uint64_t>(dims[a]);
        if (product > std::uint64_t(std::numeric_limits<std::int64_t>::max()))
            fail("{}: {} x {} x {} voxels of {} bytes do not fit in 63 bits", what, dims.x, dims.y,
                 dims.z, bytes_each);
    }
    return static_cast<std::uint64_t>(product);
}

}  // namespace voxloom
