// The editor's latencies, in its real window on a display that nobody sees: from a slider's move to its
// pictures, frames while a long node runs, and a graph of 500 nodes that is moved and zoomed.
//
//   bench-editor [FOLDER]      FOLDER: where graphs and what is on the screen go (a new one in /tmp)
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>

#include "core/base/error.h"
#include "core/measure/statistics.h"
#include "tests/window/screen.h"

namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using voxloom::testing::EditorProcess;
using voxloom::testing::VirtualDisplay;

const char* const kPicture = R"(voxloom: 1
outputs: [view.image]
nodes:
  - { id: head, type: readers.phantom, set: { kind: ct-head, dims: [128, 128, 128], type: u16 } }
  - { id: tf, type: scene.transfer, in: { fit: head.volume }, set: { preset: materials } }
  - { id: camera, type: scene.camera, in: { fit: head.volume }, set: { azimuth: 40, framing: box } }
  - { id: view, type: slicer.render, in: { source: head.volume, transfer: tf.transfer, camera: camera.camera }, set: { size: [512, 512] } }
)";

// Long enough to be measured beside, and cancelled at its end.
const char* const kLong = R"(  - { id: truth, type: reference.raycast, in: { source: head.volume, transfer: tf.transfer, camera: camera.camera }, set: { size: [2048, 2048] } }
)";

std::string many_nodes(int count) {
    std::string text = "voxloom: 1\nnodes:\n";
    for (int i = 0; i < count; ++i) {
        const std::string at = fmt::format("at: [{}, {}]", 280 * (i % 25), 180 * (i / 25));
        text += i % 25 == 0 ? fmt::format("  - {{ id: n{}, type: readers.phantom, set: {{ dims: [8, 8, 8] }}, {} }}\n", i, at)
                            : fmt::format("  - {{ id: n{}, type: scene.transfer, in: {{ fit: n{}.volume }}, {} }}\n", i, i - i % 25, at);
    }
    return text;
}

struct Bench {
    fs::path folder;
    VirtualDisplay display{1280, 720};

    EditorProcess open(const std::string& name, const std::string& text) {
        const fs::path graph = folder / (name + ".yaml");
        std::ofstream(graph) << text;
        return {display, folder / name, {graph.string(), "--size", "1280x720"}};
    }
};

void print_frames(const char* what, const json& s) {
    fmt::print("{:<34} frame median {:6.1f} ms, p99 {:6.1f} ms; of the window's thread {:5.1f} and {:5.1f} ms\n", what,
               1e3 * s["frame_seconds"]["median"].get<double>(), 1e3 * s["frame_seconds"]["p99"].get<double>(),
               1e3 * s["frame_cpu_seconds"]["median"].get<double>(), 1e3 * s["frame_cpu_seconds"]["p99"].get<double>());
    std::fflush(stdout);
}

bool is_final(const json& s) { return !s["busy"].get<bool>() && s["values"].contains("view.image") && s["values"]["view.image"]["fresh"].get<bool>(); }

void measure_slider(Bench& bench) {
    EditorProcess editor = bench.open("slider", kPicture);
    editor.wait_for("a picture", is_final);
    editor.click("node:camera");
    editor.move_to("param:camera.azimuth", 0.3);
    std::vector<double> first, whole;
    for (int i = 0; i < 12; ++i) {
        const int serial = editor.wait_for("a picture", is_final)["values"]["view.image"]["serial"];
        editor.press();
        editor.move_by(i % 2 ? -25 - i : 27 + i, 0);  // never to where it was: that is kept
        const auto seen = [&](const json& now) { return now["values"]["view.image"]["serial"].get<int>() > serial; };
        first.push_back(editor.wait_for("another picture", seen)["first_picture_seconds"]);
        editor.release();
        const auto released = std::chrono::steady_clock::now();
        editor.wait_for("the final picture", is_final);
        whole.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - released).count());
    }
    std::ranges::sort(first);
    std::ranges::sort(whole);
    fmt::print("{:<34} first coarse picture {:.1f} ms (worst {:.1f}); final, after the button is let go, {:.1f} ms (worst {:.1f})\n",
               "slider, 128^3 at 512 x 512", 1e3 * voxloom::quantile(first, 0.5), 1e3 * first.back(),
               1e3 * voxloom::quantile(whole, 0.5), 1e3 * whole.back());
    std::fflush(stdout);
}

// Moves the pointer for a while, so that frames are drawn; what is shown then is of these frames.
json wiggle(EditorProcess& editor, int times) {
    for (int i = 0; i < times; ++i) editor.move_by(i % 2 ? -40 : 40, i % 3 ? 20 : -40);
    return editor.wait_for("a frame", [](const json&) { return true; });
}

void measure_long(Bench& bench) {
    std::string text = std::string(kPicture) + kLong;
    text.replace(text.find("[view.image]"), 12, "[view.image, truth.image]");
    EditorProcess editor = bench.open("long", text);
    auto runs = [](const json& s) { return s.contains("states") && s["states"].value("truth", "") == "running"; };
    editor.wait_for("the long node", runs);
    editor.move_to("canvas", 0.5, 0.8);
    const json s = wiggle(editor, 60);
    print_frames(runs(s) ? "while a long node runs" : "the long node ended too early", s);
}

void measure_many(Bench& bench) {
    EditorProcess editor = bench.open("many", many_nodes(500));
    editor.wait_for("500 nodes", [](const json& s) { return !s["busy"].get<bool>() && s.contains("states") && s["states"].size() == 500; });
    editor.move_to("canvas", 0.5, 0.5);
    editor.press(2);
    for (int i = 0; i < 60; ++i) editor.move_by(i % 4 < 2 ? 30 : -30, i % 2 ? 15 : -15);
    editor.release(2);
    for (int i = 0; i < 40; ++i) {
        editor.press(i % 20 < 10 ? 4 : 5);  // the wheel
        editor.release(i % 20 < 10 ? 4 : 5);
    }
    print_frames("500 nodes, moved and zoomed", editor.wait_for("a frame", [](const json&) { return true; }));
}

}  // namespace

int main(int argc, char** argv) {
    try {
        if (std::string missing = voxloom::testing::why_no_display(); !missing.empty()) voxloom::fail("{}", missing);
        Bench bench{argc > 1 ? fs::path(argv[1]) : fs::temp_directory_path() / fmt::format("bench-editor-{}", getpid())};
        fs::create_directories(bench.folder);
        measure_slider(bench);
        measure_many(bench);
        measure_long(bench);
    } catch (const std::exception& e) {
        fmt::print(stderr, "bench-editor: {}\n", e.what());
        return 1;
    }
}
