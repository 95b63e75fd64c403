// Codecs side by side: bits, errors, speed and the latency of a region, one row a setting.
//
//     bench-codecs VOLUME... [--codecs A,B,...] [--targets 50,40,lossless] [--json FILE] [--crop N] [--regions N]
//     bench-codecs VOLUME... --codec NODE --set YAML...
//
// Nothing here knows a codec: a node NAME.encode that makes Bricks of a Volume will do. A codec is NAME, or with
// parameters NAME:KEY=VALUE:...; without --codecs all there are, in each of the coders that they offer. A target is a
// PSNR in dB or `lossless`; codecs that cannot be aimed at it are left out. --crop takes the middle N^3 voxels.
//
// MB/s are of the original's bytes over CPU time, so per core. Encoding is one pass of the codec where the node tells
// its time; `all` holds searches and checks too. Decoding is every family once, parents at hand. `two` is how
// much faster two threads decode than one, by the clock. A region is 32^3, aligned, read by one thread through the brick
// cache, in random order: cold with nothing in the cache, warm with the ancestors of its bricks there. bpv holds
// everything that a file holds.
#include <fmt/core.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <unordered_map>

#include "core/base/meter.h"
#include "core/base/text.h"
#include "core/data/brick_cache.h"
#include "core/measure/statistics.h"
#include "core/measure/volume_error.h"
#include "core/plugin/loader.h"
#include "tests/support/run_node.h"

namespace voxloom {

namespace {

// --- what is asked for ---

struct Row {
    std::string node, setting;  // of the encoder, in YAML
};
struct Arguments {
    std::vector<std::string> volumes, codecs, targets = {"40", "50", "60", "lossless"}, settings;
    std::string node = "wavelet.encode", json;
    std::int64_t crop = 0, regions = 300;
};

// Parts between commas that stand in no bracket.
std::vector<std::string> split(const std::string& text, char separator) {
    std::vector<std::string> parts(1);
    int depth = 0;
    for (const char c : text) {
        depth += (c == '[') - (c == ']');
        if (c == separator && depth == 0)
            parts.emplace_back();
        else
            parts.back() += c;
    }
    return parts;
}

Arguments arguments_of(int argc, char** argv) {
    Arguments a;
    for (int i = 1; i < argc; ++i) {
        const std::string word = argv[i];
        if (!word.starts_with("--")) {
            a.volumes.push_back(word);
            continue;
        }
        if (++i == argc) fail("{} needs a value", word);
        const std::string value = argv[i];
        const auto whole = [&](std::int64_t& number) {
            if (!parse_integer(value, number) || number < 1) fail("{} takes a whole number above 0, not '{}'", word, value);
        };
        if (word == "--codecs") a.codecs = split(value, ',');
        else if (word == "--targets") a.targets = split(value, ',');
        else if (word == "--json") a.json = value;
        else if (word == "--crop") whole(a.crop);
        else if (word == "--regions") whole(a.regions);
        else if (word == "--codec") a.node = value;
        else if (word == "--set") a.settings.push_back(value);
        else fail("{} is not understood; known are --codecs, --targets, --json, --crop, --regions, --codec and --set", word);
    }
    if (a.volumes.empty()) fail("no volume is named: bench-codecs VOLUME... [--codecs A,B] [--targets 50,lossless]");
    return a;
}

std::vector<std::string> all_codecs(const Registry& registry) {
    std::vector<std::string> names;
    for (const NodeType* type : registry.all()) {
        if (!type->id.ends_with(".encode") || type->inputs.size() != 1 || !type->inputs[0].types.has(PortType::volume)) continue;
        const std::string name = type->id.substr(0, type->id.size() - 7);
        if (const ParamSpec* coder = type->find_param("coder"))
            for (const std::string& choice : coder->choices) names.push_back(name + ":coder=" + choice);
        else
            names.push_back(name);
    }
    return names;
}

// The encoder's parameters for a target, or nothing where the codec cannot be aimed at it.
std::optional<std::string> setting_for(const NodeType& encoder, const std::string& target) {
    const ParamSpec* spec = encoder.find_param("target");
    double psnr = 0;
    const bool lossless = target == "lossless";
    if (!lossless && !parse_number(target, psnr)) fail("a target is a PSNR or 'lossless', not '{}'", target);
    if (!spec) return lossless ? std::optional<std::string>("") : std::nullopt;
    const std::string wanted = lossless ? "lossless" : "psnr";
    if (std::ranges::find(spec->choices, wanted) == spec->choices.end()) return std::nullopt;
    return "target: " + wanted + (lossless ? "" : ", psnr: " + target);
}

std::vector<Row> rows_of(const Arguments& arguments, const Registry& registry) {
    std::vector<Row> rows;
    for (const std::string& setting : arguments.settings) rows.push_back({arguments.node, setting});
    if (!rows.empty()) return rows;
    for (const std::string& codec : arguments.codecs.empty() ? all_codecs(registry) : arguments.codecs) {
        const std::vector<std::string> parts = split(codec, ':');
        const NodeType* encoder = registry.find(parts[0] + ".encode");
        if (!encoder) fail("there is no node {}.encode", parts[0]);
        for (const std::string& target : arguments.targets) {
            const auto aim = setting_for(*encoder, target);
            if (!aim) continue;
            std::string setting = *aim;
            for (std::size_t i = 1; i < parts.size(); ++i) {
                std::string assignment = parts[i];
                if (const auto equals = assignment.find('='); equals != std::string::npos) assignment.replace(equals, 1, ": ");
                setting += (setting.empty() ? "" : ", ") + assignment;
            }
            rows.push_back({encoder->id, "{" + setting + "}"});
        }
    }
    return rows;
}

// --- what is measured ---

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

// CPU seconds of decoding everything once.
double decode_seconds(const Bricks& bricks) {
    std::unordered_map<BrickId, BrickVoxelsPtr, HashOfBrickId> kept;  // of the coarser levels
    std::int64_t cpu = 0;
    for (int level = int(bricks.desc().levels.size()) - 1; level >= 0; --level)
        for (const BrickId& id : families(bricks, level)) {
            const auto parent = bricks.parent(id);
            const BrickVoxelsPtr voxels = parent ? kept.at(*parent) : nullptr;
            const std::int64_t start = process_cpu_ns();
            auto family = bricks.refine(id, voxels.get(), {});
            cpu += process_cpu_ns() - start;
            if (level > 0)
                for (DecodedBrick& brick : family) kept[brick.id] = std::move(brick.voxels);
        }
    return double(cpu) * 1e-9;
}

// Seconds by the clock of reading everything through an empty cache, the best of three.
double read_seconds(const BricksPtr& bricks, int threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, std::size_t(threads));
    Buffer out(bricks->desc().volume.dense_bytes());
    double best = INFINITY;
    for (int i = 0; i < 3; ++i) {
        BrickCache cache(std::uint64_t(4) << 30);
        const std::int64_t start = wall_ns();
        read_region(bricks, 0, Box::of(bricks->desc().volume.dims), out.bytes(), cache);
        best = std::min(best, double(wall_ns() - start) * 1e-9);
    }
    return best;
}

struct Times {
    double median = 0, p99 = 0;
};
Times times_of(std::vector<double> seconds) {
    if (seconds.empty()) return {};
    std::ranges::sort(seconds);
    return {quantile(seconds, 0.5), quantile(seconds, 0.99)};
}

// Aligned regions of 32^3 in random order.
struct Latency {
    Times warm, cold;
};
Latency latency_of(const BricksPtr& bricks, std::int64_t most) {
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    const BricksDesc& desc = bricks->desc();
    const Index3 side(32), n = glm::max(desc.volume.dims / side, Index3(1));
    std::vector<std::int64_t> places(std::size_t(n.x * n.y * n.z));
    for (std::size_t i = 0; i < places.size(); ++i) places[i] = std::int64_t(i);
    std::ranges::shuffle(places, std::mt19937(1));
    places.resize(std::min(places.size(), std::size_t(most)));

    std::vector<double> warm, cold;
    for (const std::int64_t place : places) {
        const Index3 lo = Index3(place % n.x, place / n.x % n.y, place / (n.x * n.y)) * side;
        const Box box{lo, glm::min(lo + side, desc.volume.dims)};
        Buffer out(box.voxels() * desc.volume.voxel_bytes());
        const auto read = [&](BrickCache& cache) {
            const std::int64_t start = wall_ns();
            read_region(bricks, 0, box, out.bytes(), cache);
            return double(wall_ns() - start) * 1e-9;
        };
        BrickCache empty(std::uint64_t(1) << 30), prepared(std::uint64_t(1) << 30);
        cold.push_back(read(empty));
        const glm::ivec3 first(box.lo / Index3(desc.brick)), last((box.hi - Index3(1)) / Index3(desc.brick));
        for (int z = first.z; z <= last.z; ++z)
            for (int y = first.y; y <= last.y; ++y)
                for (int x = first.x; x <= last.x; ++x)
                    if (const auto parent = bricks->parent({0, {x, y, z}})) prepared.get(bricks, *parent);
        warm.push_back(read(prepared));
    }
    return {times_of(warm), times_of(cold)};
}

// The middle of a volume.
VolumePtr cropped(const VolumePtr& volume, std::int64_t side) {
    VolumeDesc desc = volume->desc();
    const Index3 dims = glm::min(desc.dims, Index3(side)), lo = (desc.dims - dims) / Index3(2);
    desc.dims = dims;
    desc.range.reset();
    Buffer voxels(desc.dense_bytes());
    volume->read({lo, lo + dims}, voxels.bytes());
    return std::make_shared<DenseVolume>(desc, std::move(voxels));
}

nlohmann::json measure(const Registry& registry, const VolumePtr& volume, const Row& row, std::int64_t regions) {
    const std::int64_t start = process_cpu_ns();
    const auto encoded = testing::run_node(registry, row.node, row.setting, {{"volume", {Value(volume)}}});
    const double all = double(process_cpu_ns() - start) * 1e-9;
    const auto told = encoded.measurements.find("codec time");
    const double pass = told == encoded.measurements.end() ? all : told->second.first;
    const BricksPtr bricks = encoded.output<Bricks>("bricks");
    BrickCache cache(std::uint64_t(4) << 30);
    const VolumeError error = compare_volumes(level_as_volume(bricks, 0, cache), volume);
    const double megabytes = double(volume->desc().dense_bytes()) / 1e6;
    const Latency latency = latency_of(bricks, regions);
    return {{"node", row.node}, {"setting", row.setting},
            {"bpv", 8 * double(bricks->desc().compressed_bytes) / double(volume->desc().voxels())},
            {"psnr", error.psnr_range}, {"max_error", error.max_error},
            {"encode_mb_s", megabytes / pass}, {"encode_all_mb_s", megabytes / all},
            {"decode_mb_s", megabytes / decode_seconds(*bricks)},
            {"two_threads", read_seconds(bricks, 1) / read_seconds(bricks, 2)},
            {"warm_us", {latency.warm.median * 1e6, latency.warm.p99 * 1e6}},
            {"cold_us", {latency.cold.median * 1e6, latency.cold.p99 * 1e6}}};
}

void print_head() {
    fmt::print("{:58} {:>8} {:>7} {:>9} {:>8} {:>8} {:>8} {:>5} {:>13} {:>13}\n", "", "bpv", "PSNR", "max error", "encode",
               "all", "decode", "two", "32^3 warm", "32^3 cold");
    fmt::print("{:58} {:>8} {:>7} {:>9} {:>8} {:>8} {:>8} {:>5} {:>13} {:>13}\n", "", "", "dB", "", "MB/s", "MB/s", "MB/s", "x",
               "us median/p99", "us median/p99");
}

void print(const nlohmann::json& r) {
    fmt::print("  {:56} {:8.4f} {:7.2f} {:9.4g} {:8.1f} {:8.1f} {:8.1f} {:5.2f} {:6.0f} {:6.0f} {:6.0f} {:6.0f}\n",
               r["node"].get<std::string>() + " " + r["setting"].get<std::string>(), r["bpv"].get<double>(),
               r["psnr"].get<double>(), r["max_error"].get<double>(), r["encode_mb_s"].get<double>(),
               r["encode_all_mb_s"].get<double>(), r["decode_mb_s"].get<double>(), r["two_threads"].get<double>(),
               r["warm_us"][0].get<double>(), r["warm_us"][1].get<double>(), r["cold_us"][0].get<double>(),
               r["cold_us"][1].get<double>());
    std::fflush(stdout);
}

void run(int argc, char** argv) {
    const Arguments arguments = arguments_of(argc, argv);
    Registry registry;
    for (const std::string& problem : load_plugins(registry).problems) fmt::print(stderr, "{}\n", problem);
    const std::vector<Row> rows = rows_of(arguments, registry);
    nlohmann::json results = nlohmann::json::array();
    print_head();
    for (const std::string& path : arguments.volumes) {
        VolumePtr volume = in_memory(testing::run_node(registry, "readers.volume", "{path: " + to_yaml(path) + "}").volume());
        if (arguments.crop > 0) volume = cropped(volume, arguments.crop);
        fmt::print("{}: {}\n", path, summary(volume->desc()));
        for (const Row& row : rows) {
            try {
                nlohmann::json result = measure(registry, volume, row, arguments.regions);
                result["volume"] = path;
                result["summary"] = summary(volume->desc());
                print(result);
                results.push_back(std::move(result));
            } catch (const Error& e) {  // floats to a codec of pictures, say
                fmt::print("  {} {}: {}\n", row.node, row.setting, e.what());
            }
        }
    }
    if (!arguments.json.empty()) std::ofstream(arguments.json) << results.dump(1) << "\n";
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
