// The brick path beside the dense one, in one run: time of a picture and its error.
//
//     bench-brick-path [FILE|phantom:X,Y,Z]... [--size PIXELS] [--repeat N] [--brick VOXELS] [--only WORD]
//
// Each volume is drawn as a whole, then as bricks: every one at the finest level, those that
// lod.transfer-aware selects (balanced), and, from so far that several voxels share a pixel, those of
// lod.projective (balanced). Everything is resident: what is measured is what a turning camera pays. The
// two paths take turns, so that other load meets both. Time is the processor time of all threads, the
// least of all turns; the error is that against the dense picture. --only picks the rows that contain a word.
#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <limits>

#include "core/base/error.h"
#include "core/base/meter.h"
#include "core/base/text.h"
#include "core/data/selection.h"
#include "core/measure/image_error.h"
#include "tests/support/run_node.h"

namespace voxloom {

namespace {

using testing::NodeInputs;
using testing::NodeRun;

struct Options {
    std::vector<std::string> volumes;
    std::int64_t size = 512, repeat = 5, brick = 32;
    std::string only;
};

Options options_of(int argc, char** argv) {
    Options options;
    for (int i = 1; i < argc; ++i) {
        const std::string word = argv[i];
        if (!word.starts_with("--")) {
            options.volumes.push_back(word);
            continue;
        }
        const char* const value = i + 1 < argc ? argv[++i] : "";
        std::int64_t* const number = word == "--size"     ? &options.size
                                     : word == "--repeat" ? &options.repeat
                                     : word == "--brick"  ? &options.brick
                                                          : nullptr;
        if (word == "--only" && *value)
            options.only = value;
        else if (!number || !parse_integer(value, *number) || *number < 1)
            fail("bench-brick-path [FILE|phantom:X,Y,Z]... [--size PIXELS] [--repeat N] [--brick VOXELS] [--only WORD]");
    }
    if (options.volumes.empty()) options.volumes = {"phantom:192,192,192"};
    return options;
}

NodeRun node(const char* type, const std::string& params, const NodeInputs& inputs = {}) {
    return testing::run_node(testing::built_plugins(), type, params, inputs);
}

VolumePtr open(const std::string& name) {
    if (name.starts_with("phantom:"))
        return node("readers.phantom", "{kind: ct-head, type: u16, dims: [" + name.substr(8) + "]}").volume();
    return in_memory(node("readers.volume", "{path: '" + name + "'}").volume());
}

struct Picture {
    NodeInputs inputs;
    std::string params;
    double seconds = std::numeric_limits<double>::infinity(), drawing = seconds;
    NodeRun run;
    void draw() {
        const std::int64_t start = process_cpu_ns();
        run = node("slicer.render", params, inputs);
        seconds = std::min(seconds, double(process_cpu_ns() - start) * 1e-9);
        drawing = std::min(drawing, run.draw_seconds);
    }
};

SelectionPtr finest(const BricksPtr& bricks) {
    auto all = std::make_shared<Selection>();
    all->of = std::make_shared<BricksDesc>(bricks->desc());
    all->policy = "bench-brick-path";
    const glm::ivec3 n = bricks->desc().levels[0].bricks;
    for (int z = 0; z < n.z; ++z)
        for (int y = 0; y < n.y; ++y)
            for (int x = 0; x < n.x; ++x) {
                SelectedBrick b;
                b.id = {0, {x, y, z}};
                all->bricks.push_back(b);
            }
    return all;
}

void compare(const std::string& volume_name, const Options& options) {
    const VolumePtr volume = open(volume_name);
    const std::string brick = fmt::format("[{0}, {0}, {0}]", options.brick), size = fmt::format("[{0}, {0}]", options.size);
    const NodeRun pyramid = node("bricks.pyramid", "{brick: " + brick + "}", {{"volume", {volume}}});
    const BricksPtr bricks = pyramid.output<Bricks>("bricks");
    fmt::print("{}, {}\n", volume_name, summary(volume->desc()));
    for (double zoom : {1.0, 0.25}) {
        const NodeRun camera = node("scene.camera", fmt::format("{{zoom: {}}}", zoom), {{"fit", {volume}}});
        for (const char* preset : {"isosurfaces", "ramp"}) {
            const NodeRun transfer = node("scene.transfer", fmt::format("{{preset: {}}}", preset), {{"fit", {volume}}});
            const NodeInputs view = {{"bricks", {bricks}}, {"camera", {camera.outputs.at("camera")}}};
            std::vector<std::pair<std::string, SelectionPtr>> selections;
            auto balanced = [&](const NodeRun& run) {
                return node("lod.balance", "{max_bricks: 0}", {{"bricks", {bricks}}, {"selection", {run.outputs.at("selection")}},
                                                               {"transfer", {transfer.outputs.at("transfer")}}})
                    .output<Selection>("selection");
            };
            if (zoom < 1) {
                selections.emplace_back("projective", balanced(node("lod.projective", "{size: " + size + "}", view)));
            } else {
                NodeInputs aware = view;
                aware["transfer"] = {transfer.outputs.at("transfer")};
                selections.emplace_back("finest", finest(bricks));
                selections.emplace_back("transfer-aware", balanced(node("lod.transfer-aware", "{max_bricks: 1000000, max_error: 0.01, size: " + size + "}", aware)));
            }
            for (bool shading : {false, true})
                for (const auto& [name, selection] : selections) {
                    const std::string row = fmt::format("zoom {} {} {} {}", zoom, preset, shading ? "shaded" : "unshaded", name);
                    if (row.find(options.only) == std::string::npos) continue;
                    Picture dense, cut;
                    dense.params = cut.params = fmt::format("{{size: {}, shading: {}}}", size, shading);
                    dense.inputs = {{"source", {volume}}, {"camera", view.at("camera")}, {"transfer", {transfer.outputs.at("transfer")}}};
                    cut.inputs = dense.inputs;
                    cut.inputs["source"] = {bricks};
                    cut.inputs["selection"] = {selection};
                    for (std::int64_t k = 0; k <= options.repeat; ++k)
                        for (Picture* p : {&dense, &cut}) {
                            if (k == 1) p->seconds = p->drawing = std::numeric_limits<double>::infinity();
                            p->draw();
                        }
                    const ImageError error = compare_images(*cut.run.image(), *dense.run.image());
                    fmt::print("  {:44} dense {:7.1f} ms ({:6.1f} drawing)  bricks {:7.1f} ms ({:6.1f})  preparing {:5.1f}  ratio {:5.2f}  samples {:5.2f} "
                               "of {:5.2f} M  bricks {:5}  pages {:5}  RMSE {:.5f}\n",
                               row, dense.seconds * 1e3, dense.drawing * 1e3, cut.seconds * 1e3, cut.drawing * 1e3,
                               cut.run.counters["prepare ms"], cut.seconds / dense.seconds,
                               cut.run.counters["samples"] * 1e-6, dense.run.counters["samples"] * 1e-6, cut.run.counters["bricks drawn"],
                               cut.run.counters["pages drawn"], error.rmse);
                    std::fflush(stdout);
                }
        }
    }
}

}  // namespace

}  // namespace voxloom

int main(int argc, char** argv) {
    try {
        const voxloom::Options options = voxloom::options_of(argc, argv);
        for (const std::string& name : options.volumes) voxloom::compare(name, options);
        return 0;
    } catch (const std::exception& e) {
        fmt::print(stderr, "bench-brick-path: {}\n", e.what());
        return 1;
    }
}
