// Scalar types, index vectors and boxes. Axis order everywhere: x fastest, then y, then z.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <string_view>
#include <utility>

namespace voxloom {

enum class ScalarType : std::uint8_t { u8, i8, u16, i16, u32, i32, f32, f64 };
inline constexpr int kScalarTypes = 8;

std::size_t bytes_of(ScalarType type);
std::string_view name_of(ScalarType type);  // "u8", "i8", ...
std::optional<ScalarType> scalar_type_named(std::string_view name);
inline bool is_float(ScalarType type) { return type >= ScalarType::f32; }
// Smallest and largest value the type can hold (lowest() for floats).
std::pair<double, double> limits_of(ScalarType type);

template <class T>
struct ScalarTypeOf;
template <> struct ScalarTypeOf<std::uint8_t> { static constexpr ScalarType value = ScalarType::u8; };
template <> struct ScalarTypeOf<std::int8_t> { static constexpr ScalarType value = ScalarType::i8; };
template <> struct ScalarTypeOf<std::uint16_t> { static constexpr ScalarType value = ScalarType::u16; };
template <> struct ScalarTypeOf<std::int16_t> { static constexpr ScalarType value = ScalarType::i16; };
template <> struct ScalarTypeOf<std::uint32_t> { static constexpr ScalarType value = ScalarType::u32; };
template <> struct ScalarTypeOf<std::int32_t> { static constexpr ScalarType value = ScalarType::i32; };
template <> struct ScalarTypeOf<float> { static constexpr ScalarType value = ScalarType::f32; };
template <> struct ScalarTypeOf<double> { static constexpr ScalarType value = ScalarType::f64; };
template <class T>
inline constexpr ScalarType scalar_type_of = ScalarTypeOf<T>::value;

// Calls f(T{}) with T the C++ type of `type`: one template body serves all eight.
template <class F>
decltype(auto) with_type(ScalarType type, F&& f) {
    switch (type) {
        case ScalarType::u8: return f(std::uint8_t{});
        case ScalarType::i8: return f(std::int8_t{});
        case ScalarType::u16: return f(std::uint16_t{});
        case ScalarType::i16: return f(std::int16_t{});
        case ScalarType::u32: return f(std::uint32_t{});
        case ScalarType::i32: return f(std::int32_t{});
        case ScalarType::f32: return f(float{});
        case ScalarType::f64: break;
    }
    return f(double{});
}

using Index3 = glm::i64vec3;  // voxel index or extent

// Product of the extents, or an Error when it does not fit (what names the thing in the message).
std::uint64_t checked_product(Index3 dims, std::uint64_t bytes_each, std::string_view what);

// Half-open box of voxel indices: lo <= i < hi.
struct Box {
    Index3 lo{0};
    Index3 hi{0};

    static Box of(Index3 dims) { return {Index3(0), dims}; }
    Index3 dims() const { return glm::max(hi - lo, Index3(0)); }
    bool empty() const { return hi.x <= lo.x || hi.y <= lo.y || hi.z <= lo.z; }
    std::uint64_t voxels() const {
        Index3 d = dims();
        return std::uint64_t(d.x) * std::uint64_t(d.y) * std::uint64_t(d.z);
    }
    bool contains(const Box& b) const {
        return glm::all(glm::lessThanEqual(lo, b.lo)) && glm::all(glm::lessThanEqual(b.hi, hi));
    }
    friend Box intersect(const Box& a, const Box& b) {
        return {glm::max(a.lo, b.lo), glm::min(a.hi, b.hi)};
    }
    friend bool operator==(const Box&, const Box&) = default;
};

struct ValueRange {
    double min = 0, max = 0;
    double extent() const { return max - min; }
    friend bool operator==(const ValueRange&, const ValueRange&) = default;
};

}  // namespace voxloom
