// Volumes in, voxels out: what is exact, what is bounded, what is counted, what is refused.
#include <gmock/gmock.h>
#include <tbb/global_control.h>

#include <numeric>
#include <tuple>

#include "plugins/codec-vq/block.h"
#include "plugins/codec-vq/survey.h"
#include "plugins/codec-vq/test_volumes.h"

namespace voxloom::vq {
namespace {

using ::testing::HasSubstr;

constexpr Loop kLoops[] = {Loop::closed, Loop::open};

// --- blocks ---

TEST(Blocks, InOpenLoopDifferencesAddUpToNothing) {
    std::mt19937 random(1);
    for (int round = 0; round < 20; ++round) {
        Block<std::int16_t> values;
        for (auto& v : values) v = std::int16_t(random());
        std::array<float, kVoxels> d;
        mean_and_differences(values, 1.0, false, d.data());
        auto octants = octant_means(d.data());
        EXPECT_NEAR(std::accumulate(octants.begin(), octants.end(), 0.0), 0, 0.05);
        take_octants_off(octants.data(), d.data());
        for (const float left : octant_means(d.data())) EXPECT_NEAR(left, 0, 0.01);
    }
}

TEST(Blocks, MeansOfTheLargestNumbersAreWithinThem) {
    constexpr double huge = std::numeric_limits<double>::max(), tiny = std::numeric_limits<double>::denorm_min();
    for (const auto& [a, b] : {std::pair(-huge, huge), {huge, -huge}, {huge, huge}, {0.0, tiny}, {-tiny, tiny}, {1e30, 1e30 * (1 + 1e-15)}}) {
        const double unit = unit_for(ScalarType::f64, {std::min(a, b), std::max(a, b)});
        EXPECT_GT(unit, 0);
        EXPECT_TRUE(std::isfinite(unit));
        Block<double> values;
        for (std::size_t i = 0; i < kVoxels; ++i) values[i] = i % 3 ? a : b;
        std::array<float, kVoxels> d;
        const double mean = mean_and_differences(values, unit, true, d.data());
        EXPECT_GE(mean, std::min(a, b));
        EXPECT_LE(mean, std::max(a, b));
        for (const float difference : d) EXPECT_LE(std::abs(difference), 4);
    }
}

// --- exact ---

TEST(Codec, ConstantsAreExactAndTakeTheFirstCodeword) {
    for (int t = 0; t < kScalarTypes; ++t)
        for (const Loop loop : kLoops)
            for (const Index3 dims : {Index3(1, 1, 1), Index3(20, 9, 5)}) {
                const auto type = ScalarType(t);
                for (const double value : {77.0, limits_of(type).second, limits_of(type).first, 0.1, 1e-310}) {
                    const VolumePtr volume = volume_of(dims, type, 2, [&](Index3, int) { return value; });
                    const Encoded e = encoded(*volume, small(16, loop));
                    EXPECT_EQ(decoded(e.bricks), bytes_of_volume(*volume));
                    EXPECT_EQ(e.report.max_error, 0);
                    for (const Codebooks& books : e.bricks->index().books) {
                        EXPECT_EQ(books.octants.count(), 1);
                        EXPECT_EQ(books.voxels.count(), 1);
                    }
                }
            }
}

TEST(Codec, AsManyBlocksAsCodewordsAreExact) {
    for (int t = 0; t < kScalarTypes; ++t) {
        const auto type = ScalarType(t);
        auto [low, high] = limits_of(type);
        if (type == ScalarType::f64) std::tie(low, high) = std::pair(-1e300, 1e300);
        if (bytes_of(type) == 4) std::tie(low, high) = std::pair(type == ScalarType::u32 ? 0.0 : -65535.0, 65535.0);
        // A checkerboard, in three of its kinds.
        for (const int side : {1, 2, 4}) {
            const VolumePtr volume = volume_of({16, 12, 8}, type, 1, [&](Index3 i, int) {
                return (i.x / side + i.y / side + i.z / side) % 2 ? high : low;
            });
            const Encoded e = encoded(*volume, small(2));
            const auto before = numbers(bytes_of_volume(*volume), type), after = numbers(decoded(e.bricks), type);
            const double allowed = is_float(type) ? 1e-6 * high : 0;
            for (std::size_t i = 0; i < before.size(); ++i) ASSERT_LE(std::abs(before[i] - after[i]), allowed) << name_of(type) << " " << side;
        }
    }
}

TEST(Codec, AnImpulseIsExact) {
    for (const Index3 at : {Index3(0, 0, 0), Index3(6, 4, 4), Index3(3, 1, 2)}) {
        const VolumePtr volume = volume_of({7, 5, 5}, ScalarType::u16, 1, [&](Index3 i, int) { return i == at ? 65535.0 : 0.0; });
        EXPECT_EQ(decoded(encoded(*volume, small(16, Loop::closed)).bricks), bytes_of_volume(*volume));
    }
}

// --- bounded ---

TEST(Codec, EveryTypeSizeAndComponentIsDecodedNearWhatItWas) {
    for (int t = 0; t < kScalarTypes; ++t)
        for (const Loop loop : kLoops)
            for (const Index3 dims : {Index3(1, 7, 5), Index3(13, 1, 2), Index3(17, 11, 9), Index3(31, 2, 1)})
                for (int components = 1; components <= 4; components += t % 3 + 1) {
                    const auto type = ScalarType(t);
                    const VolumePtr volume = scene(dims, type, components);
                    EncodeOptions options = small(64, loop);
                    options.sweeps = 2;
                    const Encoded e = encoded(*volume, options);
                    const auto before = numbers(bytes_of_volume(*volume), type), after = numbers(decoded(e.bricks), type);
                    ASSERT_EQ(before.size(), after.size());
                    double squares = 0, largest = 0;
                    for (std::size_t i = 0; i < before.size(); ++i) {
                        squares += (before[i] - after[i]) * (before[i] - after[i]);
                        largest = std::max(largest, std::abs(before[i] - after[i]));
                    }
                    EXPECT_EQ(largest, e.report.max_error);
                    EXPECT_NEAR(e.report.rmse, std::sqrt(squares / double(before.size())), 1e-9 * (1 + e.report.rmse));
                    const double noise = bytes_of(type) == 1 ? 2 : 64;
                    EXPECT_LT(e.report.rmse, 2 * noise) << name_of(type) << " " << dims.x << " " << components;
                }
}

TEST(Codec, ComponentsDoNotDisturbEachOther) {
    const auto value = [](Index3 i, int c) { return 100 * c + double((i.x * 7 + i.y * (c + 3) + i.z * i.x) % 50); };
    const VolumePtr both = volume_of({12, 9, 10}, ScalarType::u8, 2, value);
    const auto together = numbers(decoded(encoded(*both, small()).bricks), ScalarType::u8);
    for (int c = 0; c < 2; ++c) {
        const VolumePtr one = volume_of({12, 9, 10}, ScalarType::u8, 1, [&](Index3 i, int) { return value(i, c); });
        const auto alone = numbers(decoded(encoded(*one, small()).bricks), ScalarType::u8);
        // But for the limits of a brick, which hold for all of its components.
        for (std::size_t i = 0; i < alone.size(); ++i) EXPECT_NEAR(together[2 * i + std::size_t(c)], alone[i], 3);
    }
}

TEST(Codec, ClosedLoopIsNoWorseThanOpenLoop) {
    for (const ScalarType type : {ScalarType::u8, ScalarType::i16, ScalarType::f32})
        for (const int codewords : {8, 32, 128}) {
            const VolumePtr volume = scene({48, 40, 32}, type);
            const double closed = encoded(*volume, small(codewords, Loop::closed, 16)).report.rmse;
            const double open = encoded(*volume, small(codewords, Loop::open, 16)).report.rmse;
            EXPECT_LT(closed, open) << name_of(type) << " " << codewords;
        }
}

TEST(Codec, OpenLoopCodewordsInheritThatDifferencesAddUpToNothing) {
    const Encoded e = encoded(*scene({48, 40, 32}, ScalarType::f32), small(64, Loop::open, 16));
    const Codebooks& books = e.bricks->index().books[0];
    double largest = 0;
    for (int w = 0; w < 64; ++w) {
        double sum = 0;
        for (const float v : books.octants.word(w)) {
            sum += double(v);
            largest = std::max(largest, double(std::abs(v)));
        }
        EXPECT_NEAR(sum, 0, 1e-5);
        for (const float mean : octant_means(books.voxels.word(w).data())) EXPECT_NEAR(mean, 0, 1e-6);
    }
    EXPECT_GT(largest, 0.05);
}

TEST(Codec, MoreCodewordsAndMacroblocksDoBetter) {
    const VolumePtr volume = scene({48, 40, 32});
    double last = 1e300;
    for (const int codewords : {2, 8, 32, 128}) {
        const double rmse = encoded(*volume, small(codewords)).report.rmse;
        EXPECT_LT(rmse, last);
        last = rmse;
    }
    EncodeOptions options = small(32);
    const double one = encoded(*volume, options).report.rmse;
    options.macroblocks = {3, 2, 2};
    const Encoded many = encoded(*volume, options);
    EXPECT_EQ(many.bricks->index().books.size(), 12u);
    EXPECT_LT(many.report.rmse, one);
    options.macroblocks = {64, 64, 64};  // one for each brick, and no more
    EXPECT_EQ(encoded(*volume, options).bricks->index().books.size(), many.bricks->index().bricks.places.size());
}

TEST(Codec, ASampleOfTheBlocksDoes) {
    const VolumePtr volume = scene({48, 48, 48});
    EncodeOptions options = small(16);
    const double all = encoded(*volume, options).report.rmse;
    options.sample = 300;
    const Encoded some = encoded(*volume, options);
    EXPECT_EQ(some.report.sampled, 300u);
    EXPECT_LT(some.report.rmse, 1.2 * all);
    options.seed = 2;
    EXPECT_NE(encoded(*volume, options).bricks->index().books[0].voxels.words, some.bricks->index().books[0].voxels.words);
}

// --- what is not finite, and what is hardly so ---

TEST(Codec, KeepsBlocksWithSomethingNotFinite) {
    for (const ScalarType type : {ScalarType::f32, ScalarType::f64}) {
        const VolumePtr volume = volume_of({11, 9, 7}, type, 2, [](Index3 i, int c) {
            constexpr double odd[] = {NAN, INFINITY, -INFINITY, 1e-42, -0.0, 1e30};
            return i.z == 0 && i.y == 8 && i.x < 6 && c == 1 ? odd[i.x] : std::sin(double(i.x + i.y)) + 2 * c;
        });
        const Encoded e = encoded(*volume, small());
        EXPECT_EQ(e.report.raw_blocks, 2u) << "of those with NaN, and with 1e30";
        const auto before = numbers(bytes_of_volume(*volume), type), after = numbers(decoded(e.bricks), type);
        for (std::int64_t z = 0; z < 4; ++z)
            for (std::int64_t x = 0; x < 4; ++x) {
                const auto at = std::size_t(2 * ((z * 9 + 8) * 11 + x) + 1);
                EXPECT_TRUE(std::isnan(before[at]) ? std::isnan(after[at]) : before[at] == after[at]);
            }
        for (std::size_t i = 0; i < after.size(); ++i) EXPECT_EQ(std::isfinite(after[i]), std::isfinite(before[i]));
        const VolumePtr nothing = volume_of({5, 4, 3}, type, 1, [](Index3 i, int) { return i.x % 2 ? NAN : INFINITY; });
        const Encoded none = encoded(*nothing, small());
        for (const double v : numbers(decoded(none.bricks), type)) EXPECT_FALSE(std::isfinite(v));
        EXPECT_EQ(none.bricks->info({}).range, ValueRange{});
    }
}

TEST(Codec, AFewHugeVoxelsDoNotHarmTheOthers) {
    for (const double huge : {0.0, 1e10, 1e20, 1e22, 1e30, -3e38}) {
        const VolumePtr volume = volume_of({32, 32, 32}, ScalarType::f32, 1, [&](Index3 i, int) {
            if (huge != 0 && i == Index3(9, 9, 9)) return huge;
            return std::sin(0.3 * double(i.x)) + std::cos(0.2 * double(i.y)) + std::sin(0.25 * double(i.z));
        });
        const Encoded e = encoded(*volume, small(128, Loop::closed));
        const auto before = numbers(bytes_of_volume(*volume), ScalarType::f32), after = numbers(decoded(e.bricks), ScalarType::f32);
        double squares = 0;
        for (std::size_t i = 0; i < before.size(); ++i) {
            const std::size_t x = i % 32, y = i / 32 % 32, z = i / 1024;
            if (x / 4 == 2 && y / 4 == 2 && z / 4 == 2) continue;  // the block that it is in
            squares += std::pow(before[i] - after[i], 2);
        }
        EXPECT_LT(std::sqrt(squares / double(before.size())), 0.08) << huge;
        EXPECT_GT(e.report.distortion, 0.01) << huge;
    }
}

TEST(Codec, TheDistortionOfAWholeSampleIsTheErrorInBothLoops) {
    for (const Loop loop : kLoops) {
        const VolumePtr volume = scene({40, 36, 28}, ScalarType::f32);
        const Encoded e = encoded(*volume, small(32, loop));
        EXPECT_NEAR(e.report.distortion / e.report.rmse, 1, 0.03);
    }
}

TEST(Codec, HugeAndTinyNumbersSurvive) {
    constexpr double huge = 1e308, denormal = 1e-310;
    for (const double scale : {huge, denormal, 5e-324, 1e-30, 1e30}) {
        const VolumePtr volume = volume_of({16, 8, 8}, ScalarType::f64, 1, [&](Index3 i, int) {
            return scale * std::sin(0.3 * double(i.x) + 0.2 * double(i.y * i.z));
        });
        const Encoded e = encoded(*volume, small(64));
        const auto before = numbers(bytes_of_volume(*volume), ScalarType::f64), after = numbers(decoded(e.bricks), ScalarType::f64);
        double squares = 0;
        for (std::size_t i = 0; i < before.size(); ++i) {
            ASSERT_TRUE(std::isfinite(after[i]));
            const double error = after[i] / scale - before[i] / scale;
            squares += error * error;
        }
        EXPECT_LT(std::sqrt(squares / double(before.size())), scale < 1e-320 ? 1 : 0.2) << scale;
        EXPECT_NO_THROW(open_bytes(file_of(*e.bricks), nullptr, "a.vxq"));
    }
}

TEST(Codec, ValuesStayWithinTheBrick) {
    const VolumePtr volume = volume_of({32, 16, 16}, ScalarType::u8, 1, [](Index3 i, int) {
        return i.x < 16 ? 200 + double((i.x * i.y + i.z) % 55) : double((i.x * 5 + i.y * i.z) % 40);
    });
    const auto after = numbers(decoded(encoded(*volume, small(4, Loop::open, 16)).bricks), ScalarType::u8);
    for (std::size_t i = 0; i < after.size(); ++i) {
        if (i % 32 < 16) {
            EXPECT_GE(after[i], 200);
        } else {
            EXPECT_LT(after[i], 40);
        }
    }
}

// --- what is counted ---

TEST(Codec, TheRateIsThatOfTheFormula) {
    struct Case { ScalarType type; int codeword_bits; };
    for (const Case c : {Case{ScalarType::u8, 16}, {ScalarType::i16, 32}, {ScalarType::f32, 32}, {ScalarType::f64, 32}}) {
        std::mt19937 random(2);
        const VolumePtr volume = volume_of({64, 32, 32}, c.type, 1, [&](Index3, int) { return double(random() % 256) - 128; });
        EncodeOptions options = small(64, Loop::closed, 16);
        options.macroblocks = {2, 1, 1};
        options.sweeps = 2;
        const Encoded e = encoded(*volume, options);
        const double voxels = 64 * 32 * 32, bricks = 4 * 2 * 2, mean_bits = 8 * double(bytes_of(c.type));
        const double blocks = (mean_bits + 16) / 64;
        const double books = 2 * 63 * (8 + 64) * c.codeword_bits / voxels;  // the zero codeword is not stored
        const double brick = 8 * (2 * mean_bits / 8 + 1);                   // limits, and that no block is raw
        const double entry = 8 * (2 + 4 + 2 * mean_bits / 8 + 16);
        const double head = e.report.bits_per_voxel - blocks - books - bricks * (brick + entry) / voxels;
        EXPECT_GT(head, 0);
        EXPECT_LT(head * voxels / 8, 450);  // bytes
        EXPECT_EQ(8 * double(file_of(*e.bricks).size()) / voxels, e.report.bits_per_voxel);
    }
}

TEST(Codec, StatisticsAreThoseOfTheDecodedBricks) {
    const VolumePtr volume = scene({20, 17, 9});
    const Encoded e = encoded(*volume, small());
    const auto before = numbers(bytes_of_volume(*volume), ScalarType::i16), after = numbers(decoded(e.bricks), ScalarType::i16);
    const Index3 dims = volume->desc().dims;
    const BricksDesc& desc = e.bricks->desc();
    std::uint64_t bytes = 0;
    for (std::size_t b = 0; b < e.bricks->index().bricks.places.size(); ++b) {
        const BrickId id = brick_at(e.bricks->desc(), b);
        const BrickInfo info = e.bricks->info(id);
        const Box own = desc.box_of(id), around{glm::max(own.lo - Index3(1), Index3(0)), glm::min(own.hi + Index3(1), dims)};
        double squares = 0, largest = 0;
        ValueRange range{1e9, -1e9};
        for (auto z = around.lo.z; z < around.hi.z; ++z)
            for (auto y = around.lo.y; y < around.hi.y; ++y)
                for (auto x = around.lo.x; x < around.hi.x; ++x) {
                    const auto at = std::size_t((z * dims.y + y) * dims.x + x);
                    range = {std::min(range.min, after[at]), std::max(range.max, after[at])};
                    if (!own.contains({{x, y, z}, {x + 1, y + 1, z + 1}})) continue;
                    const double error = std::abs(before[at] - after[at]);
                    squares += error * error;
                    largest = std::max(largest, error);
                }
        EXPECT_EQ(info.range, range);
        EXPECT_NEAR(info.l2, std::sqrt(squares), 1e-9);
        EXPECT_EQ(info.max_error, largest);
        EXPECT_TRUE(info.exact_error);
        bytes += info.compressed_bytes;
    }
    EXPECT_EQ(bytes, e.bricks->payload().size());
    EXPECT_EQ(desc.levels.size(), 1u);
}

TEST(Codec, ThreadsDoNotChangeTheBytes) {
    const VolumePtr volume = scene({30, 20, 17}, ScalarType::u8, 2);
    EncodeOptions options = small(32);
    options.macroblocks = {2, 1, 1};
    options.sample = 90;
    std::vector<Bytes> files;
    for (const std::size_t threads : {1, 2, 5}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        files.push_back(file_of(*encoded(*volume, options).bricks));
    }
    EXPECT_TRUE(files[0] == files[1]);
    EXPECT_TRUE(files[0] == files[2]);
}

TEST(Codec, ProgressRisesToOne) {
    std::vector<double> seen;
    EncodeReport report;
    EncodeOptions options = small();
    options.macroblocks = {2, 2, 2};
    encode(*scene({40, 30, 20}), options, report, {}, [&](double fraction) { seen.push_back(fraction); });
    EXPECT_TRUE(std::ranges::is_sorted(seen));
    EXPECT_EQ(seen.back(), 1.0);
}

// Asked to stop at each of its steps.
TEST(Codec, CancellingEndsTheWork) {
    EncodeReport report;
    const VolumePtr volume = scene({40, 30, 20});
    int steps = 0;
    encode(*volume, small(), report, {}, [&](double) { ++steps; });
    for (int last = 0; last + 1 < steps; ++last) {
        std::stop_source stop;
        int step = 0;
        EXPECT_THROW(encode(*volume, small(), report, stop.get_token(), [&](double) {
            if (step++ == last) stop.request_stop();
        }), Cancelled);
    }
}

TEST(Codec, EmptyVolumesPass) {
    const VolumePtr volume = volume_of({0, 4, 4}, ScalarType::u8, 3, [](Index3, int) { return 0.0; });
    const Encoded e = encoded(*volume, small());
    EXPECT_EQ(e.bricks->desc().volume.voxels(), 0u);
    EXPECT_NO_THROW(open_bytes(file_of(*e.bricks), nullptr, "a.vxq"));
}

TEST(Codec, RefusesWhatCannotBeWithASentence) {
    const auto refusal = [](const VolumeDesc& volume, const EncodeOptions& options) -> std::string {
        try {
            plan(volume, options);
        } catch (const Error& e) {
            return e.what();
        }
        return "";
    };
    VolumeDesc masked = scene({8, 8, 8})->desc();
    masked.has_mask = true;
    EXPECT_THAT(refusal(masked, small()), HasSubstr("mask"));
    EXPECT_THAT(refusal(scene({8, 8, 8})->desc(), small(16, Loop::closed, 6)), HasSubstr("multiples of 4"));
    VolumeDesc large = scene({8, 8, 8})->desc();
    large.dims = {4096, 4096, 4096};
    EXPECT_THAT(refusal(large, small(16, Loop::closed, 4096)), HasSubstr("smaller bricks"));
}

}  // namespace
}  // namespace voxloom::vq
