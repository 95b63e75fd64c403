#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <random>

#include "core/base/error.h"
#include "plugins/codec-wavelet/bit_io.h"
#include "plugins/codec-wavelet/coder.h"
#include "plugins/codec-wavelet/lane_layout.h"
#include "plugins/codec-wavelet/sparse_list.h"

namespace voxloom::wavelet {
namespace {

const glm::bvec3 kAll(true), kNone(false);

struct Family {
    Details details;
    std::vector<std::int32_t> q, low;

    Family(Shape shape, const std::function<std::int32_t(std::size_t)>& number) : q(shape.voxels()), low(shape.voxels()) {
        for (std::size_t i = 0; i < q.size(); ++i) q[i] = number(i);
        for (std::size_t i = 0; i < low.size(); ++i) low[i] = std::int32_t(i * i % 5000) - 700;
        details.shape = shape;
        details.q = q.data();
        details.low = low.data();
    }
};

std::vector<std::int32_t> details_only(const Details& d) {
    std::vector<std::int32_t> numbers;
    for_each_row(d, [&](const std::int32_t* q, std::size_t n) { numbers.insert(numbers.end(), q, q + n); });
    return numbers;
}
std::vector<std::int32_t> decoded(const Coder& coder, const Details& like, std::span<const std::byte> bytes) {
    std::vector<std::int32_t> q(like.shape.voxels(), 99);
    Details d = like;
    d.q = q.data();
    coder.decode(bytes, d);
    return details_only(d);
}
Bytes encoded(const Coder& coder, const Details& d) {
    Bytes bytes;
    coder.encode(d, bytes);
    return bytes;
}
std::unique_ptr<Coder> trained_on(const Details& d) {
    auto coder = make_coder(CoderKind::fast);
    coder->train(d);
    coder->finish_training();
    return coder;
}

// Whole, odd, prime, thin, wide and one-sided; with axes that are not halved, split or whole.
const std::vector<Shape> kShapes = {
    {{32, 32, 32}, kAll},
    {{16, 16, 16}, kAll},
    {{33, 33, 33}, kAll},
    {{31, 7, 13}, kAll},
    {{2, 1, 1}, kAll},
    {{1, 1, 64}, kAll},
    {{130, 3, 2}, kAll},
    {{32, 32, 16}, {true, true, false}, {false, false, true}},
    {{16, 30, 30}, {false, true, true}, {true, false, false}},
    {{9, 8, 7}, {true, false, false}, kNone},
};

// Laplacian numbers whose size changes from place to place.
std::function<std::int32_t(std::size_t)> noise(double size, unsigned seed) {
    return [size, random = std::mt19937(seed)](std::size_t i) mutable {
        const double u = (double(random()) + 0.5) / 4294967296.0 - 0.5;
        const double number = size * (1 + double(i / 64 % 7)) * (u < 0 ? -1 : 1) * -std::log(1 - 2 * std::abs(u));
        return std::int32_t(std::clamp(number, -2147483648.0, 2147483647.0));
    };
}

TEST(LaneLayout, EveryPlaceOfABandStandsInOneLane) {
    for (const Shape& shape : kShapes) {
        const LaneLayout layout(shape);
        for (int mask : kBandOrder) {
            const Band band = shape.band(mask);
            if (!shape.has(band)) continue;
            std::vector<int> met(shape.voxels());
            std::vector<int> lanes(layout.places());
            std::size_t groups = 0;
            layout.each_group(band, [&](int z, int panel, int row) {
                ++groups;
                layout.each_strip(band, panel, row, [&](int lane, int x, int y, int count) {
                    for (int i = 0; i < count; ++i) {
                        ++met[shape.at(band.lo + glm::ivec3(x + i, y, z))];
                        ++lanes.at(layout.at(z, panel, row) + std::size_t(lane + i));
                    }
                });
            });
            EXPECT_EQ(groups, layout.groups(band));
            const auto places = std::size_t(band.dims.x * band.dims.y * band.dims.z);
            EXPECT_EQ(std::size_t(std::count(met.begin(), met.end(), 1)), places);
            EXPECT_EQ(std::size_t(std::count(lanes.begin(), lanes.end(), 1)), places);
        }
    }
}

TEST(FastCoder, RoundTripsEverySizeOfNumbersInEveryShape) {
    for (const Shape& shape : kShapes)
        for (double size : {0.01, 0.3, 3.0, 60.0, 3000.0, 1e6, 3e8})
            for (bool finest : {false, true}) {
                Family family(shape, noise(size, 5));
                family.details.finest = finest;
                const auto trained = trained_on(family.details);
                const auto reread = make_coder(CoderKind::fast, trained->tables());
                EXPECT_EQ(decoded(*reread, family.details, encoded(*trained, family.details)), details_only(family.details));
                const auto untrained = make_coder(CoderKind::fast);
                EXPECT_EQ(decoded(*untrained, family.details, encoded(*untrained, family.details)), details_only(family.details));
            }
}

TEST(FastCoder, WhatTrainingNeverMetComesBackAllTheSame) {
    const Shape shape{{32, 32, 32}, kAll};
    const Family quiet(shape, [](std::size_t i) { return i % 50 == 0; });
    const auto coder = trained_on(quiet.details);
    for (std::int32_t extreme : {std::int32_t(2), std::int32_t(-15), std::int32_t(16), std::int32_t(-40000), INT32_MAX, INT32_MIN}) {
        const Family family(shape, [&](std::size_t i) { return i % 3 == 0 ? extreme : i % 7 == 0 ? 1 : 0; });
        EXPECT_EQ(decoded(*coder, family.details, encoded(*coder, family.details)), details_only(family.details));
    }
}

// Calls use(name) with each instruction set that this machine has as the best there is.
void on_every_target(const std::function<void(const char*)>& use) {
    for (std::int64_t target : {HWY_AVX3, HWY_AVX2, HWY_SSE4, HWY_SCALAR}) {
        hwy::SetSupportedTargetsForTest(0);
        if (target != HWY_SCALAR && !(hwy::SupportedTargets() & target)) continue;
        hwy::SetSupportedTargetsForTest(target);
        hwy::GetChosenTarget().Update(hwy::SupportedTargets());
        use(hwy::TargetName(target));
    }
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

TEST(FastCoder, EveryInstructionSetWritesTheSameBytes) {
    for (const Shape& shape : kShapes)
        for (double size : {0.2, 8.0, 1e5}) {
            const Family family(shape, noise(size, 11));
            const auto coder = trained_on(family.details);
            const Bytes bytes = encoded(*coder, family.details), tables = coder->tables();
            on_every_target([&](const char* name) {
                EXPECT_EQ(trained_on(family.details)->tables(), tables) << name;
                EXPECT_EQ(encoded(*coder, family.details), bytes) << name;
                EXPECT_EQ(decoded(*coder, family.details, bytes), details_only(family.details)) << name;
            });
        }
}

TEST(FastCoder, GarbageAndTruncationsAreRefusedOrDecodedWithoutAStepOutside) {
    std::mt19937 random(3);
    for (const Shape& shape : {kShapes[1], kShapes[3], kShapes[7]}) {
        for (double size : {0.01, 0.5, 500.0}) {
            const Family family(shape, noise(size, 2));
            const auto coder = trained_on(family.details);
            const Bytes bytes = encoded(*coder, family.details);
            if (bytes.empty()) continue;  // nothing but zeros
            const auto try_to_decode = [&](const Bytes& damaged) {
                try {
                    (void)decoded(*coder, family.details, damaged);
                } catch (const Error&) {
                }
            };
            for (int i = 0; i < 60; ++i) {
                Bytes cut(bytes.begin(), bytes.begin() + std::ptrdiff_t(random() % bytes.size()));
                try_to_decode(cut);
                Bytes flipped = bytes;
                flipped[random() % flipped.size()] ^= std::byte(1 << random() % 8);
                try_to_decode(flipped);
                Bytes noisy(random() % 400);
                for (std::byte& b : noisy) b = std::byte(random());
                try_to_decode(noisy);
            }
        }
    }
}

TEST(FastCoder, CorruptTablesAreRefused) {
    std::mt19937 random(3);
    const Family family(kShapes[1], noise(2, 2));
    const Bytes tables = trained_on(family.details)->tables();
    EXPECT_EQ(make_coder(CoderKind::fast, tables)->tables(), tables);
    int refused = 0;
    for (int i = 0; i < 40; ++i) {
        Bytes damaged = tables;
        for (std::byte& b : damaged) b = random() % 20 ? b : std::byte(random());
        try {
            make_coder(CoderKind::fast, damaged);
        } catch (const Error&) {
            ++refused;
        }
    }
    EXPECT_GT(refused, 0);
}

TEST(FastCoder, AFewNumbersCostAFewBytes) {
    const Family family(kShapes[0], [](std::size_t i) { return i % 5000 == 4999 ? -3 : 0; });
    const auto coder = trained_on(family.details);
    const Bytes bytes = encoded(*coder, family.details);
    EXPECT_LE(bytes.size(), 20u);  // at most six numbers of 2 to 3 bytes, and the list's head
    EXPECT_EQ(decoded(*coder, family.details, bytes), details_only(family.details));
}

TEST(FastCoder, NeighboursTellOfANumbersSize) {
    // Half of the numbers are large. Where they stand together, a coder must not pay for each.
    const Shape shape{{32, 32, 32}, kAll};
    std::mt19937 random(9);
    const auto number = [&](bool large) { return large ? std::int32_t(random() % 15) - 7 : 0; };
    const Family together(shape, [&](std::size_t i) { return number(i % 16 < 8); });
    const Family apart(shape, [&](std::size_t) { return number(random() % 2 == 0); });
    const std::size_t smaller = encoded(*trained_on(together.details), together.details).size(),
                      larger = encoded(*trained_on(apart.details), apart.details).size();
    // Up to one bit less for each of 28672 numbers, of which the borders give more than half back.
    EXPECT_LT(smaller + 28672 / 8 * 4 / 10, larger);
}

TEST(SparseList, RoundTripsAndRefusesPlacesBeyondTheEnd) {
    for (const Shape& shape : kShapes)
        for (std::size_t every : {1, 3, 100, 100000}) {
            const Family family(shape, [&](std::size_t i) { return i % every == every - 1 ? std::int32_t(i) - 300 : 0; });
            BitWriter writer;
            write_sparse(family.details, writer);
            const Bytes bytes = writer.finish();
            std::vector<std::int32_t> q(shape.voxels());
            Details d = family.details;
            d.q = q.data();
            BitReader reader(bytes);
            read_sparse(reader, d);
            EXPECT_EQ(details_only(d), details_only(family.details));
        }
    BitWriter writer;
    writer.gamma(2);    // one number
    writer.put(20, 5);  // after 2^20 zeros
    writer.put(1, 2);
    const Bytes bytes = writer.finish();
    Family family(kShapes[1], [](std::size_t) { return 0; });
    BitReader reader(bytes);
    EXPECT_THROW(read_sparse(reader, family.details), Error);
}

}  // namespace
}  // namespace voxloom::wavelet
