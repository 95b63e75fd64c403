// A volume larger than the memory that may be taken: its slabs alone, and compressing it.
//
//     bench-out-of-core FILE|phantom:X,Y,Z [--memory MIB] [--codec NODE] [--set YAML] [--file OUT.vxw]
//
// The phantom is readers.phantom's head in 16 bits, computed as it is read and never held whole. Each
// line: wall and CPU time, MB of the original per second of either, and the largest resident memory.
#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <fstream>

#include "core/base/meter.h"
#include "core/base/text.h"
#include "core/data/bricks.h"
#include "core/plugin/loader.h"
#include "tests/support/run_node.h"

namespace voxloom {

namespace {

// Largest resident memory since the last reset, in MiB.
double peak_mib() {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);)
        if (line.starts_with("VmHWM:")) return std::stod(line.substr(6)) / 1024;
    return 0;
}
void reset_peak() { std::ofstream("/proc/self/clear_refs") << "5"; }

template <class Work>
void timed(const char* what, double bytes, const Work& work) {
    reset_peak();
    const std::int64_t wall = wall_ns(), cpu = process_cpu_ns();
    work();
    const double w = double(wall_ns() - wall) * 1e-9, c = double(process_cpu_ns() - cpu) * 1e-9;
    fmt::print("{:22} {:8.2f} s {:8.2f} s CPU {:8.1f} MB/s {:8.1f} MB/s per core {:8.1f} MiB\n", what, w, c, bytes / 1e6 / w,
               bytes / 1e6 / c, peak_mib());
    std::fflush(stdout);
}

void run(int argc, char** argv) {
    std::string volume_name, codec = "wavelet.encode", set = "target: psnr, psnr: 50, coder: fast", out;
    double memory = 0;
    for (int i = 1; i < argc; ++i) {
        const std::string word = argv[i];
        if (!word.starts_with("--")) {
            volume_name = word;
            continue;
        }
        if (++i == argc) fail("{} needs a value", word);
        if (word == "--memory") {
            if (!parse_number(argv[i], memory)) fail("--memory is a number of MiB, not {}", argv[i]);
        } else if (word == "--codec") {
            codec = argv[i];
        } else if (word == "--set") {
            set = argv[i];
        } else if (word == "--file") {
            out = argv[i];
        } else {
            fail("{} is not understood; known are --memory, --codec, --set and --file", word);
        }
    }
    if (volume_name.empty()) fail("no volume is named: bench-out-of-core FILE|phantom:X,Y,Z [--memory MIB]");

    Registry registry;
    for (const std::string& problem : load_plugins(registry).problems) fmt::print(stderr, "{}\n", problem);
    const bool phantom = volume_name.starts_with("phantom:");
    const VolumePtr volume =
        phantom ? testing::run_node(registry, "readers.phantom", "{kind: ct-head, type: u16, dims: [" + volume_name.substr(8) + "]}").volume()
                : testing::run_node(registry, "readers.volume", "{path: '" + volume_name + "'}").volume();
    const VolumeDesc& desc = volume->desc();
    const double bytes = double(desc.dense_bytes());
    fmt::print("{}: {}, {}\n", volume_name, summary(desc), human_bytes(bytes));

    timed("slabs alone", bytes, [&] {
        const std::uint64_t slice = std::uint64_t(desc.dims.x) * std::uint64_t(desc.dims.y) * desc.voxel_bytes();
        const auto step = std::max<std::int64_t>(1, std::int64_t((16u << 20) / std::max<std::uint64_t>(slice, 1)));
        Buffer slab(slice * std::uint64_t(step), "slab");
        for (std::int64_t z = 0; z < desc.dims.z; z += step) {
            const Box box{{0, 0, z}, {desc.dims.x, desc.dims.y, std::min(z + step, desc.dims.z)}};
            volume->read(box, slab.bytes().first(box.voxels() * desc.voxel_bytes()));
        }
    });
    testing::NodeRun encoded;
    timed("compressed", bytes, [&] {
        const std::string limit = memory > 0 ? ", memory: " + shortest(memory) : "";
        encoded = testing::run_node(registry, codec, "{" + set + limit + "}", {{"volume", {Value(volume)}}});
    });
    const BricksPtr bricks = encoded.output<Bricks>("bricks");
    if (!out.empty())
        timed("written to the file", bytes, [&] {
            testing::run_node(registry, codec.substr(0, codec.find('.')) + ".write", "{path: '" + out + "'}",
                              {{"bricks", {Value(bricks)}}});
        });
    fmt::print("{{{}}}: {}, {:.4f} bits a voxel\n", set, human_bytes(double(bricks->desc().compressed_bytes)),
               8 * double(bricks->desc().compressed_bytes) / double(desc.voxels()));
    for (const auto& [name, value] : encoded.measurements) fmt::print("  {}: {:.6g} {}\n", name, value.first, value.second);
    for (const auto& [name, count] : encoded.counters) fmt::print("  {}: {:.0f}\n", name, count);
}

}  // namespace

}  // namespace voxloom

int main(int argc, char** argv) {
    try {
        voxloom::run(argc, argv);
    } catch (const std::exception& e) {
        fmt::print(stderr, "bench-out-of-core: {}\n", e.what());
        return 1;
    }
}
