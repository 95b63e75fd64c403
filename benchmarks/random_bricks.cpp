// Random bricks of a compressed file: how long until one is there.
//
//     bench-random-bricks FILE [--codec NODE] [--count N]
//
// Bricks of the finest level in random order, median and 99th percentile of wall time:
//   disk   the file's pages are dropped first; every brick with all its ancestors
//   cold   the file is in memory; every brick with all its ancestors
//   warm   the brick's parent is decoded already
#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <random>

#include "core/base/meter.h"
#include "core/base/text.h"
#include "core/data/brick_cache.h"
#include "core/plugin/loader.h"
#include "tests/support/run_node.h"

namespace voxloom {

namespace {

void print_times(const char* what, std::vector<double> seconds) {
    std::sort(seconds.begin(), seconds.end());
    const auto at = [&](double q) { return seconds[std::size_t(q * double(seconds.size() - 1))] * 1e6; };
    fmt::print("{:6} {:10.1f} us median {:10.1f} us p99\n", what, at(0.5), at(0.99));
    std::fflush(stdout);
}

void drop_pages(const std::string& path) {
    const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (file < 0) return;
    ::fdatasync(file);
    ::posix_fadvise(file, 0, 0, POSIX_FADV_DONTNEED);
    ::close(file);
}

void run(int argc, char** argv) {
    std::string path, codec = "wavelet.open";
    std::int64_t count = 1000;
    for (int i = 1; i < argc; ++i) {
        const std::string word = argv[i];
        if (!word.starts_with("--")) {
            path = word;
            continue;
        }
        if (++i == argc) fail("{} needs a value", word);
        if (word == "--codec") {
            codec = argv[i];
        } else if (word == "--count") {
            if (!parse_integer(argv[i], count) || count < 1) fail("--count is a positive number, not {}", argv[i]);
        } else {
            fail("{} is not understood; known are --codec and --count", word);
        }
    }
    if (path.empty()) fail("no file is named: bench-random-bricks FILE [--codec NODE] [--count N]");

    Registry registry;
    for (const std::string& problem : load_plugins(registry).problems) fmt::print(stderr, "{}\n", problem);
    drop_pages(path);
    const BricksPtr bricks = testing::run_node(registry, codec, "{path: '" + path + "'}").output<Bricks>("bricks");
    const glm::ivec3 grid = bricks->desc().levels[0].bricks;
    fmt::print("{}: {}, {}\n", path, summary(bricks->desc().volume), human_bytes(double(bricks->desc().compressed_bytes)));
    std::mt19937_64 random(1);
    std::vector<BrickId> ids;
    for (std::int64_t i = 0; i < count; ++i) {
        glm::ivec3 at;
        for (int a = 0; a < 3; ++a) at[a] = int(random() % std::uint64_t(grid[a]));
        ids.push_back({0, at});
    }
    const auto measure = [&](const char* what, bool parent_first) {
        std::vector<double> seconds;
        for (const BrickId& id : ids) {
            BrickCache cache(std::uint64_t(256) << 20);
            const auto parent = bricks->parent(id);
            if (parent_first && parent) cache.get(bricks, *parent);
            const std::int64_t start = wall_ns();
            cache.get(bricks, id);
            seconds.push_back(double(wall_ns() - start) * 1e-9);
        }
        print_times(what, std::move(seconds));
    };
    measure("disk", false);
    measure("cold", false);
    measure("warm", true);
}

}  // namespace

}  // namespace voxloom

int main(int argc, char** argv) {
    try {
        voxloom::run(argc, argv);
    } catch (const std::exception& e) {
        fmt::print(stderr, "bench-random-bricks: {}\n", e.what());
        return 1;
    }
}
