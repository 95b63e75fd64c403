#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <random>

#include "core/base/error.h"
#include "core/data/brick_cache.h"
#include "core/data/convert.h"
#include "plugins/codec-wavelet/encoder.h"
#include "plugins/codec-wavelet/file_format.h"
#include "tests/support/volumes.h"

namespace voxloom::wavelet {
namespace {

using voxloom::testing::make_volume;

std::vector<std::byte> all_of(const Volume& volume) {
    std::vector<std::byte> voxels(volume.desc().dense_bytes());
    volume.read(Box::of(volume.desc().dims), voxels, {});
    return voxels;
}
std::vector<std::byte> decoded(const BricksPtr& bricks, int level = 0) {
    BrickCache cache(64 << 20);
    const Box box = Box::of(bricks->desc().levels[std::size_t(level)].dims);
    std::vector<std::byte> voxels(box.voxels() * bricks->desc().volume.voxel_bytes());
    read_region(bricks, level, box, voxels, cache);
    return voxels;
}
std::vector<double> numbers(const std::vector<std::byte>& voxels, ScalarType type) {
    std::vector<double> values(voxels.size() / bytes_of(type));
    to_double(type, voxels.data(), values.size(), values.data());
    return values;
}
std::shared_ptr<const WaveletBricks> encoded(const Volume& volume, EncodeOptions options, EncodeReport* report = nullptr) {
    EncodeReport own;
    return encode(volume, options, report ? *report : own);
}
EncodeOptions lossless(CoderKind coder = CoderKind::dense, int brick = 8) {
    EncodeOptions options;
    options.coder = coder;
    options.brick = brick;
    return options;
}
EncodeOptions aiming(Target target, double amount, CoderKind coder = CoderKind::dense) {
    EncodeOptions options = lossless(coder);
    options.target = target;
    options.amount = amount;
    return options;
}

// Blobs with an edge and some noise, between 0 and 1.
double scene(double x, double y, double z, unsigned noise) {
    const double r = std::sqrt((x - 17) * (x - 17) + (y - 15) * (y - 15) + (z - 20) * (z - 20));
    const double edge = r < 11 ? 0.55 : 0.1;
    std::uint32_t h = std::uint32_t(x * 73856093) ^ std::uint32_t(y * 19349663) ^ std::uint32_t(z * 83492791) ^ noise;
    h = (h ^ h >> 15) * 2246822519u;
    return edge + 0.2 + 0.15 * std::sin(x / 5) * std::cos(y / 7 + z / 4) + 0.02 * double(h >> 8 & 255) / 255;
}
VolumePtr scene_volume(Index3 dims, ScalarType type) {
    auto [lo, hi] = limits_of(type);
    if (is_float(type)) lo = -3, hi = 1000;
    return make_volume(dims, type, [lo = lo, hi = hi](auto x, auto y, auto z) {
        return lo + (hi - lo) * scene(double(x), double(y), double(z), 7);
    });
}

class EveryCoder : public ::testing::TestWithParam<CoderKind> {};
INSTANTIATE_TEST_SUITE_P(Coders, EveryCoder, ::testing::Values(CoderKind::paper, CoderKind::dense, CoderKind::fast),
                         [](const auto& test) { return std::string(name_of(test.param)); });

TEST_P(EveryCoder, LosslessGivesEveryBitBackForEveryTypeAndOddSizes) {
    for (int t = 0; t < kScalarTypes; ++t)
        for (Index3 dims : {Index3(1), Index3(2, 1, 1), Index3(1, 17, 33), Index3(15, 16, 31), Index3(35, 18, 20)}) {
            const VolumePtr volume = scene_volume(dims, ScalarType(t));
            const auto bricks = encoded(*volume, lossless(GetParam()));
            ASSERT_EQ(decoded(bricks), all_of(*volume)) << name_of(ScalarType(t)) << " " << dims.x << " " << dims.y << " " << dims.z;
        }
}

TEST_P(EveryCoder, LosslessSurvivesNoiseStepsCheckerboardsAndImpulses) {
    std::mt19937 random(1);
    const auto extremes = [&](auto f) {
        for (ScalarType type : {ScalarType::u8, ScalarType::i16, ScalarType::u16, ScalarType::i32, ScalarType::u32}) {
            const auto [lo, hi] = limits_of(type);
            const VolumePtr volume = make_volume({19, 20, 21}, type, [&, lo = lo, hi = hi](auto x, auto y, auto z) {
                return f(x, y, z) ? hi : lo;
            });
            ASSERT_EQ(decoded(encoded(*volume, lossless(GetParam()))), all_of(*volume)) << name_of(type);
        }
    };
    extremes([&](auto, auto, auto) { return random() % 2 == 0; });
    extremes([](auto x, auto, auto) { return x < 7; });
    extremes([](auto x, auto y, auto z) { return (x + y + z) % 2 == 0; });
    extremes([](auto x, auto y, auto z) { return x == 9 && y == 3 && z == 17; });
    extremes([](auto, auto, auto) { return true; });
}

TEST_P(EveryCoder, FloatsKeepNaNInfinitiesDenormalsAndBothZeros) {
    for (ScalarType type : {ScalarType::f32, ScalarType::f64}) {
        constexpr double kSpecial[] = {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
                                       -std::numeric_limits<double>::infinity(), 0.0, -0.0, 1e-40, 1e30, -1e-30};
        const VolumePtr volume = make_volume({20, 17, 18}, type, [&](auto x, auto y, auto z) {
            return (x * 5 + y * 3 + z) % 11 == 0 ? kSpecial[(x + y + z) % 8] : 100 * scene(double(x), double(y), double(z), 3);
        });
        const auto bricks = encoded(*volume, lossless(GetParam()));
        EXPECT_EQ(decoded(bricks), all_of(*volume)) << name_of(type);
        for (int l = 1; l < int(bricks->desc().levels.size()); ++l)
            for (double v : numbers(decoded(bricks, l), type)) ASSERT_TRUE(std::isfinite(v));
        const auto lossy = encoded(*volume, aiming(Target::max_error, 1e27, GetParam()));
        const auto before = numbers(all_of(*volume), type), after = numbers(decoded(lossy), type);
        for (std::size_t i = 0; i < before.size(); ++i)
            if (!std::isfinite(before[i])) {
                ASSERT_TRUE(std::isnan(before[i]) ? std::isnan(after[i]) : before[i] == after[i]);
            }
    }
}

TEST_P(EveryCoder, ComponentsStayApart) {
    VolumeDesc desc;
    desc.dims = {18, 17, 9};
    desc.components = 3;
    desc.type = ScalarType::u8;
    Buffer voxels(desc.dense_bytes());
    for (std::size_t i = 0; i < voxels.size(); ++i) voxels.data()[i] = std::byte(i % 3 * 80 + i / 50 % 20);
    const DenseVolume volume(desc, std::move(voxels));
    EXPECT_EQ(decoded(encoded(volume, lossless(GetParam()))), all_of(volume));
}

TEST_P(EveryCoder, AHardBoundHoldsForEveryVoxel) {
    for (ScalarType type : {ScalarType::u8, ScalarType::i16, ScalarType::f32})
        for (double bound : {0.5, 3.0, 40.0}) {
            const VolumePtr volume = scene_volume({40, 33, 21}, type);
            EncodeReport report;
            const auto bricks = encoded(*volume, aiming(Target::max_error, bound, GetParam()), &report);
            const auto before = numbers(all_of(*volume), type), after = numbers(decoded(bricks), type);
            double largest = 0;
            for (std::size_t i = 0; i < before.size(); ++i) largest = std::max(largest, std::abs(before[i] - after[i]));
            EXPECT_LE(largest, bound) << name_of(type);
            EXPECT_EQ(largest, report.max_error);
        }
}

TEST_P(EveryCoder, ThePaperThresholdIsLosslessAtZeroAndErrsMoreTheLargerItIs) {
    const VolumePtr volume = scene_volume({40, 33, 21}, ScalarType::u8);
    double last = -1;
    std::uint64_t last_bytes = ~0ull;
    for (double threshold : {0.0, 2.0, 6.0, 20.0, 80.0}) {
        EncodeReport report;
        const auto bricks = encoded(*volume, aiming(Target::threshold, threshold, GetParam()), &report);
        if (threshold == 0) {
            EXPECT_EQ(report.max_error, 0);
        }
        EXPECT_GE(report.rmse, last);
        EXPECT_LE(bricks->desc().compressed_bytes, last_bytes);
        last = report.rmse;
        last_bytes = bricks->desc().compressed_bytes;
    }
    EXPECT_GT(last, 1);
}

TEST(WaveletCodec, AskedForDecibelsAreMet) {
    for (ScalarType type : {ScalarType::u8, ScalarType::i16, ScalarType::f32})
        for (double psnr : {35.0, 45.0, 60.0}) {
            const VolumePtr volume = scene_volume({64, 50, 40}, type);
            EncodeReport report;
            const auto bricks = encoded(*volume, aiming(Target::psnr, psnr), &report);
            EXPECT_GE(report.psnr, psnr) << name_of(type);
            if (std::isfinite(report.psnr)) {
                EXPECT_LE(report.psnr, psnr + 0.5) << name_of(type);
            }
            double squares = 0;
            const auto before = numbers(all_of(*volume), type), after = numbers(decoded(bricks), type);
            for (std::size_t i = 0; i < before.size(); ++i) squares += (before[i] - after[i]) * (before[i] - after[i]);
            const double rmse = std::sqrt(squares / double(before.size()));
            EXPECT_NEAR(rmse, report.rmse, 1e-9 * rmse);
        }
}

TEST(WaveletCodec, BudgetsAreKept) {
    const VolumePtr volume = scene_volume({64, 64, 64}, ScalarType::i16);
    EncodeReport report;
    for (double bpv : {1.0, 3.0}) {
        const auto bricks = encoded(*volume, aiming(Target::bpv, bpv), &report);
        EXPECT_LE(8.0 * double(bricks->desc().compressed_bytes) / 262144, bpv);
        EXPECT_GE(report.bits_per_voxel, 0.93 * bpv);
    }
    const auto bricks = encoded(*volume, aiming(Target::ratio, 20), &report);
    EXPECT_LE(bricks->desc().compressed_bytes * 20, volume->desc().dense_bytes());
}

TEST(WaveletCodec, AConstantVolumeIsExactAndStoresNoFamily) {
    const VolumePtr volume = make_volume({70, 40, 33}, ScalarType::u16, [](auto, auto, auto) { return 777.0; });
    EncodeReport report;
    const auto bricks = encoded(*volume, lossless(), &report);
    EXPECT_EQ(decoded(bricks), all_of(*volume));
    EXPECT_EQ(report.empty_families, report.families - 1);  // the root holds the value
    for (int l = 0; l < int(bricks->desc().levels.size()); ++l)
        EXPECT_EQ(bricks->info({l, glm::ivec3(0)}).range, (ValueRange{777, 777}));
}

TEST(WaveletCodec, ThreadsDoNotChangeTheBytes) {
    const VolumePtr volume = scene_volume({70, 50, 60}, ScalarType::i16);
    std::vector<Bytes> files;
    for (std::size_t threads : {1, 2, 5}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        const auto bricks = encoded(*volume, aiming(Target::psnr, 45));
        Bytes file = head_of(bricks->index(), bricks->payload().size());
        file.insert(file.end(), bricks->payload().begin(), bricks->payload().end());
        files.push_back(std::move(file));
    }
    EXPECT_TRUE(files[0] == files[1] && files[1] == files[2]);
}

TEST(WaveletCodec, ErrorsOfCoarseLevelsAreThoseOfInterpolatingThem) {
    // Along x alone, so that a plain loop can tell the truth.
    const VolumePtr volume = make_volume({64, 1, 1}, ScalarType::i16, [](auto x, auto, auto) {
        return 200 * std::sin(double(x) / 3) + (x > 40 ? 500 : 0);
    });
    const auto bricks = encoded(*volume, lossless());
    const auto fine = numbers(all_of(*volume), ScalarType::i16);
    for (int l = 1; l < int(bricks->desc().levels.size()); ++l) {
        const auto coarse = numbers(decoded(bricks, l), ScalarType::i16);
        const std::int64_t stride = bricks->desc().levels[std::size_t(l)].stride.x;
        for (int b = 0; b < bricks->desc().levels[std::size_t(l)].bricks.x; ++b) {
            const Box box = bricks->desc().fine_box_of({l, {b, 0, 0}});
            double squares = 0, largest = 0;
            for (std::int64_t x = box.lo.x; x < box.hi.x; ++x) {
                const auto i = std::size_t(x / stride);
                const double f = i + 1 < coarse.size() ? double(x % stride) / double(stride) : 0;
                const double v = f > 0 ? coarse[i] * (1 - f) + coarse[i + 1] * f : coarse[i];
                const double e = std::abs(v - fine[std::size_t(x)]);
                squares += e * e;
                largest = std::max(largest, e);
            }
            const BrickInfo info = bricks->info({l, {b, 0, 0}});
            EXPECT_NEAR(info.l2, std::sqrt(squares), 1e-9);
            EXPECT_NEAR(info.max_error, largest, 1e-9);
            EXPECT_TRUE(info.exact_error);
        }
    }
}

TEST(WaveletCodec, RangesHoldTheBrickAndItsNeighboursFirstVoxels) {
    const VolumePtr volume = scene_volume({40, 33, 21}, ScalarType::i16);
    const auto bricks = encoded(*volume, aiming(Target::psnr, 40));
    for (int l = 0; l < int(bricks->desc().levels.size()); ++l) {
        const auto values = numbers(decoded(bricks, l), ScalarType::i16);
        const LevelDesc& level = bricks->desc().levels[std::size_t(l)];
        for (int z = 0; z < level.bricks.z; ++z)
            for (int y = 0; y < level.bricks.y; ++y)
                for (int x = 0; x < level.bricks.x; ++x) {
                    const Box own = bricks->desc().box_of({l, {x, y, z}});
                    const Box box{glm::max(own.lo - Index3(1), Index3(0)), glm::min(own.hi + Index3(1), level.dims)};
                    double lo = 1e9, hi = -1e9;
                    for (auto k = box.lo.z; k < box.hi.z; ++k)
                        for (auto j = box.lo.y; j < box.hi.y; ++j)
                            for (auto i = box.lo.x; i < box.hi.x; ++i) {
                                const double v = values[std::size_t((k * level.dims.y + j) * level.dims.x + i)];
                                lo = std::min(lo, v);
                                hi = std::max(hi, v);
                            }
                    EXPECT_EQ(bricks->info({l, {x, y, z}}).range, (ValueRange{lo, hi})) << l << ": " << x << " " << y << " " << z;
                }
    }
}

TEST(WaveletCodec, OneBrickNeedsItsAncestorsAlone) {
    // Damage everything but the ancestors' families: the brick is the same.
    const VolumePtr volume = scene_volume({70, 50, 60}, ScalarType::i16);
    const auto bricks = encoded(*volume, lossless());
    const BrickId wanted{0, {5, 3, 2}};
    Bytes file = head_of(bricks->index(), bricks->payload().size());
    const std::size_t head = file.size();
    file.resize(head + bricks->payload().size(), std::byte(0x55));
    for (std::optional<BrickId> id = wanted; id; id = bricks->desc().coarser(*id)) {
        const FamilyId family = family_of(bricks->index().tree, *id);
        const glm::ivec3 grid = families_of(bricks->index().tree, family.level);
        const FamilyPlace place = bricks->index().families[std::size_t(family.level)]
            [std::size_t((family.index.z * grid.y + family.index.y) * grid.x + family.index.x)];
        std::memcpy(file.data() + head + place.offset, bricks->payload().data() + place.offset, place.size);
    }
    const BricksPtr damaged = open_bytes(file, nullptr, "damaged");
    BrickCache cache(64 << 20);
    const auto a = cache.get(bricks, wanted), b = cache.get(damaged, wanted);
    ASSERT_EQ(a->voxels.size(), b->voxels.size());
    EXPECT_EQ(std::memcmp(a->voxels.data(), b->voxels.data(), a->voxels.size()), 0);
    EXPECT_THROW(cache.get(damaged, {0, {0, 0, 7}}), Error);
}

TEST(WaveletCodec, CancellingEndsTheWork) {
    const VolumePtr volume = scene_volume({64, 64, 64}, ScalarType::i16);
    std::stop_source stop;
    stop.request_stop();
    EncodeReport report;
    EXPECT_THROW(encode(*volume, aiming(Target::psnr, 50), report, stop.get_token()), Cancelled);
}

TEST(WaveletCodec, EmptyVolumesPass) {
    const VolumePtr volume = make_volume({0, 4, 4}, ScalarType::u8, [](auto, auto, auto) { return 0.0; });
    for (Target target : {Target::lossless, Target::psnr, Target::bpv})
        EXPECT_EQ(encoded(*volume, aiming(target, 40))->desc().volume.voxels(), 0u);
}

// --- files ---

class WaveletFile : public ::testing::Test {
  protected:
    std::filesystem::path path() const { return folder_.path() / "a.vxw"; }
    static Bytes bytes_of_file(const std::filesystem::path& path) {
        std::ifstream in(path, std::ios::binary);
        std::string text((std::istreambuf_iterator<char>(in)), {});
        const auto bytes = std::as_bytes(std::span(text));
        return {bytes.begin(), bytes.end()};
    }
    voxloom::testing::TempFolder folder_;
};

TEST_F(WaveletFile, ComesBackAsItWasWritten) {
    VolumeDesc desc = scene_volume({40, 33, 21}, ScalarType::i16)->desc();
    const VolumePtr plain = scene_volume({40, 33, 21}, ScalarType::i16);
    desc.name = "density";
    desc.unit = "mm";
    desc.significant_bits = 12;
    desc.index_to_world[3] = glm::dvec4(1, 2, 3, 1);
    Buffer voxels(desc.dense_bytes());
    plain->read(Box::of(desc.dims), voxels.bytes(), {});
    const DenseVolume volume(desc, std::move(voxels));
    const auto made = encoded(volume, aiming(Target::psnr, 45));
    write_file(*made, path());
    EXPECT_EQ(std::filesystem::file_size(path()), made->desc().compressed_bytes);
    const auto opened = open_file(path());
    EXPECT_EQ(opened->desc().volume.name, "density");
    EXPECT_EQ(opened->desc().volume.unit, "mm");
    EXPECT_EQ(opened->desc().volume.significant_bits, 12);
    EXPECT_EQ(opened->desc().volume.index_to_world, desc.index_to_world);
    EXPECT_EQ(opened->index().tree.provenance, made->index().tree.provenance);
    const double outward = made->index().tree.quantiser.step * made->index().tree.map.step / 8;
    for (int l = 0; l < int(made->desc().levels.size()); ++l) {
        EXPECT_EQ(decoded(opened, l), decoded(made, l));
        for (std::size_t i = 0; i < made->index().infos[std::size_t(l)].size(); ++i) {
            const BrickInfo a = made->index().info(l, i), b = opened->index().info(l, i);
            EXPECT_LE(b.range.min, a.range.min);
            EXPECT_GE(b.range.max, a.range.max);
            EXPECT_NEAR(a.range.min, b.range.min, outward);
            EXPECT_NEAR(a.range.max, b.range.max, outward);
            EXPECT_EQ(a.compressed_bytes, b.compressed_bytes);
            EXPECT_NEAR(a.l2, b.l2, 0.022 * a.l2);
            EXPECT_GE(b.max_error * (1 + 1e-12), a.max_error);
            EXPECT_NEAR(a.max_error, b.max_error, 0.045 * a.max_error);
            for (std::size_t o = 0; o < 8; ++o) EXPECT_NEAR(a.octant_l2[o], b.octant_l2[o], 0.04 * a.l2);
        }
    }
}

TEST_F(WaveletFile, EveryFlippedBitAndEveryTruncationIsFoundOrHarmless) {
    const VolumePtr volume = scene_volume({17, 9, 12}, ScalarType::u8);
    for (CoderKind coder : {CoderKind::paper, CoderKind::dense, CoderKind::fast}) {
        const auto made = encoded(*volume, aiming(Target::psnr, 30, coder));
        write_file(*made, path());
        const Bytes file = bytes_of_file(path());
        const auto whole = decoded(made);
        const auto harmless_or_found = [&](const Bytes& bytes) {
            try {
                EXPECT_EQ(decoded(open_bytes(bytes, nullptr, "a.vxw")), whole);
            } catch (const Error& e) {
                EXPECT_THAT(e.what(), ::testing::AnyOf(::testing::HasSubstr("a.vxw"), ::testing::HasSubstr("brick")));
            }
        };
        for (std::size_t i = 0; i < file.size(); ++i)
            for (int bit = 0; bit < 8; ++bit) {
                Bytes damaged = file;
                damaged[i] ^= std::byte(1 << bit);
                harmless_or_found(damaged);
            }
        for (std::size_t n = 0; n < file.size(); ++n) EXPECT_THROW(open_bytes(std::span(file).first(n), nullptr, "a.vxw"), Error);
    }
}

TEST_F(WaveletFile, AFailedWriteLeavesTheOldFile) {
    const VolumePtr volume = scene_volume({40, 33, 21}, ScalarType::u8);
    const auto made = encoded(*volume, lossless());
    write_file(*made, path());
    const Bytes before = bytes_of_file(path());
    std::stop_source stop;
    stop.request_stop();
    EXPECT_THROW(write_file(*encoded(*volume, aiming(Target::psnr, 30)), path(), stop.get_token()), Cancelled);
    EXPECT_EQ(bytes_of_file(path()), before);
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_.path()), {}), 1);
}

// Files of every version stay readable: what each wrote is kept in golden/. Set VOXLOOM_WRITE_GOLDEN to
// write those of the version of today.
TEST_F(WaveletFile, GoldenFilesOfEachVersionStayReadable) {
    const auto value = [](auto x, auto y, auto z) { return double((x * x + 3 * y + x * z) % 97 + (x > 8 ? 60 : 0)); };
    for (CoderKind coder : {CoderKind::paper, CoderKind::dense, CoderKind::blocks, CoderKind::fast})
        for (ScalarType type : {ScalarType::u8, ScalarType::i32, ScalarType::f32}) {
            const VolumePtr volume = make_volume({21, 9, 12}, type, value, {1, 1, 1.6});
            for (const std::string version : {"v1", "v2", "v4"}) {
                if (coder == CoderKind::fast && version != "v4") continue;  // blocks was in its place
                const std::filesystem::path golden = std::filesystem::path(VOXLOOM_SOURCE_DIR) / "plugins/codec-wavelet/golden" /
                    fmt::format("{}-{}-{}.vxw", version, name_of(coder), voxloom::name_of(type));
                if (std::getenv("VOXLOOM_WRITE_GOLDEN") && coder != CoderKind::blocks && version == fmt::format("v{}", kWaveletFile.version)) {
                    EncodeOptions options = lossless(coder);
                    options.faces = Faces::shared;
                    write_file(*encoded(*volume, options), golden);
                }
                EXPECT_EQ(decoded(open_file(golden)), all_of(*volume)) << golden;
            }
        }
}

// --- coders ---

// Details of `shape` whose numbers f gives, coded and decoded by coders that know the same tables.
void expect_round_trip(CoderKind kind, Shape shape, const std::function<std::int32_t(std::size_t)>& f, bool train = true) {
    std::vector<std::int32_t> q(shape.voxels()), low(shape.voxels(), 5), back(shape.voxels(), 99);
    for (std::size_t i = 0; i < q.size(); ++i) q[i] = f(i);
    Details d;
    d.shape = shape;
    d.q = q.data();
    d.low = low.data();
    auto coder = make_coder(kind);
    if (train) coder->train(d);
    coder->finish_training();
    Bytes bytes;
    coder->encode(d, bytes);
    EXPECT_EQ(all_zero(d), bytes.empty());
    Details e = d;
    e.q = back.data();
    make_coder(kind, coder->tables())->decode(bytes, e);
    for (int mask : kBandOrder) {
        const Band b = shape.band(mask);
        for (int z = 0; z < b.dims.z; ++z)
            for (int y = 0; y < b.dims.y; ++y)
                for (int x = 0; x < b.dims.x; ++x) {
                    const std::size_t at = shape.at(b.lo + glm::ivec3(x, y, z));
                    ASSERT_EQ(back[at], q[at]) << "band " << mask;
                }
    }
}

TEST_P(EveryCoder, RoundTripsRunsAlternationsLargeNumbersAndEmptyDetails) {
    const glm::bvec3 all(true);
    for (Shape shape : {Shape{{8, 8, 8}, all}, Shape{{9, 5, 7}, all}, Shape{{32, 32, 32}, all}, Shape{{16, 16, 1}, {true, true, false}},
                        Shape{{2, 1, 1}, all}}) {
        expect_round_trip(GetParam(), shape, [](auto) { return 0; });
        expect_round_trip(GetParam(), shape, [](auto i) { return std::int32_t(i % 2); });
        expect_round_trip(GetParam(), shape, [](auto i) { return i % 3 ? -1000000000 : 1000000000; });
        for (std::size_t run : {1, 127, 128, 129, 256})
            expect_round_trip(GetParam(), shape, [run](auto i) { return i % (run + 1) == run ? -3 : 0; });
        std::mt19937 random(4);
        expect_round_trip(GetParam(), shape, [&](auto) { return std::int32_t(random()) >> (2 + random() % 30); }, false);
    }
}

TEST(PaperCoder, WritesTheCodeOfThePaper) {
    // One axis halved, two details: 2 -> v = 3 (11): 11 0 1; -1 -> v = 2 (10): 11 0 0.
    std::vector<std::int32_t> q = {7, 7, 2, -1};
    Details d;
    d.shape = {{4, 1, 1}, {true, false, false}};
    d.q = q.data();
    Bytes bytes;
    make_coder(CoderKind::paper)->encode(d, bytes);
    EXPECT_EQ(bytes, (Bytes{std::byte(0b11011100)}));
    // A zero before: 0 and seven bits of run - 1; then 1 -> v = 1: 1 0, and padding.
    q = {7, 7, 0, 1};
    bytes.clear();
    make_coder(CoderKind::paper)->encode(d, bytes);
    EXPECT_EQ(bytes, (Bytes{std::byte(0), std::byte(0b10111111)}));
}

TEST(DenseCoder, TrainingMakesFamiliesSmaller) {
    std::mt19937 random(4);
    const Shape shape{{32, 32, 32}, glm::bvec3(true)};
    std::vector<std::int32_t> q(shape.voxels()), low(shape.voxels(), 5);
    for (auto& v : q) v = random() % 7 == 0 ? std::int32_t(random() % 5) - 2 : 0;
    Details d;
    d.shape = shape;
    d.q = q.data();
    d.low = low.data();
    Bytes untrained, trained;
    make_coder(CoderKind::dense)->encode(d, untrained);
    auto coder = make_coder(CoderKind::dense);
    coder->train(d);
    coder->finish_training();
    coder->encode(d, trained);
    EXPECT_LT(trained.size(), untrained.size());
}

TEST(BandNorms, AreThoseOfTheTable) {
    const glm::bvec3 all(true);
    EXPECT_NEAR(band_norm(1, glm::ivec3(1), all), 1.2717, 1e-4);
    EXPECT_NEAR(band_norm(3, glm::ivec3(1), all), 0.8803, 1e-4);
    EXPECT_NEAR(band_norm(7, glm::ivec3(1), all), 0.6093, 1e-4);
    EXPECT_NEAR(band_norm(1, glm::ivec3(8), all), 18.643, 1e-3);
    EXPECT_NEAR(band_norm(7, glm::ivec3(16), all), 14.776, 1e-3);
    EXPECT_NEAR(band_norm(1, glm::ivec3(1), {true, false, false}), std::sqrt(23.0 / 32), 1e-12);
}

}  // namespace
}  // namespace voxloom::wavelet
