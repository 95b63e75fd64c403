// Codecs side by side: bits, errors, speed and the latency of a region, one row a setting.
//
//     bench-codecs VOLUME... [--codec NODE] [--set YAML]... [--out FILE.json]
//
// Each --set is one row: parameters of the encoding node (by default wavelet.encode). Without any, a
// standard list. Nothing here knows a codec: a node that makes Bricks of a Volume will do.
//
// MB/s are of the original's bytes over CPU time of all threads, so per core. Decoding is every family
// once, parents at hand. Latency is of one family of the finest level, in random order: warm with its
// parent decoded, cold with all its ancestors to decode. bpv holds everything that a file holds.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <random>

#include "core/base/meter.h"
#include "core/base/text.h"
#include "core/data/brick_cache.h"
#include "core/data/convert.h"
#include "core/plugin/loader.h"
#include "tests/support/run_node.h"

namespace voxloom {

namespace {

const std::vector<std::string> kStandard = {
    "{target: lossless, coder: dense}",         "{target: lossless, coder: fast}",
    "{target: lossless, coder: paper}",         "{target: psnr, psnr: 40, coder: dense}",
    "{target: psnr, psnr: 50, coder: dense}",   "{target: psnr, psnr: 60, coder: dense}",
    "{target: psnr, psnr: 40, coder: fast}",    "{target: psnr, psnr: 50, coder: fast}",
    "{target: psnr, psnr: 60, coder: fast}",    "{target: psnr, psnr: 50, coder: paper}",
    "{target: psnr, psnr: 50, coder: dense, brick: 32}", "{target: psnr, psnr: 50, coder: fast, brick: 32}",
};

struct Times {
    double median = 0, p99 = 0;
};
Times times_of(std::vector<double> seconds) {
    std::sort(seconds.begin(), seconds.end());
    const auto at = [&](double q) { return seconds[std::size_t(q * double(seconds.size() - 1))]; };
    return seconds.empty() ? Times{} : Times{at(0.5), at(0.99)};
}

// Ids of one brick of each family of a level.
std::vector<BrickId> families(const Bricks& bricks, int level) {
    std::vector<BrickId> all;
    const glm::ivec3 n = bricks.desc().levels[std::size_t(level)].bricks;
    for (int z = 0; z < n.z; ++z)
        for (int y = 0; y < n.y; ++y)
            for (int x = 0; x < n.x; ++x) {
                const BrickId id{level, {x, y, z}};
                if (!bricks.parent(id) || bricks.desc().octant_of(id) == 0) all.push_back(id);
            }
    return all;
}

using Decoded = std::unordered_map<BrickId, BrickVoxelsPtr, HashOfBrickId>;

// Decodes everything, and keeps all but the finest level.
double decode_all(const Bricks& bricks, Decoded& kept) {
    std::int64_t cpu = 0;
    for (int level = int(bricks.desc().levels.size()) - 1; level >= 0; --level)
        for (const BrickId& id : families(bricks, level)) {
            const auto parent = bricks.parent(id);
            const BrickVoxelsPtr voxels = parent ? kept.at(*parent) : nullptr;
            const std::int64_t start = thread_cpu_ns();
            auto family = bricks.refine(id, voxels.get(), {});
            cpu += thread_cpu_ns() - start;
            if (level > 0)
                for (DecodedBrick& brick : family) kept[brick.id] = std::move(brick.voxels);
        }
    return double(cpu) * 1e-9;
}

std::pair<Times, Times> latencies(const Bricks& bricks, const Decoded& kept) {
    std::vector<BrickId> ids = families(bricks, 0);
    std::shuffle(ids.begin(), ids.end(), std::mt19937(1));
    ids.resize(std::min<std::size_t>(ids.size(), 1000));
    std::vector<double> warm, cold;
    for (const BrickId& id : ids) {
        const auto parent = bricks.parent(id);
        std::int64_t start = wall_ns();
        auto family = bricks.refine(id, parent ? kept.at(*parent).get() : nullptr, {});
        warm.push_back(double(wall_ns() - start) * 1e-9);
        start = wall_ns();
        std::vector<BrickId> path{id};
        while (auto above = bricks.parent(path.back())) path.push_back(*above);
        BrickVoxelsPtr above;
        for (auto step = path.rbegin(); step != path.rend(); ++step)
            for (DecodedBrick& brick : bricks.refine(*step, above.get(), {}))
                if (brick.id == *step) {
                    above = brick.voxels;
                    break;
                }
        cold.push_back(double(wall_ns() - start) * 1e-9);
    }
    return {times_of(warm), times_of(cold)};
}

void run(int argc, char** argv) {
    std::vector<std::string> volumes, settings;
    std::string codec = "wavelet.encode", out;
    for (int i = 1; i < argc; ++i) {
        const std::string word = argv[i];
        if (!word.starts_with("--")) {
            volumes.push_back(word);
            continue;
        }
        if (++i == argc) fail("{} needs a value", word);
        if (word == "--codec") codec = argv[i];
        else if (word == "--set") settings.push_back(argv[i]);
        else if (word == "--out") out = argv[i];
        else fail("{} is not understood; known are --codec, --set and --out", word);
    }
    if (volumes.empty()) fail("no volume is named: bench-codecs VOLUME... [--codec NODE] [--set YAML]...");
    if (settings.empty()) settings = kStandard;

    Registry registry;
    for (const std::string& problem : load_plugins(registry).problems) fmt::print(stderr, "{}\n", problem);
    nlohmann::json rows = nlohmann::json::array();
    fmt::print("{:52} {:>8} {:>7} {:>9} {:>7} {:>7} {:>15} {:>15}\n", "", "bpv", "PSNR", "max error", "encode", "decode",
               "family warm", "family cold");
    fmt::print("{:52} {:>8} {:>7} {:>9} {:>7} {:>7} {:>15} {:>15}\n", "", "", "dB", "", "MB/s", "MB/s", "us median/p99",
               "us median/p99");
    for (const std::string& path : volumes) {
        const auto loaded = testing::run_node(registry, "readers.volume", "{path: '" + path + "'}").volume();
        const VolumePtr volume = in_memory(loaded);
        const VolumeDesc& desc = volume->desc();
        const std::size_t values = desc.voxels() * std::size_t(desc.components);
        std::vector<double> before(values), after(values);
        to_double(desc.type, volume->data(), values, before.data());
        const ValueRange range = value_range(*volume);
        fmt::print("{}: {}\n", path, summary(desc));
        for (const std::string& setting : settings) {
            const std::int64_t start = process_cpu_ns();
            const auto encoded = testing::run_node(registry, codec, setting, {{"volume", {Value(volume)}}});
            const double encode_seconds = double(process_cpu_ns() - start) * 1e-9;
            const BricksPtr bricks = encoded.output<Bricks>("bricks");

            BrickCache cache(std::uint64_t(1) << 30);
            Buffer decoded(desc.dense_bytes());
            read_region(bricks, 0, Box::of(desc.dims), decoded.bytes(), cache);
            to_double(desc.type, decoded.data(), values, after.data());
            double squares = 0, largest = 0;
            std::size_t finite = 0;
            for (std::size_t i = 0; i < values; ++i) {
                if (!std::isfinite(before[i])) continue;
                const double e = std::abs(before[i] - after[i]);
                squares += e * e;
                largest = std::max(largest, e);
                ++finite;
            }
            const double psnr = 10 * std::log10(range.extent() * range.extent() * double(finite) / squares);
            Decoded kept;
            const double decode_seconds = decode_all(*bricks, kept);
            const auto [warm, cold] = latencies(*bricks, kept);
            const double megabytes = double(desc.dense_bytes()) / 1e6;
            const double bpv = 8 * double(bricks->desc().compressed_bytes) / double(desc.voxels());
            fmt::print("  {:50} {:8.4f} {:7.2f} {:9.4g} {:7.1f} {:7.1f} {:7.0f} {:7.0f} {:7.0f} {:7.0f}\n", setting, bpv, psnr, largest,
                       megabytes / encode_seconds, megabytes / decode_seconds, warm.median * 1e6, warm.p99 * 1e6,
                       cold.median * 1e6, cold.p99 * 1e6);
            std::fflush(stdout);
            rows.push_back({{"volume", path}, {"codec", codec}, {"setting", setting}, {"bpv", bpv}, {"psnr", psnr},
                            {"max_error", largest}, {"encode_mb_s", megabytes / encode_seconds},
                            {"decode_mb_s", megabytes / decode_seconds}, {"warm_us", {warm.median * 1e6, warm.p99 * 1e6}},
                            {"cold_us", {cold.median * 1e6, cold.p99 * 1e6}}});
        }
    }
    if (!out.empty()) std::ofstream(out) << rows.dump(1) << "\n";
}

}  // namespace

}  // namespace voxloom

int main(int argc, char** argv) {
    try {
        voxloom::run(argc, argv);
    } catch (const std::exception& e) {
        fmt::print(stderr, "bench-codecs: {}\n", e.what());
        return 1;
    }
}
