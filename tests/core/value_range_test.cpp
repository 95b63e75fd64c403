// The range of values: what counts, and how it is read.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <limits>

#include "tests/support/volumes.h"

namespace voxloom {
namespace {

using testing::make_volume;

TEST(ValueRange, IsThatOfTheFiniteValues) {
    auto v = make_volume({5, 4, 3}, ScalarType::f32, [](auto x, auto y, auto z) {
        if (x == 0) return std::nan("");
        if (y == 0) return std::numeric_limits<double>::infinity();
        return double(x * 100 + y * 10 + z);
    });
    EXPECT_EQ(value_range(*v), (ValueRange{110, 432}));
    auto none = make_volume({2, 2, 2}, ScalarType::f64, [](auto...) { return std::nan(""); });
    EXPECT_EQ(value_range(*none), ValueRange{});
    EXPECT_EQ(value_range(*make_volume(Index3(0), ScalarType::u8, [](auto...) { return 0; })),
              ValueRange{});
    auto constant = make_volume(Index3(1), ScalarType::i32, [](auto...) { return -7; });
    EXPECT_EQ(value_range(*constant), (ValueRange{-7, -7}));
}

// Delivers slices on demand, and notes how much it was asked for at once.
class Streamed final : public Volume {
  public:
    static VolumeDesc describe() {
        VolumeDesc desc;
        desc.dims = {256, 256, 2048};
        return desc;
    }
    Streamed() : Volume(describe()) {}
    void read(const Box& box, std::span<std::byte> out, const std::stop_token&) const override {
        std::uint64_t seen = largest;
        while (out.size() > seen && !largest.compare_exchange_weak(seen, out.size())) {
        }
        std::fill(out.begin(), out.end(), std::byte(9));
        if (box.lo.z == 0) out.front() = std::byte(1);
        if (box.hi.z == desc().dims.z) out.back() = std::byte(200);
    }
    mutable std::atomic<std::uint64_t> largest{0};
};

TEST(ValueRange, IsReadInSmallSlabs) {
    Streamed volume;
    EXPECT_EQ(value_range(volume), (ValueRange{1, 200}));
    EXPECT_LE(volume.largest, 16u << 20);
}

}  // namespace
}  // namespace voxloom
