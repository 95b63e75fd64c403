// What every codec must hold, whatever its method.
#include <gmock/gmock.h>
#include <tbb/global_control.h>

#include <limits>

#include "core/measure/volume_error.h"
#include "plugins/codec-baseline/test_volumes.h"

namespace voxloom::baseline {
namespace {

using ::testing::HasSubstr;

INSTANTIATE_TEST_SUITE_P(Codecs, EveryCodec, ::testing::ValuesIn(codecs()), name_of_instance);

// --- without loss ---

using Pattern = double (*)(Index3, const std::pair<double, double>& limits);
constexpr Pattern kPatterns[] = {
    [](Index3, auto&) { return 77.0; },
    [](Index3 i, auto& limits) { return i == Index3(0) ? limits.second : 0.0; },
    [](Index3 i, auto& limits) { return (i.x + i.y + i.z) % 2 ? limits.second : limits.first; },
    [](Index3 i, auto& limits) { return i.x < 3 ? std::max(limits.first, 0.0) : std::min(limits.second, 65535.0); },
    [](Index3 i, auto&) { return double(i.x * i.x % 31 + 5 * i.y + i.z); },
};

TEST_P(EveryCodec, GivesEveryBitBack) {
    for (int t = 0; t < kScalarTypes; ++t) {
        const auto type = ScalarType(t);
        for (const Index3 dims : {Index3(1, 1, 1), Index3(1, 7, 5), Index3(13, 1, 2), Index3(17, 11, 9)})
            for (const Pattern pattern : kPatterns) {
                // Pictures have 16 bits, and zfp's transform of doubles ends at half their range.
                auto limits = limits_of(type);
                if (bytes_of(type) == 4 && !is_float(type)) limits.first = limits.second - 65535;
                const VolumePtr volume = volume_of(dims, type, 1, [&](Index3 i, int) { return pattern(i, limits); });
                if (!holds(codec(), volume->desc())) continue;
                VolumeDesc ranged = volume->desc();
                ranged.range = value_range(*volume);
                if (!holds(codec(), ranged)) continue;
                const Encoded e = encoded(*volume, codec(), fast());
                EXPECT_EQ(decoded(e.bricks), bytes_of_volume(*volume))
                    << voxloom::name_of(type) << " " << dims.x << " x " << dims.y << " x " << dims.z;
                EXPECT_EQ(e.report.max_error, 0);
                EXPECT_EQ(e.report.lossless_bricks, 0u);
            }
    }
}

TEST_P(EveryCodec, GivesEveryComponentBack) {
    for (int components = 2; components <= 4; ++components)
        for (const ScalarType type : {ScalarType::u8, ScalarType::i16, ScalarType::f32}) {
            const VolumePtr volume = scene({11, 9, 7}, type, components);
            if (!holds(codec(), volume->desc())) continue;
            EXPECT_EQ(decoded(encoded(*volume, codec(), fast()).bricks), bytes_of_volume(*volume)) << components;
        }
}

TEST_P(EveryCodec, KeepsWhatIsNotFinite) {
    const VolumePtr volume = volume_of({11, 9, 7}, ScalarType::f32, 1, [](Index3 i, int) {
        constexpr double odd[] = {NAN, INFINITY, -INFINITY, 1e-42, -0.0, 1e30};
        return i.z == 0 && i.x < 6 ? odd[i.x] : std::sin(double(i.x + i.y));
    });
    if (!holds(codec(), volume->desc())) return;
    EXPECT_EQ(decoded(encoded(*volume, codec(), fast()).bricks), bytes_of_volume(*volume));
    if (!has_target(codec(), Target::max_error)) return;
    const Encoded lossy = encoded(*volume, codec(), fast(Target::max_error, 0.01, 4));
    const auto before = numbers(bytes_of_volume(*volume), ScalarType::f32), after = numbers(decoded(lossy.bricks), ScalarType::f32);
    for (std::size_t i = 0; i < before.size(); ++i) {
        if (std::isfinite(before[i])) {
            EXPECT_LE(std::abs(before[i] - after[i]), 0.01);
        } else {
            EXPECT_TRUE(std::isnan(before[i]) ? std::isnan(after[i]) : before[i] == after[i]);
        }
    }
    const std::uint64_t kept = lossy.report.lossless_bricks + lossy.report.raw_bricks;
    EXPECT_GT(kept, 0u);
    EXPECT_LT(kept, lossy.bricks->index().bricks.places.size());
}

TEST_P(EveryCodec, NeverGrowsByMoreThanTheIndex) {
    std::mt19937 random(3);
    const VolumePtr noise = volume_of({16, 16, 16}, ScalarType::u16, 1, [&](Index3, int) { return double(random() % 65536); });
    const Encoded e = encoded(*noise, codec(), fast());
    EXPECT_LE(e.bricks->payload().size(), noise->desc().dense_bytes() + e.bricks->index().bricks.places.size());
    EXPECT_EQ(decoded(e.bricks), bytes_of_volume(*noise));
}

// --- targets ---

double psnr_between(const Volume& volume, const BricksPtr& bricks) {
    const ScalarType type = volume.desc().type;
    const auto before = numbers(bytes_of_volume(volume), type), after = numbers(decoded(bricks), type);
    double squares = 0;
    for (std::size_t i = 0; i < before.size(); ++i) squares += (before[i] - after[i]) * (before[i] - after[i]);
    return psnr(value_range(volume).extent(), std::sqrt(squares / double(before.size())));
}

TEST_P(EveryCodec, ReachesAPsnrWithFewerBytesForLess) {
    if (!has_target(codec(), Target::psnr)) return;
    for (const ScalarType type : {ScalarType::i16, ScalarType::u8, ScalarType::f64}) {
        const VolumePtr volume = scene({20, 13, 10}, type);
        if (!holds(codec(), volume->desc())) continue;
        double last = 0;
        for (const double target : {25.0, 40.0, 55.0}) {
            const Encoded e = encoded(*volume, codec(), fast(Target::psnr, target, 16));
            EXPECT_GE(e.report.psnr, target);
            const double measured = psnr_between(*volume, e.bricks);
            EXPECT_TRUE(measured == e.report.psnr || std::abs(measured - e.report.psnr) < 1e-6);  // both may be infinite
            EXPECT_GE(double(e.bricks->desc().compressed_bytes), last);
            last = double(e.bricks->desc().compressed_bytes);
        }
    }
}

TEST_P(EveryCodec, AConstantVolumeIsExactWhateverTheTarget) {
    const VolumePtr volume = volume_of({20, 9, 5}, ScalarType::u16, 1, [](Index3, int) { return 4711.0; });
    for (const Target target : {Target::psnr, Target::max_error, Target::bpv}) {
        if (!has_target(codec(), target)) continue;
        EXPECT_EQ(decoded(encoded(*volume, codec(), fast(target, 30)).bricks), bytes_of_volume(*volume));
    }
}

TEST_P(EveryCodec, NoVoxelIsFurtherOffThanTheLargestError) {
    if (!has_target(codec(), Target::max_error)) return;
    for (const ScalarType type : {ScalarType::u8, ScalarType::i16, ScalarType::i32, ScalarType::f32, ScalarType::f64}) {
        const VolumePtr volume = scene({21, 17, 9}, type);
        if (!holds(codec(), volume->desc())) continue;
        for (const double bound : {0.25, 1.0, 7.0, 300.0}) {
            const Encoded e = encoded(*volume, codec(), fast(Target::max_error, bound));
            const auto before = numbers(bytes_of_volume(*volume), type), after = numbers(decoded(e.bricks), type);
            double largest = 0;
            for (std::size_t i = 0; i < before.size(); ++i) largest = std::max(largest, std::abs(before[i] - after[i]));
            EXPECT_LE(largest, bound) << voxloom::name_of(type);
            EXPECT_EQ(largest, e.report.max_error);
            if (bound >= 7 && bytes_of(type) > 1) {
                EXPECT_GT(largest, 0);
            }
        }
    }
}

TEST_P(EveryCodec, StaysWithinABudget) {
    if (!has_target(codec(), Target::bpv)) return;
    const VolumePtr volume = scene({32, 24, 16});
    for (const double bpv : {2.5, 5.0}) {
        const Encoded e = encoded(*volume, codec(), fast(Target::bpv, bpv, 16));
        EXPECT_LE(e.report.bits_per_voxel, bpv);
        EXPECT_GT(e.report.bits_per_voxel, 0.7 * bpv);
        const Encoded by_ratio = encoded(*volume, codec(), fast(Target::ratio, 16 / bpv, 16));
        EXPECT_EQ(by_ratio.bricks->payload().size(), e.bricks->payload().size());
    }
    try {
        encoded(*volume, codec(), fast(Target::bpv, 0.001, 16));
        ADD_FAILURE() << "nothing can be so small";
    } catch (const Error& error) {
        EXPECT_THAT(error.what(), HasSubstr("bits a voxel at the least"));
    }
}

// --- what the bricks say of themselves ---

TEST_P(EveryCodec, StatisticsAreThoseOfTheDecodedBricks) {
    const VolumePtr volume = scene({20, 17, 9});
    const Target target = codec().targets.size() > 1 ? Target::psnr : Target::lossless;
    const Encoded e = encoded(*volume, codec(), fast(target, 35));
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

TEST_P(EveryCodec, ThreadsDoNotChangeTheBytes) {
    const VolumePtr volume = scene({30, 20, 17});
    const Target target = codec().targets.size() > 1 ? Target::psnr : Target::lossless;
    std::vector<Bytes> files;
    for (const std::size_t threads : {1, 3}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        const Encoded e = encoded(*volume, codec(), fast(target, 35, 16));
        files.push_back(front_of(e.bricks->index(), e.bricks->payload().size()));
        files.back().insert(files.back().end(), e.bricks->payload().begin(), e.bricks->payload().end());
    }
    EXPECT_TRUE(files[0] == files[1]);
}

TEST_P(EveryCodec, CancellingEndsTheWork) {
    std::stop_source stop;
    stop.request_stop();
    EncodeReport report;
    EXPECT_THROW(encode(*scene({16, 16, 16}), codec(), fast(), report, stop.get_token()), Cancelled);
}

TEST_P(EveryCodec, EmptyVolumesPass) {
    const VolumePtr volume = volume_of({0, 4, 4}, ScalarType::u8, 1, [](Index3, int) { return 0.0; });
    for (const Target target : codec().targets)
        EXPECT_EQ(encoded(*volume, codec(), fast(target, 10)).bricks->desc().volume.voxels(), 0u);
}

TEST_P(EveryCodec, SlicesAreBricksToo) {
    const VolumePtr volume = scene({40, 30, 5});
    EncodeOptions options = fast();
    options.brick = {512, 512, 1};
    const Encoded e = encoded(*volume, codec(), options);
    EXPECT_EQ(e.bricks->index().bricks.places.size(), 5u);
    EXPECT_EQ(decoded(e.bricks), bytes_of_volume(*volume));
}

// --- what is refused ---

std::string refusal(const std::function<void()>& work) {
    try {
        work();
    } catch (const Error& e) {
        return e.what();
    }
    return "";
}

TEST_P(EveryCodec, RefusesWhatCannotBeWithASentence) {
    VolumeDesc masked = scene({8, 8, 8})->desc();
    masked.has_mask = true;
    EXPECT_THAT(refusal([&] { plan(masked, codec(), fast()); }), HasSubstr("mask"));
    VolumeDesc large = scene({8, 8, 8})->desc();
    large.dims = {4096, 4096, 4096};
    EXPECT_THAT(refusal([&] { plan(large, codec(), fast(Target::lossless, 0, 4096)); }), HasSubstr("smaller bricks"));
    EXPECT_THAT(refusal([&] { plan(masked, codec(), fast(Target::max_error, 0)); }), ::testing::Not(::testing::IsEmpty()));
}

TEST(PictureCodecs, RefuseFloatsAndWideIntegers) {
    for (const char* name : {"jpeg2000", "jpegls", "jpegxl"}) {
        const Codec* codec = find_codec(name);
        if (!codec) continue;
        EXPECT_THAT(refusal([&] { plan(scene({4, 4, 4}, ScalarType::f32)->desc(), *codec, fast()); }), HasSubstr("floating point"));
        const VolumePtr wide = volume_of({4, 4, 4}, ScalarType::i32, 1, [](Index3 i, int) { return 70000.0 * double(i.x); });
        EXPECT_THAT(refusal([&] { encoded(*wide, *codec, fast()); }), HasSubstr("16 bits"));
        // Wide types with few values pass.
        const VolumePtr narrow = volume_of({4, 4, 4}, ScalarType::i32, 1, [](Index3 i, int) { return 1e9 + double(i.x); });
        EXPECT_EQ(decoded(encoded(*narrow, *codec, fast()).bricks), bytes_of_volume(*narrow));
    }
}

TEST_P(EveryCodec, AWrongRangeCostsBytesAndNothingElse) {
    const VolumePtr truth = scene({16, 16, 16});
    VolumeDesc desc = truth->desc();
    desc.range = ValueRange{1000, 1001};
    Buffer voxels(desc.dense_bytes());
    truth->read(Box::of(desc.dims), voxels.bytes(), {});
    const DenseVolume volume(desc, std::move(voxels));
    EXPECT_EQ(decoded(encoded(volume, codec(), fast()).bricks), bytes_of_volume(*truth));
}

}  // namespace
}  // namespace voxloom::baseline
