// Encoding within a memory limit, and what is left behind when it does not come to its end.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <thread>

#include "core/base/error.h"
#include "core/data/brick_cache.h"
#include "plugins/codec-wavelet/file_format.h"
#include "plugins/codec-wavelet/memory_plan.h"
#include "tests/support/volumes.h"

namespace voxloom::wavelet {
namespace {

namespace fs = std::filesystem;
using voxloom::testing::make_volume;
using voxloom::testing::TempFolder;

// A volume that is not in memory: a dense one that is only read by region, and knows how much at once.
class ReadByRegion final : public Volume {
  public:
    explicit ReadByRegion(VolumePtr volume) : Volume(volume->desc()), volume_(std::move(volume)) {}
    void read(const Box& box, std::span<std::byte> out, const std::stop_token& stop) const override {
        std::uint64_t most = most_;
        while (box.voxels() > most && !most_.compare_exchange_weak(most, box.voxels())) {
        }
        read_ += box.voxels();
        volume_->read(box, out, stop);
    }
    std::uint64_t most() const { return most_; }
    std::uint64_t read() const { return read_; }

  private:
    VolumePtr volume_;
    mutable std::atomic<std::uint64_t> most_{0}, read_{0};
};

VolumePtr waves(Index3 dims, ScalarType type) {
    return make_volume(dims, type, [](auto x, auto y, auto z) {
        return 90 + 60 * std::sin(double(x) / 5) * std::cos(double(y) / 7) + (z > 20 ? 40 : 0) + double((x * 7 + y * 3 + z * 5) % 4);
    });
}

EncodeOptions options_for(Target target, double amount, CoderKind coder = CoderKind::fast) {
    EncodeOptions options;
    options.coder = coder;
    options.brick = 8;
    options.target = target;
    options.amount = amount;
    return options;
}

Bytes file_of(const WaveletBricks& bricks) {
    Bytes file = head_of(bricks.index(), bricks.payload().size());
    file.insert(file.end(), bricks.payload().begin(), bricks.payload().end());
    return file;
}

Bytes encoded(const Volume& volume, const EncodeOptions& options) {
    EncodeReport report;
    return file_of(*encode(volume, options, report));
}

// Temporary files go to a folder of the test's own, which is looked at.
class Streaming : public ::testing::Test {
  protected:
    Streaming() { ::setenv("TMPDIR", folder_.path().c_str(), 1); }
    ~Streaming() override { ::unsetenv("TMPDIR"); }
    std::ptrdiff_t files_left() const { return std::distance(fs::directory_iterator(folder_.path()), {}); }
    TempFolder folder_;
};

// Lowers the size that a file may have, as a full disk does.
class SmallFiles {
  public:
    explicit SmallFiles(rlim_t most) : before_(std::signal(SIGXFSZ, SIG_IGN)) {
        ::getrlimit(RLIMIT_FSIZE, &limit_);
        const rlimit small{most, limit_.rlim_max};
        ::setrlimit(RLIMIT_FSIZE, &small);
    }
    ~SmallFiles() {
        ::setrlimit(RLIMIT_FSIZE, &limit_);
        std::signal(SIGXFSZ, before_);
    }

  private:
    void (*before_)(int);
    rlimit limit_{};
};

TEST_F(Streaming, TheMemoryLimitDoesNotChangeTheBytes) {
    for (ScalarType type : {ScalarType::i16, ScalarType::f32})
        for (auto [target, amount] : {std::pair(Target::lossless, 0.0), {Target::psnr, 45.0}, {Target::max_error, 3.0}, {Target::bpv, 2.0}}) {
            const VolumePtr volume = waves({44, 35, 37}, type);
            const ReadByRegion streamed(volume);
            EncodeOptions options = options_for(target, amount);
            const Bytes whole = encoded(*volume, options);
            EXPECT_EQ(encoded(streamed, options), whole);
            options.memory = least_memory(streamed, plan(streamed.desc(), options));
            const ReadByRegion starved(volume);
            EXPECT_EQ(encoded(starved, options), whole) << voxloom::name_of(type) << " " << int(target);
            if (type == ScalarType::i16) {  // a float's range is looked for in slabs of its own
                EXPECT_LE(starved.most(), 44u * 16 * 16);
            }
            EXPECT_EQ(files_left(), 0);
        }
}

TEST_F(Streaming, TooLittleMemoryIsRefusedWithTheLeastThatWorks) {
    const VolumePtr volume = waves({70, 41, 53}, ScalarType::i16);
    EncodeOptions options = options_for(Target::lossless, 0);
    const std::uint64_t least = least_memory(*volume, plan(volume->desc(), options));
    options.memory = least / 2;
    EncodeReport report;
    try {
        encode(*volume, options, report);
        FAIL() << "it was not refused";
    } catch (const Error& e) {
        EXPECT_THAT(e.what(), ::testing::HasSubstr(fmt::format("at least {} MiB", (least + (1 << 20) - 1) >> 20)));
    }
}

TEST_F(Streaming, AKnownRangeIsNotLookedForAndTheVolumeIsReadTwice) {
    const VolumePtr volume = waves({64, 64, 64}, ScalarType::i16);
    const ReadByRegion streamed(volume);
    encoded(streamed, options_for(Target::lossless, 0));
    EXPECT_EQ(streamed.read(), 2 * volume->desc().voxels());
}

TEST_F(Streaming, ProgressGrowsToOne) {
    const VolumePtr volume = waves({64, 64, 64}, ScalarType::i16);
    for (auto [target, amount] : {std::pair(Target::lossless, 0.0), {Target::psnr, 45.0}, {Target::bpv, 2.0}}) {
        std::vector<double> fractions;
        std::mutex mutex;
        EncodeReport report;
        encode(*volume, options_for(target, amount), report, {}, [&](double f) {
            const std::lock_guard lock(mutex);
            fractions.push_back(f);
        });
        EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
        EXPECT_GE(fractions.front(), 0);
        EXPECT_EQ(fractions.back(), 1);
        EXPECT_GT(fractions.size(), 20u);
    }
}

TEST_F(Streaming, CancellingAnywhereLeavesNothingBehind) {
    const ReadByRegion volume(waves({70, 41, 53}, ScalarType::i16));
    EncodeOptions options = options_for(Target::psnr, 45);
    options.memory = least_memory(volume, plan(volume.desc(), options));
    for (double at : {0.0, 0.05, 0.15, 0.22, 0.3, 0.5, 0.7}) {
        std::stop_source stop;
        EncodeReport report;
        EXPECT_THROW(encode(volume, options, report, stop.get_token(), [&](double f) {
            if (f >= at) stop.request_stop();
        }), Cancelled);
        EXPECT_EQ(files_left(), 0);
    }
}

TEST_F(Streaming, AFullDiskIsOneSentence) {
    const ReadByRegion volume(waves({70, 41, 53}, ScalarType::i16));
    EncodeOptions options = options_for(Target::lossless, 0);
    const Bytes whole = encoded(volume, options);
    options.memory = least_memory(volume, plan(volume.desc(), options));
    for (rlim_t most : {1000, 100000}) {  // in the levels, in the sample
        const SmallFiles small(most);
        try {
            encoded(volume, options);
            FAIL() << "it fitted";
        } catch (const Error& e) {
            EXPECT_THAT(e.what(), ::testing::AllOf(::testing::HasSubstr(folder_.path().string()), ::testing::HasSubstr("free some space")));
        }
        EXPECT_EQ(files_left(), 0);
    }
    const fs::path path = folder_.path() / "a.vxw";
    EncodeReport report;
    const auto tree = encode(volume, options, report);
    {
        const SmallFiles small(whole.size() / 2);
        EXPECT_THROW(write_file(*tree, path), Error);
    }
    EXPECT_EQ(files_left(), 0);
    write_file(*tree, path);
    EXPECT_EQ(fs::file_size(path), whole.size());
}

TEST_F(Streaming, AKilledWriterLeavesAWholeFile) {
    const VolumePtr volume = waves({70, 41, 53}, ScalarType::i16);
    EncodeReport report;
    const auto one = encode(*volume, options_for(Target::lossless, 0), report), other = encode(*volume, options_for(Target::psnr, 40), report);
    const Bytes a = file_of(*one), b = file_of(*other);
    const fs::path path = folder_.path() / "a.vxw";
    write_file(*one, path);
    for (int kill = 0; kill < 10; ++kill) {
        const pid_t child = ::fork();
        ASSERT_GE(child, 0);
        if (child == 0)
            for (;;) {
                write_file(*other, path);
                write_file(*one, path);
            }
        std::this_thread::sleep_for(std::chrono::milliseconds(3 + 2 * kill));
        ::kill(child, SIGKILL);
        int status = 0;
        ASSERT_EQ(::waitpid(child, &status, 0), child);
        ASSERT_TRUE(WIFSIGNALED(status));
        const MappedFile file(path);
        const Bytes now(file.bytes().begin(), file.bytes().end());
        EXPECT_TRUE(now == a || now == b) << "after kill " << kill;
    }
}

}  // namespace
}  // namespace voxloom::wavelet
