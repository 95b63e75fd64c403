// Validity masks, and floats that are decimal numbers.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>

#include "core/base/error.h"
#include "core/data/brick_cache.h"
#include "core/data/convert.h"
#include "plugins/codec-wavelet/encoder.h"
#include "plugins/codec-wavelet/file_format.h"
#include "plugins/codec-wavelet/mask_layer.h"
#include "tests/support/volumes.h"

namespace voxloom::wavelet {
namespace {

using voxloom::testing::make_volume;

constexpr Index3 kDims{37, 29, 34};

bool is_valid(std::int64_t x, std::int64_t y, std::int64_t z) {
    const double r = std::hypot(double(x - 14), double(y - 15), double(z - 12));
    return r < 11 && (x + 2 * y + z) % 31 != 0;
}

// Smooth inside a ball with holes; what is not valid is `junk` of its place.
template <class Junk>
std::shared_ptr<const DenseVolume> masked(ScalarType type, const Junk& junk) {
    const VolumePtr plain = make_volume(kDims, type, [&](auto x, auto y, auto z) {
        return is_valid(x, y, z) ? 60 + 30 * std::sin(double(x + y) / 4) + double((x * 5 + z * 3) % 3) : double(junk(x, y, z));
    });
    VolumeDesc desc = plain->desc();
    desc.has_mask = true;
    desc.range.reset();
    Buffer voxels(desc.dense_bytes()), mask(desc.voxels());
    plain->read(Box::of(kDims), voxels.bytes(), {});
    std::size_t i = 0;
    for (std::int64_t z = 0; z < kDims.z; ++z)
        for (std::int64_t y = 0; y < kDims.y; ++y)
            for (std::int64_t x = 0; x < kDims.x; ++x) mask.as<std::uint8_t>()[i++] = is_valid(x, y, z);
    return std::make_shared<DenseVolume>(desc, std::move(voxels), std::move(mask));
}
double noise(std::int64_t x, std::int64_t y, std::int64_t z) { return double((x * 7919 + y * 104729 + z * 1299709) % 119); }

EncodeOptions options_for(CoderKind coder, Faces faces = Faces::block, Target target = Target::lossless, double amount = 0) {
    EncodeOptions options;
    options.coder = coder;
    options.brick = 8;
    options.faces = faces;
    options.target = target;
    options.amount = amount;
    return options;
}

std::vector<std::byte> decoded(const BricksPtr& bricks) {
    BrickCache cache(64 << 20);
    std::vector<std::byte> voxels(bricks->desc().volume.dense_bytes());
    read_region(bricks, 0, Box::of(bricks->desc().volume.dims), voxels, cache);
    return voxels;
}

void expect_valid_voxels(const BricksPtr& bricks, const Volume& volume) {
    const auto got = decoded(bricks);
    const std::size_t each = volume.desc().voxel_bytes();
    std::vector<std::uint8_t> mask(volume.desc().voxels());
    bricks->read_mask(0, Box::of(kDims), mask);
    std::size_t i = 0;
    for (std::int64_t z = 0; z < kDims.z; ++z)
        for (std::int64_t y = 0; y < kDims.y; ++y)
            for (std::int64_t x = 0; x < kDims.x; ++x, ++i) {
                ASSERT_EQ(mask[i] != 0, is_valid(x, y, z)) << x << " " << y << " " << z;
                if (mask[i]) {
                    ASSERT_EQ(std::memcmp(&got[i * each], volume.data() + i * each, each), 0) << x << " " << y << " " << z;
                }
            }
}

TEST(Masks, ValidVoxelsAndTheMaskComeBackBitForBit) {
    EncodeReport report;
    for (CoderKind coder : {CoderKind::paper, CoderKind::dense, CoderKind::fast})
        for (ScalarType type : {ScalarType::u8, ScalarType::i16, ScalarType::i32, ScalarType::f32}) {
            const auto volume = masked(type, [&](auto x, auto y, auto z) {
                return is_float(type) && x % 3 == 0 ? std::numeric_limits<double>::quiet_NaN() : noise(x, y, z);
            });
            for (Faces faces : {Faces::block, Faces::shared}) {
                const auto bricks = encode(*volume, options_for(coder, faces), report);
                expect_valid_voxels(bricks, *volume);
                EXPECT_EQ(report.max_error, 0);
                EXPECT_EQ(report.patches, 0u);
            }
        }
}

TEST(Masks, WhatIsNotValidChangesNothing) {
    EncodeReport report;
    for (Target target : {Target::lossless, Target::psnr, Target::max_error})
        for (ScalarType type : {ScalarType::u8, ScalarType::f32}) {
            const EncodeOptions options = options_for(CoderKind::dense, Faces::block, target, target == Target::psnr ? 40 : 2);
            const auto quiet = encode(*masked(type, [](auto, auto, auto) { return 70; }), options, report);
            const auto loud = encode(*masked(type, noise), options, report);
            EXPECT_EQ(quiet->desc().volume.range, loud->desc().volume.range);
            EXPECT_TRUE(std::equal(quiet->payload().begin(), quiet->payload().end(), loud->payload().begin(), loud->payload().end()));
        }
}

TEST(Masks, ErrorsAndRangesAreOfValidVoxels) {
    const auto volume = masked(ScalarType::i16, [](auto x, auto y, auto z) { return 100 * noise(x, y, z); });
    EncodeReport report;
    const auto bricks = encode(*volume, options_for(CoderKind::fast, Faces::block, Target::psnr, 38), report);
    const auto got = decoded(bricks);
    const auto* before = reinterpret_cast<const std::int16_t*>(volume->data());
    const auto* after = reinterpret_cast<const std::int16_t*>(got.data());
    double squares = 0, largest = 0, count = 0;
    std::size_t i = 0;
    for (std::int64_t z = 0; z < kDims.z; ++z)
        for (std::int64_t y = 0; y < kDims.y; ++y)
            for (std::int64_t x = 0; x < kDims.x; ++x, ++i) {
                if (!is_valid(x, y, z)) continue;
                const double e = std::abs(before[i] - after[i]);
                squares += e * e;
                largest = std::max(largest, e);
                ++count;
            }
    EXPECT_GT(largest, 0);
    EXPECT_EQ(report.max_error, largest);
    EXPECT_NEAR(report.rmse, std::sqrt(squares / count), 1e-12);
    EXPECT_LE(bricks->desc().volume.range->max, 100);
    for (int l = 0; l < int(bricks->desc().levels.size()); ++l) {
        const BrickInfo info = bricks->info({l, glm::ivec3(0)});
        EXPECT_LE(info.range.max, 140) << l;  // a coarse level overshoots by so much at most, and junk by thousands
    }
}

TEST(Masks, CoarseSamplesAreValidAroundValidVoxels) {
    const auto volume = masked(ScalarType::u8, noise);
    EncodeReport report;
    const auto bricks = encode(*volume, options_for(CoderKind::fast), report);
    std::vector<std::uint8_t> finer(volume->desc().voxels());
    bricks->read_mask(0, Box::of(kDims), finer);
    for (int l = 1; l < int(bricks->desc().levels.size()); ++l) {
        const LevelDesc &coarse = bricks->desc().levels[std::size_t(l)], &fine = bricks->desc().levels[std::size_t(l) - 1];
        const Index3 n = coarse.dims, m = fine.dims, step(coarse.stride / fine.stride);
        std::vector<std::uint8_t> mask(Box::of(n).voxels());
        bricks->read_mask(l, Box::of(n), mask);
        const auto finer_at = [&](Index3 i) { return finer[std::size_t((i.z * m.y + i.y) * m.x + i.x)] != 0; };
        for (std::int64_t z = 0; z < n.z; ++z)
            for (std::int64_t y = 0; y < n.y; ++y)
                for (std::int64_t x = 0; x < n.x; ++x) {
                    const Index3 centre = Index3(x, y, z) * step, reach = step - Index3(1);
                    const Index3 lo = glm::max(centre - reach, Index3(0)), hi = glm::min(centre + reach, m - Index3(1));
                    bool around = false;
                    for (std::int64_t k = lo.z; k <= hi.z; ++k)
                        for (std::int64_t j = lo.y; j <= hi.y; ++j)
                            for (std::int64_t i = lo.x; i <= hi.x; ++i) around = around || finer_at({i, j, k});
                    const bool valid = mask[std::size_t((z * n.y + y) * n.x + x)];
                    EXPECT_TRUE(valid || !finer_at(centre)) << l << ": " << x << " " << y << " " << z;
                    EXPECT_TRUE(around || !valid) << l << ": " << x << " " << y << " " << z;
                }
        finer = mask;
    }
}

TEST(Masks, PlanesOfAnyKindAreCoded) {
    for (Index3 dims : {Index3(1), Index3(7, 1, 3), Index3(16)})
        for (int kind = 0; kind < 4; ++kind) {
            Mask mask(Box::of(dims).voxels());
            for (std::size_t i = 0; i < mask.size(); ++i) mask[i] = kind == 0 ? 0 : kind == 1 ? 1 : kind == 2 ? i % 2 : i * i % 7 < 3;
            Bytes bytes;
            encode_mask(mask, dims, bytes);
            EXPECT_EQ(decode_mask(bytes, dims), mask);
            if (kind < 2) {
                EXPECT_LE(bytes.size(), 1u);
            }
        }
    const Bytes strange{std::byte(7)};
    EXPECT_THROW(decode_mask(strange, Index3(4)), Error);
}

// Version 3 added masks. Set VOXLOOM_WRITE_GOLDEN to write these files.
TEST(Masks, GoldenFilesStayReadable) {
    const auto volume = masked(ScalarType::u8, [](auto, auto, auto) { return 0; });
    for (CoderKind coder : {CoderKind::paper, CoderKind::dense, CoderKind::blocks}) {
        const std::filesystem::path golden = std::filesystem::path(VOXLOOM_SOURCE_DIR) / "plugins/codec-wavelet/golden" /
            fmt::format("v3-mask-{}-u8.vxw", name_of(coder));
        EncodeReport report;
        if (std::getenv("VOXLOOM_WRITE_GOLDEN") && kWaveletFile.version == 3) write_file(*encode(*volume, options_for(coder), report), golden);
        const auto opened = open_file(golden);
        EXPECT_TRUE(opened->desc().volume.has_mask);
        expect_valid_voxels(opened, *volume);
    }
}

TEST(DecimalFloats, AreIntegersOfTheirGrid) {
    for (ScalarType type : {ScalarType::f32, ScalarType::f64})
        for (double grid : {1.0, 0.125, 0.1, 0.01, 0.001}) {
            const auto value = [&](auto x, auto y, auto z) {
                return grid * std::round(400 * std::sin(double(x + y) / 6) + double(z) + double((x * 5 + z * 3) % 3));
            };
            const auto strange = [&](auto x, auto y, auto z) {
                return x == 3 && y == 4 ? std::numeric_limits<double>::quiet_NaN() : x == 5 && y == 4 ? -0.0 : value(x, y, z);
            };
            const auto off_grid = [&](auto x, auto y, auto z) { return value(x, y, z) + grid / std::numbers::pi; };
            EncodeReport report;
            const VolumePtr on = make_volume(kDims, type, strange), off = make_volume(kDims, type, off_grid);
            const auto bricks = encode(*on, options_for(CoderKind::fast), report);
            EXPECT_FALSE(bricks->index().tree.distances);
            EXPECT_DOUBLE_EQ(bricks->index().tree.map.step, grid);
            const auto got = decoded(bricks);
            EXPECT_EQ(std::memcmp(got.data(), on->data(), got.size()), 0) << voxloom::name_of(type) << " " << grid;
            const auto plain = encode(*off, options_for(CoderKind::fast), report);
            EXPECT_TRUE(plain->index().tree.distances);
            EXPECT_EQ(std::memcmp(decoded(plain).data(), off->data(), got.size()), 0);
            EXPECT_LT(2 * bricks->desc().compressed_bytes, plain->desc().compressed_bytes);
        }
}

}  // namespace
}  // namespace voxloom::wavelet
