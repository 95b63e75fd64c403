#include "core/data/convert.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace voxloom {
namespace {

template <class T>
T converted(double v) {
    T out;
    from_double(&v, 1, scalar_type_of<T>, reinterpret_cast<std::byte*>(&out));
    return out;
}

TEST(Convert, RoundsHalfToEven) {
    EXPECT_EQ(converted<std::uint8_t>(0.5), 0);
    EXPECT_EQ(converted<std::uint8_t>(1.5), 2);
    EXPECT_EQ(converted<std::uint8_t>(2.5), 2);
    EXPECT_EQ(converted<std::int8_t>(-2.5), -2);
    EXPECT_EQ(converted<std::int8_t>(-3.5), -4);
    EXPECT_EQ(converted<std::uint32_t>(4294967294.5), 4294967294u);
    EXPECT_EQ(converted<std::int32_t>(-2147483647.5), std::numeric_limits<std::int32_t>::min());
}

TEST(Convert, ClampsAndMakesZeroOfNan) {
    const double inf = std::numeric_limits<double>::infinity();
    EXPECT_EQ(converted<std::uint8_t>(-0.6), 0);
    EXPECT_EQ(converted<std::uint8_t>(255.6), 255);
    EXPECT_EQ(converted<std::uint16_t>(inf), 65535);
    EXPECT_EQ(converted<std::int16_t>(-inf), -32768);
    EXPECT_EQ(converted<std::uint32_t>(1e300), 4294967295u);
    EXPECT_EQ(converted<std::int32_t>(std::nan("")), 0);
    EXPECT_EQ(converted<float>(1e300), std::numeric_limits<float>::max());
    EXPECT_EQ(converted<float>(-inf), -std::numeric_limits<float>::infinity());
    EXPECT_TRUE(std::isnan(converted<float>(std::nan(""))));
    EXPECT_EQ(converted<float>(1e-45), 1e-45f);  // denormals stay
    EXPECT_TRUE(std::signbit(converted<double>(-0.0)));
}

TEST(Convert, EveryTypeToEveryWiderOneAndBackIsTheSame) {
    for (int a = 0; a < kScalarTypes; ++a)
        for (int b = 0; b < kScalarTypes; ++b) {
            const auto [lo, hi] = limits_of(ScalarType(a));
            const auto [wide_lo, wide_hi] = limits_of(ScalarType(b));
            const bool exact = ScalarType(b) == ScalarType::f64 || (a < 4 && ScalarType(b) == ScalarType::f32) ||
                               (!is_float(ScalarType(a)) && !is_float(ScalarType(b)));
            if (a == b || !exact || wide_lo > lo || wide_hi < hi) continue;
            std::vector<std::byte> there(1300 * 8), back(1300 * 8), values(1300 * 8);
            with_type(ScalarType(a), [&, lo = lo, hi = hi](auto t) {
                auto* v = reinterpret_cast<decltype(t)*>(values.data());
                for (int i = 0; i < 1300; ++i)
                    v[i] = decltype(t)(lo + (hi - lo) * (double(i) / 1299) * 0.999);
            });
            convert(ScalarType(a), values.data(), ScalarType(b), there.data(), 1300);
            convert(ScalarType(b), there.data(), ScalarType(a), back.data(), 1300);
            back.resize(1300 * bytes_of(ScalarType(a)));
            values.resize(back.size());
            EXPECT_EQ(back, values) << name_of(ScalarType(a)) << " " << name_of(ScalarType(b));
        }
}

}  // namespace
}  // namespace voxloom
