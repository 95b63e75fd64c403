// Buffers, boxes, hashes, scalar types and texts.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <clocale>
#include <cmath>
#include <limits>
#include <map>
#include <random>

#include "core/base/buffer.h"
#include "core/base/error.h"
#include "core/base/hash.h"
#include "core/base/meter.h"
#include "core/base/parallel.h"
#include "core/base/text.h"

namespace voxloom {
namespace {

TEST(Buffer, IsAlignedMovableAndCounted) {
    const std::uint64_t before = buffer_bytes_in_use();
    {
        Buffer a(1000), empty;
        EXPECT_EQ(std::bit_cast<std::uintptr_t>(a.data()) % 64, 0u);
        EXPECT_EQ(buffer_bytes_in_use(), before + 1000);
        const std::byte* data = a.data();
        Buffer b(std::move(a));
        EXPECT_EQ(b.data(), data);
        EXPECT_EQ(a.size(), 0u);
        empty = std::move(b);
        EXPECT_EQ(empty.size(), 1000u);
        EXPECT_EQ(buffer_bytes_in_use(), before + 1000);
        EXPECT_GE(buffer_bytes_peak(), before + 1000);
    }
    EXPECT_EQ(buffer_bytes_in_use(), before);
    EXPECT_EQ(Buffer(0).data(), nullptr);
}

TEST(Buffer, SaysHowMuchOfWhatIsNotAvailable) {
    for (std::uint64_t bytes : {std::uint64_t(1) << 60, ~std::uint64_t(0)}) try {
            Buffer buffer(bytes, "the head");
            FAIL();
        } catch (const Error& error) {
            EXPECT_THAT(error.what(), ::testing::HasSubstr("the head"));
        }
}

TEST(Buffer, ChargesTheMeterOfItsThread) {
    Meter meter;
    {
        MeterScope scope(&meter);
        Buffer a(500);
        Buffer b(300);
    }
    EXPECT_EQ(meter.peak_bytes(), 800);
}

TEST(CopyBox, CopiesWhatBothHoldAndNothingElse) {
    std::mt19937 random(1);
    auto below = [&](std::int64_t n) { return std::int64_t(random() % std::uint64_t(n)); };
    for (int i = 0; i < 200; ++i) {
        Box box, from, to;
        for (int a = 0; a < 3; ++a) {
            box.lo[a] = below(20) - 10;
            box.hi[a] = box.lo[a] + below(5);
            for (Box* around : {&from, &to}) {
                around->lo[a] = box.lo[a] - below(4);
                around->hi[a] = box.hi[a] + below(4);
            }
        }
        std::vector<std::uint16_t> source(from.voxels()), target(to.voxels(), 0xffff);
        auto place = [](const Box& b, Index3 p) {
            const Index3 d = b.dims(), o = p - b.lo;
            return std::size_t((o.z * d.y + o.y) * d.x + o.x);
        };
        for (auto& v : source) v = std::uint16_t(random() % 1000);
        copy_box(box, reinterpret_cast<const std::byte*>(source.data()), from,
                 reinterpret_cast<std::byte*>(target.data()), to, 2);
        for (std::int64_t z = to.lo.z; z < to.hi.z; ++z)
            for (std::int64_t y = to.lo.y; y < to.hi.y; ++y)
                for (std::int64_t x = to.lo.x; x < to.hi.x; ++x) {
                    const Index3 p(x, y, z);
                    const bool inside = box.contains({p, p + Index3(1)});
                    ASSERT_EQ(target[place(to, p)], inside ? source[place(from, p)] : 0xffff);
                }
    }
}

TEST(Box, MeetsAndContains) {
    const Box a{{0, 0, 0}, {4, 5, 6}}, b{{2, -1, 3}, {9, 2, 4}};
    EXPECT_EQ(intersect(a, b), (Box{{2, 0, 3}, {4, 2, 4}}));
    EXPECT_TRUE(a.contains(intersect(a, b)));
    EXPECT_FALSE(a.contains(b));
    EXPECT_TRUE(intersect(a, {{4, 0, 0}, {5, 5, 5}}).empty());
    EXPECT_EQ((Box{{3, 3, 3}, {1, 9, 9}}).voxels(), 0u);
}

TEST(CheckedProduct, IsExactUpTo63BitsAndRefusesBeyond) {
    EXPECT_EQ(checked_product({1 << 20, 1 << 20, 1 << 10}, 4, "x"), std::uint64_t(1) << 52);
    EXPECT_EQ(checked_product({std::int64_t(1) << 31, std::int64_t(1) << 31, 1}, 1, "x"), std::uint64_t(1) << 62);
    EXPECT_EQ(checked_product({0, std::int64_t(1) << 62, 1}, 8, "x"), 0u);
    const std::int64_t most = std::numeric_limits<std::int64_t>::max();
    EXPECT_EQ(checked_product({most, 1, 1}, 1, "x"), std::uint64_t(most));
    for (Index3 dims : {Index3(most, 2, 1), Index3(most), Index3(1 << 30, 1 << 30, 1 << 30), Index3(-1, 1, 1)})
        EXPECT_THROW(checked_product(dims, 8, "the head"), Error);
    try {
        checked_product({1 << 30, 1 << 30, 1 << 30}, 8, "the head");
    } catch (const Error& error) {
        EXPECT_THAT(error.what(), ::testing::HasSubstr("the head"));
    }
}

TEST(ScalarTypes, HaveNamesSizesAndLimits) {
    for (int i = 0; i < kScalarTypes; ++i) {
        const auto type = ScalarType(i);
        EXPECT_EQ(scalar_type_named(name_of(type)), type);
        with_type(type, [&](auto t) {
            EXPECT_EQ(bytes_of(type), sizeof(t));
            EXPECT_EQ(scalar_type_of<decltype(t)>, type);
            EXPECT_EQ(limits_of(type).second, double(std::numeric_limits<decltype(t)>::max()));
        });
    }
    EXPECT_FALSE(scalar_type_named("u64"));
}

TEST(Hash, DependsOnEveryByteAndOnWhereTextsEnd) {
    std::vector<std::byte> data(1000);
    const Hash zero = hash_bytes(data);
    std::map<std::string, int> seen{{zero.hex(), 0}};
    for (std::size_t i = 0; i < data.size(); ++i) {
        data[i] = std::byte(1);
        EXPECT_TRUE(seen.emplace(hash_bytes(data).hex(), 0).second);
        data[i] = std::byte(0);
    }
    EXPECT_EQ(hash_bytes(data), zero);
    EXPECT_NE(Hasher().text("ab").text("c").finish(), Hasher().text("a").text("bc").finish());
    EXPECT_NE(Hasher().value(1).value(2).finish(), Hasher().value(2).value(1).finish());
    EXPECT_EQ(zero.hex().size(), 32u);
}

TEST(Text, ShortestReadsBackAsTheSameDouble) {
    std::mt19937_64 random(1);
    for (int i = 0; i < 20000; ++i) {
        const double value = std::bit_cast<double>(random());
        double back = 0;
        ASSERT_TRUE(parse_number(shortest(value), back)) << shortest(value);
        if (std::isnan(value))
            ASSERT_TRUE(std::isnan(back));
        else
            ASSERT_EQ(std::bit_cast<std::uint64_t>(back), std::bit_cast<std::uint64_t>(value));
    }
    EXPECT_EQ(shortest(0.1), "0.1");
    EXPECT_EQ(shortest(-2), "-2");
    EXPECT_EQ(shortest(std::numeric_limits<double>::infinity()), ".inf");
}

TEST(Text, NumbersAreReadTheSameUnderEveryLocale) {
    const std::string before = std::setlocale(LC_ALL, nullptr);
    for (const char* locale : {"C", "de_DE.UTF-8", "de_DE.utf8"}) {
        std::setlocale(LC_ALL, locale);  // where it is not installed, nothing changes
        double value = 0;
        EXPECT_TRUE(parse_number("1.5", value));
        EXPECT_EQ(value, 1.5);
        EXPECT_FALSE(parse_number("1,5", value));
        EXPECT_EQ(shortest(2.25), "2.25");
    }
    std::setlocale(LC_ALL, before.c_str());
}

TEST(Text, WhatIsNoNumberIsRefused) {
    double value = 0;
    for (const char* wrong : {"", "+", "-", "1.2.3", "0x10", "nan(3)", "infinity", "1 2", " 1", "1e", "--1", "1e999"})
        EXPECT_FALSE(parse_number(wrong, value)) << wrong;
    for (const char* right : {"1", "+1", "-1.5e-3", ".5", "5.", "1E5", ".inf", "-.inf", ".nan"})
        EXPECT_TRUE(parse_number(right, value)) << right;
    std::int64_t whole = 0;
    for (const char* wrong : {"", "1.0", "9223372036854775808", "1e3", "x"})
        EXPECT_FALSE(parse_integer(wrong, whole)) << wrong;
    EXPECT_TRUE(parse_integer("-9223372036854775808", whole));
    EXPECT_EQ(whole, std::numeric_limits<std::int64_t>::min());
}

TEST(Text, TheNearestNameIsSuggestedWhenItIsNear) {
    const std::vector<std::string> names = {"tolerance", "levels", "filter", "readers.phantom"};
    EXPECT_EQ(nearest_name("tolerence", names), "tolerance");
    EXPECT_EQ(nearest_name("fitler", names), "filter");
    EXPECT_EQ(nearest_name("phantom", names), "readers.phantom");
    EXPECT_EQ(nearest_name("colour", names), "");
    EXPECT_EQ(nearest_name("", names), "");
    EXPECT_EQ(nearest_name(std::string(5000, 'x'), names), "");
    EXPECT_EQ(did_you_mean("level", names), "; did you mean 'levels'?");
    EXPECT_EQ(did_you_mean("xyz", {}), "");
}

TEST(Text, SizesAndTimesReadWell) {
    EXPECT_EQ(human_bytes(0), "0 B");
    EXPECT_EQ(human_bytes(1023), "1023 B");
    EXPECT_EQ(human_bytes(1536), "1.5 KiB");
    EXPECT_EQ(human_bytes(double(std::uint64_t(3) << 40)), "3.0 TiB");
    EXPECT_EQ(human_seconds(0.0000015), "2 us");
    EXPECT_EQ(human_seconds(0.25), "250.0 ms");
    EXPECT_EQ(human_seconds(200), "3 min 20 s");
    EXPECT_EQ(human_seconds(7260), "2 h 1 min");
}

TEST(ParallelFor, VisitsEveryIndexOnceAndPassesErrorsOn) {
    std::vector<std::atomic<int>> visits(10000);
    parallel_for(0, 10000, 7, [&](std::int64_t lo, std::int64_t hi) {
        for (std::int64_t i = lo; i < hi; ++i) ++visits[std::size_t(i)];
    });
    for (auto& v : visits) ASSERT_EQ(v, 1);
    parallel_for(5, 5, 1, [](std::int64_t, std::int64_t) { FAIL(); });
    EXPECT_THROW(parallel_for(0, 100, 1, [](std::int64_t lo, std::int64_t) {
                     if (lo > 50) fail("number {}", lo);
                 }),
                 Error);
    std::stop_source stop;
    EXPECT_THROW(parallel_for(0, 10000, 1, [&](std::int64_t, std::int64_t) { stop.request_stop(); }, stop.get_token()),
                 Cancelled);
}

TEST(ParallelFor, ChargesTheMeterOfTheThreadThatCalled) {
    Meter meter;
    {
        MeterScope scope(&meter);
        parallel_for(0, 64, 1, [](std::int64_t, std::int64_t) { Buffer one(1000); });
    }
    EXPECT_GE(meter.peak_bytes(), 1000);
    EXPECT_GT(meter.cpu_ns(), 0);
}

}  // namespace
}  // namespace voxloom
