// The editor as people meet it: a window, a mouse and keys.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>

#include "core/graph/document.h"
#include "tests/support/volumes.h"
#include "tests/window/screen.h"

namespace voxloom {
namespace {

using ::testing::HasSubstr;
using testing::EditorProcess;
using testing::VirtualDisplay;
namespace fs = std::filesystem;
using nlohmann::json;

const char* const kGraph = R"(voxloom: 1
# A small head, drawn and written.
outputs: [view.image]
nodes:
  - id: head
    type: readers.phantom
    set: { kind: ct-head, dims: [32, 32, 32], type: u16 }
    at: [0, 0]
  - id: tf
    type: scene.transfer
    in:  { fit: head.volume }
    set: { preset: materials }
    at: [220, 120]
  - id: camera
    type: scene.camera
    in:  { fit: head.volume }
    set: { azimuth: 40, framing: box }
    at: [220, 240]
  - id: view
    type: slicer.render
    in:  { source: head.volume, transfer: tf.transfer, camera: camera.camera }
    set: { size: [120, 120] }
    at: [480, 0]
  - id: file
    type: writers.image
    in:  { image: view.image }
    set: { path: picture.png }
    at: [740, 60]
)";

struct Window : ::testing::Test {
    testing::TempFolder folder;

    void SetUp() override {
        if (std::string missing = testing::why_no_display(); !missing.empty()) GTEST_SKIP() << missing;
        std::ofstream(folder.path() / "graph.yaml") << kGraph;
    }
    fs::path graph() const { return folder.path() / "graph.yaml"; }
    static std::string slurp(const fs::path& file) {
        std::ifstream in(file, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }
    static bool shows_final(const json& s, const std::string& port) {
        return !s["busy"].get<bool>() && s.contains("values") && s["values"].contains(port) && s["values"][port]["fresh"].get<bool>();
    }
    // Kept beside the build, for people to look at.
    static void keep(const fs::path& picture, const std::string& name) {
        const fs::path to = fs::path(VOXLOOM_BINARY_DIR) / "screenshots";
        fs::create_directories(to);
        fs::copy_file(picture, to / (name + ".png"), fs::copy_options::overwrite_existing);
    }
};

TEST_F(Window, aGraphIsOpenedTunedUndoneSavedAndRunsToTheSamePicture) {
    VirtualDisplay display(1280, 720);
    EditorProcess editor(display, folder.path() / "e", {graph().string(), "--size", "1280x720"});
    editor.wait_for("a picture", [](const json& s) {
        EXPECT_TRUE(s["busy"].get<bool>() || shows_final(s, "view.image")) << "it is not at rest before";
        return shows_final(s, "view.image");
    });

    editor.click("node:camera");
    json s = editor.with("param:camera.azimuth");
    EXPECT_EQ(s["selected"], json::array({"camera"}));
    EXPECT_FALSE(s["changed"].get<bool>());
    const auto serial = s["values"]["view.image"]["serial"].get<int>();
    editor.move_to("param:camera.azimuth", 0.3);
    editor.press();
    editor.move_by(60, 0);
    editor.move_by(30, 0);
    editor.release();
    s = editor.wait_for("the picture of the change", [&](const json& now) {
        return now["changed"].get<bool>() && shows_final(now, "view.image") && now["values"]["view.image"]["serial"] > serial;
    });
    const std::string changed = s["text"];
    EXPECT_NE(changed, kGraph);
    EXPECT_THAT(changed, HasSubstr("# A small head, drawn and written."));

    editor.key("z", "ctrl");
    s = editor.wait_for("undo", [&](const json& now) { return now["text"] != changed; });
    EXPECT_EQ(s["text"], kGraph) << "one drag is one step";
    editor.key("y", "ctrl");
    editor.wait_for("redo", [&](const json& now) { return now["text"] == changed; });
    editor.key("s", "ctrl");
    editor.wait_for("saving", [](const json& now) { return !now["changed"].get<bool>(); });
    EXPECT_EQ(slurp(graph()), changed);

    editor.idle();
    editor.key("F5");
    const fs::path written = folder.path() / "e/out/picture.png";
    editor.wait_for("the written picture", [&](const json& now) { return fs::exists(written) && !now["busy"].get<bool>(); });
    const std::string run = VOXLOOM_BINARY_DIR "/bin/voxloom run --quiet " + graph().string() + " --output file --out " +
                            (folder.path() / "headless").string() + " >/dev/null 2>&1";
    ASSERT_EQ(std::system(run.c_str()), 0);
    EXPECT_EQ(slurp(written), slurp(folder.path() / "headless/picture.png"));
    EXPECT_GT(fs::file_size(written), 1000u);

    keep(editor.screenshot(), "edited-1280x720");
    editor.key("q", "ctrl");
    EXPECT_EQ(editor.wait(), 0);
}

TEST_F(Window, nodesAreBypassedDisabledGroupedAndCommentedOn) {
    std::string text = kGraph;
    text.replace(text.find("source: head.volume, transfer"), 19, "source: code.bricks");
    text += "  - id: code\n    type: wavelet.encode\n    in:  { volume: head.volume }\n    at: [220, -120]\n";
    std::ofstream(graph()) << text;
    VirtualDisplay display(1280, 720);
    EditorProcess editor(display, folder.path() / "e", {graph().string(), "--size", "1280x720"});
    editor.wait_for("a picture", [](const json& s) { return shows_final(s, "view.image"); });
    editor.click("node:code");
    editor.key("b");
    json s = editor.wait_for("the picture without the codec", [](const json& now) {
        return now["text"].get<std::string>().find("use: bypassed") != std::string::npos && shows_final(now, "view.image");
    });
    EXPECT_EQ(s["problems"], 0);
    EXPECT_EQ(s["states"]["code"], "not asked");
    editor.click("node:tf");
    editor.key("d");
    s = editor.wait_for("what is left", [](const json& now) { return !now["busy"].get<bool>() && now["states"]["view"] == "not asked"; });
    EXPECT_EQ(s["problems"], 1) << "the graph is run for nothing but the picture";
    keep(editor.screenshot(), "disabled");
    editor.click("node:view");
    editor.click("action:bypass");
    s = editor.wait_for("a problem", [](const json& now) { return now["states"]["view"] == "failed"; });
    for (int i = 0; i < 3; ++i) editor.key("z", "ctrl");
    s = editor.wait_for("undo", [&](const json& now) { return now["text"] == text && shows_final(now, "view.image"); });

    editor.click("node:tf");
    editor.press_with("shift", "node:camera");
    editor.key("g");
    editor.with("note");
    editor.type("Scene");
    editor.key("Return");
    editor.wait_for("a group", [](const json& now) { return now["text"].get<std::string>().find("groups: [[Scene, camera, tf]]") != std::string::npos; });
    editor.move_to("canvas", 0.3, 0.9);
    editor.key("n");
    editor.with("note");
    editor.type("Materials of a head.");
    editor.key("Return");
    editor.wait_for("a comment", [](const json& now) { return now["text"].get<std::string>().find("\"Materials of a head.\"") != std::string::npos; });
    // The title takes the nodes along, and they are one step.
    const std::string before = editor.idle()["text"];
    editor.drag("group:0", "comment:0");
    s = editor.wait_for("a move", [&](const json& now) { return now["text"] != before; });
    const Graph moved = Document::parse(s["text"]).graph();
    EXPECT_NE(*moved.find("tf")->at, glm::dvec2(220, 120));
    EXPECT_EQ(*moved.find("camera")->at - *moved.find("tf")->at, glm::dvec2(0, 120));
    EXPECT_EQ(*moved.find("view")->at, glm::dvec2(480, 0));
    keep(editor.screenshot(), "notes");
    for (int i = 0; i < 5; ++i) editor.key("z", "ctrl");
    EXPECT_EQ(editor.idle()["text"], text);
}

TEST_F(Window, aWrongWireIsRefusedWithItsReason) {
    VirtualDisplay display(1280, 720);
    EditorProcess editor(display, folder.path() / "e", {graph().string(), "--size", "1280x720"});
    editor.idle();
    editor.drag("out:camera.camera", "in:view.source");
    json s = editor.with("message");
    EXPECT_THAT(s["message"].get<std::string>(), HasSubstr("takes Volume or Bricks, and this is Camera"));
    EXPECT_EQ(s["text"], kGraph);
    keep(editor.screenshot(), "refused");
}

TEST_F(Window, aPipelineIsBuiltFromAnEmptyCanvas) {
    VirtualDisplay display(1280, 720);
    EditorProcess editor(display, folder.path() / "e", {"--size", "1280x720"});
    editor.with("start:new");
    keep(editor.screenshot(), "start");
    editor.click("start:new");
    editor.key("Tab");
    editor.with("add-query");
    editor.type("phantom");
    keep(editor.screenshot(), "add");
    editor.key("Return");
    editor.with("node:phantom");
    // A wire dropped in empty space offers what fits.
    editor.move_to("out:phantom.volume");
    editor.press();
    editor.move_by(5, 5);
    editor.move_by(120, 60);
    editor.release();
    json s = editor.with("add-query");
    EXPECT_FALSE(s["items"].contains("add:scene.lights")) << "nothing there takes a volume";
    editor.type("transfer");
    editor.key("Return");
    s = editor.wait_for("the transfer function", [](const json& now) { return now["items"].contains("node:transfer"); });
    EXPECT_THAT(s["text"].get<std::string>(), HasSubstr("fit: phantom.volume"));
    for (int i = 0; i < 3; ++i) editor.key("z", "ctrl");
    s = editor.idle();
    EXPECT_EQ(s["text"], Document().text());
}

TEST_F(Window, unsavedChangesAreAskedFor) {
    VirtualDisplay display(1280, 720);
    EditorProcess editor(display, folder.path() / "e", {graph().string(), "--size", "1280x720"});
    editor.idle();
    editor.click("node:tf");
    editor.key("Delete");
    editor.wait_for("a change", [](const json& s) { return s["changed"].get<bool>(); });
    editor.key("q", "ctrl");
    editor.click("changes:cancel");
    editor.key("q", "ctrl");
    editor.click("changes:save");
    EXPECT_EQ(editor.wait(), 0);
    EXPECT_EQ(Document::load(graph()).graph().find("tf"), nullptr);
}

TEST_F(Window, aCrashLosesNothing) {
    VirtualDisplay display(1280, 720);
    std::string unsaved;
    {
        EditorProcess editor(display, folder.path() / "e", {graph().string(), "--size", "1280x720"});
        editor.idle();
        editor.click("node:tf");
        editor.key("Delete");
        unsaved = editor.wait_for("a change", [](const json& s) { return s["changed"].get<bool>(); })["text"];
        for (int i = 0; i < 400 && !fs::exists(folder.path() / "e/state/voxloom"); ++i) usleep(25000);
        editor.kill();
    }
    EXPECT_EQ(slurp(graph()), kGraph);
    EditorProcess editor(display, folder.path() / "e", {graph().string(), "--size", "1280x720"});
    editor.with("recovery:recover");
    keep(editor.screenshot(), "recovery");
    editor.click("recovery:recover");
    const json s = editor.wait_for("what was not saved", [&](const json& now) { return now["text"] == unsaved; });
    EXPECT_TRUE(s["changed"].get<bool>());
    EXPECT_EQ(s["file"], fs::absolute(graph()).string());
}

TEST_F(Window, theHandTurnsThePicture) {
    VirtualDisplay display(1280, 720);
    EditorProcess editor(display, folder.path() / "e", {graph().string(), "--size", "1280x720"});
    json s = editor.wait_for("a picture", [](const json& now) { return shows_final(now, "view.image"); });
    const auto serial = s["values"]["view.image"]["serial"].get<int>();
    editor.move_to("picture");
    editor.press();
    editor.move_by(40, 10);
    editor.move_by(40, 10);
    s = editor.wait_for("another picture while the button is held", [&](const json& now) {
        return now["values"]["view.image"]["serial"] > serial;
    });
    editor.release();
    s = editor.wait_for("the final picture", [](const json& now) { return shows_final(now, "view.image"); });
    EXPECT_NE(s["text"], kGraph);
    EXPECT_THAT(s["text"].get<std::string>(), HasSubstr("elevation:"));
    editor.move_to("picture", 0.5, 0.45);  // the skull
    s = editor.wait_for("the voxel under the pointer", [](const json& now) { return !now["picked"].get<std::string>().empty(); });
    EXPECT_THAT(s["picked"].get<std::string>(), HasSubstr("   value "));
    keep(editor.screenshot(), "picked");
    editor.move_to("picture", 0.1, 0.6);  // beside it
    editor.wait_for("nothing", [](const json& now) { return now["picked"].get<std::string>().empty(); });
    editor.key("z", "ctrl");
    editor.wait_for("undo", [](const json& now) { return now["text"] == kGraph; });
    editor.key("7");
    editor.wait_for("the view from above", [](const json& now) { return now["text"].get<std::string>().find("elevation: 90") != std::string::npos; });
}

TEST_F(Window, aPresetIsTurnedIntoPointsThatAreDragged) {
    VirtualDisplay display(1280, 720);
    EditorProcess editor(display, folder.path() / "e", {graph().string(), "--size", "1280x720"});
    editor.wait_for("a picture", [](const json& now) { return shows_final(now, "view.image"); });
    editor.click("node:tf");
    json s = editor.with("gradients");
    const double panel_ends = s["items"]["state"][1];  // where the status bar begins
    EXPECT_LE(s["items"]["gradients"][3].get<double>(), panel_ends) << "seen without scrolling";
    EXPECT_LE(s["items"]["transfer:tf"][3].get<double>(), panel_ends);
    editor.click("gradients");
    keep(editor.screenshot(), "gradients");
    editor.click("gradients");
    editor.click("into-points");
    s = editor.with("point:tf.4");
    EXPECT_THAT(s["text"].get<std::string>(), HasSubstr("preset: none"));
    const std::string before = s["text"];
    editor.move_to("point:tf.4");
    editor.press();
    editor.move_by(0, -15);
    editor.move_by(4, -5);
    editor.release();
    s = editor.wait_for("another point", [&](const json& now) { return now["text"] != before && shows_final(now, "view.image"); });
    EXPECT_EQ(s["problems"], 0);
    keep(editor.screenshot(), "transfer");
}

TEST_F(Window, picturesOfTwoBranchesAreComparedWithLinkedCameras) {
    std::string text = kGraph;
    text += R"(  - id: other-camera
    type: scene.camera
    in:  { fit: head.volume }
    set: { azimuth: 40, framing: box }
    at: [220, 360]
  - id: coarse
    type: slicer.render
    in:  { source: head.volume, transfer: tf.transfer, camera: other-camera.camera }
    set: { size: [120, 120], slice_distance: 4 }
    at: [480, 280]
  - id: error
    type: metrics.image
    in:  { image: coarse.image, reference: view.image }
    at: [740, 200]
)";
    text.replace(text.find("[view.image]"), 12, "[view.image, coarse.image, error.table]");
    std::ofstream(graph()) << text;
    VirtualDisplay display(1280, 720);
    EditorProcess editor(display, folder.path() / "e", {graph().string(), "--size", "1280x720"});
    auto both = [](const json& s) { return shows_final(s, "view.image") && shows_final(s, "coarse.image"); };
    editor.wait_for("two pictures", both);
    editor.key("c");
    editor.with("picture:1");
    editor.move_to("picture:0", 0.5, 0.6);
    editor.press();
    editor.move_by(20, 0);
    editor.move_by(20, 0);
    editor.release();
    const json s = editor.wait_for("two other pictures", [&](const json& now) { return now["text"] != text && both(now); });
    const Document turned = Document::parse(s["text"]);
    auto azimuth = [&](const char* id) { return turned.graph().find(id)->params.at(0).yaml.text; };
    EXPECT_NE(azimuth("camera"), "40");
    EXPECT_EQ(azimuth("camera"), azimuth("other-camera"));
    keep(editor.screenshot(), "two");
    editor.key("c");
    editor.move_to("picture:0", 0.5, 0.5);
    keep(editor.screenshot(), "wipe");
    editor.key("c");
    editor.wait_for("the difference", both);
    keep(editor.screenshot(), "difference");
    editor.key("c");
    editor.wait_for("one picture", [](const json& now) { return now["shown"].size() == 1; });
    editor.click("picture-port:0");
    editor.click("show:error.table");
    editor.wait_for("the table", [](const json& now) { return now["shown"] == json::array({"error.table"}) && shows_final(now, "error.table"); });
    keep(editor.screenshot(), "table");
}

TEST_F(Window, codecsAreComparedInNumbersSweptAndGoneBackTo) {
    const std::string text = R"(voxloom: 1
outputs: [a-view.image, b-view.image]
nodes:
  - { id: head, type: readers.phantom, set: { kind: ct-head, dims: [24, 24, 24], type: u8 } }
  - { id: a, type: wavelet.encode, in: { volume: head.volume }, set: { target: max-error, max_error: 8 } }
  - { id: b, type: wavelet.encode, in: { volume: head.volume }, set: { target: max-error, max_error: 2 } }
  - { id: tf, type: scene.transfer, in: { fit: head.volume } }
  - { id: camera, type: scene.camera, in: { fit: head.volume } }
  - { id: a-view, type: slicer.render, in: { source: a.bricks, transfer: tf.transfer, camera: camera.camera }, set: { size: [48, 48] } }
  - { id: b-view, type: slicer.render, in: { source: b.bricks, transfer: tf.transfer, camera: camera.camera }, set: { size: [48, 48] } }
)";
    std::ofstream(graph()) << text;
    VirtualDisplay display(1280, 720);
    EditorProcess editor(display, folder.path() / "e", {graph().string(), "--size", "1280x720"});
    editor.wait_for("a picture", [](const json& s) { return shows_final(s, "a-view.image"); });
    editor.key("c");
    auto share_of_pictures = [](const json& now) {
        const double top = now["items"]["picture"][1], bottom = now["items"]["picture"][3], all = now["items"]["split:y"][1];
        return (bottom - top) / (all - top);
    };
    const double beside_numbers = share_of_pictures(editor.with("compare-table"));
    EXPECT_GT(beside_numbers, 0.5);
    editor.click("numbers");
    EXPECT_GT(share_of_pictures(editor.wait_for("no numbers", [](const json& s) { return !s["items"].contains("compare-table"); })), beside_numbers + 0.25);
    editor.key("c", "shift");
    editor.with("compare-table");
    editor.wait_for("two settings", [](const json& s) { return s["tried"] == 2; });
    editor.click("sweep:a");
    json s = editor.wait_for("the sweep's end", [](const json& now) { return !now["sweeping"].get<bool>() && !now["busy"].get<bool>() && now["tried"].get<int>() > 5; });
    EXPECT_EQ(s["text"], text) << "a sweep leaves the graph as it is";
    s = editor.wait_for("the document's picture again", [](const json& now) { return shows_final(now, "a-view.image"); });
    keep(editor.screenshot(), "compare-numbers");
    editor.click("tried:3");
    s = editor.wait_for("the parameters of a point", [&](const json& now) { return now["text"] != text && shows_final(now, "a-view.image"); });
    EXPECT_NE(Document::parse(s["text"]).graph().find("a")->params.at(1).yaml.text, "8");
    editor.key("z", "ctrl");
    editor.wait_for("undo", [&](const json& now) { return now["text"] == text; });
}

TEST_F(Window, aCuttingPlaneIsMovedAndTurnedInItsPicture) {
    const std::string text = R"(voxloom: 1
nodes:
  - { id: head, type: readers.phantom, set: { kind: ct-head, dims: [32, 32, 32], type: u8 } }
  - { id: pyramid, type: bricks.pyramid, in: { volume: head.volume } }
  - { id: tf, type: scene.transfer, in: { fit: head.volume }, set: { preset: ramp } }
  - { id: camera, type: scene.camera, in: { fit: head.volume }, set: { azimuth: 40, framing: box } }
  - { id: cut, type: slicer.plane, in: { source: pyramid.bricks, transfer: tf.transfer, camera: camera.camera }, set: { size: [100, 100] } }
)";
    std::ofstream(graph()) << text;
    VirtualDisplay display(1280, 720);
    EditorProcess editor(display, folder.path() / "e", {graph().string(), "--size", "1280x720"});
    editor.wait_for("a picture", [](const json& s) { return shows_final(s, "cut.image"); });
    auto drag = [&](const char* handle) {
        editor.move_to(handle);
        editor.press();
        editor.move_by(6, 12);
        editor.move_by(6, 12);
        editor.release();
        return editor.wait_for("another picture", [](const json& now) { return now["changed"].get<bool>() && shows_final(now, "cut.image"); })["text"].get<std::string>();
    };
    EXPECT_THAT(drag("plane:move"), HasSubstr("origin: [0.5, 0.5,"));
    editor.key("z", "ctrl");
    editor.wait_for("undo", [&](const json& now) { return now["text"] == text; });
    EXPECT_THAT(drag("plane:turn"), HasSubstr("normal: ["));
    keep(editor.screenshot(), "plane");
    editor.key("F11");
    const json s = editor.with("message");
    EXPECT_THAT(s["message"].get<std::string>(), HasSubstr("picture-"));
}

// As somebody who has read nothing: every click, key and typed word counts.
TEST_F(Window, aNewcomerComparesTwoCodecsOnTheEngineInFewActions) {
    VOXLOOM_NEEDS_DATA(data);
    VirtualDisplay display(1600, 900);
    EditorProcess editor(display, folder.path() / "e", {"--size", "1600x900"});
    int actions = 0;
    auto click = [&](const std::string& item) {
        editor.click(item);
        ++actions;
    };
    click("example:codecs.yaml");
    click("node:ct");
    editor.click("param:ct.path", 0.1);
    editor.key("a", "ctrl");
    editor.type((data / "engine.nrrd").string());
    editor.key("Return");
    actions += 4;
    auto both = [](const json& s) { return shows_final(s, "wavelet-view.image") && shows_final(s, "zfp-view.image"); };
    json s = editor.wait_for("two pictures", both);
    EXPECT_THAT(s["text"].get<std::string>(), HasSubstr("engine.nrrd"));
    editor.key("c");  // side by side
    ++actions;
    click("node:wavelet");
    editor.click("param:wavelet.max_error");
    ++actions;
    editor.move_to("picture:0", 0.4, 0.6);
    editor.press();
    editor.move_by(60, 0);
    editor.release();
    ++actions;
    editor.wait_for("the turned pictures", both);
    keep(editor.screenshot(), "newcomer-pictures");
    for (std::size_t left = 3; left-- > 0;) editor.key("c");
    editor.wait_for("one picture", [](const json& now) { return now["shown"].size() == 1; });
    click("picture-port:0");
    click("show:errors.table");
    actions += 3;
    s = editor.wait_for("the table", [](const json& now) { return now["shown"] == json::array({"errors.table"}) && shows_final(now, "errors.table"); });
    EXPECT_EQ(s["problems"], 0);
    EXPECT_LE(actions, 25);
    keep(editor.screenshot(), "newcomer-table");
}

// The example as people first see it; its picture is the one in docs/pictures.
TEST_F(Window, theExampleOfCodecsIsDrawnAsItStandsInTheDocs) {
    if (!fs::exists("/usr/share/mricron/templates/ch2.nii.gz")) GTEST_SKIP() << "mricron-data is not installed";
    VirtualDisplay display(1280, 720);
    EditorProcess editor(display, folder.path() / "e", {VOXLOOM_SOURCE_DIR "/graphs/codecs.yaml", "--size", "1280x720"});
    auto everything = [](const json& s) {
        return shows_final(s, "wavelet-view.image") && shows_final(s, "zfp-view.image") && shows_final(s, "errors.table");
    };
    editor.wait_for("the first picture", everything);
    editor.key("c");
    editor.click("node:tf");
    editor.move_to("picture:0", 0.5, 0.6);
    const json s = editor.wait_for("both pictures and a voxel", [&](const json& now) {
        return everything(now) && !now["picked"].get<std::string>().empty();
    });
    EXPECT_EQ(s["problems"], 0);
    auto measured = [](const json& now) {
        return now["numbers"].size() == 2 && std::ranges::all_of(now["numbers"], [](const json& n) { return n.size() == 9; });
    };
    const json numbers = editor.wait_for("every number of both", measured)["numbers"];
    EXPECT_EQ(numbers[0]["image_rmse"], 0) << "it is the reference";
    EXPECT_GT(numbers[1]["image_rmse"], 0);
    for (const json& n : numbers) {
        EXPECT_LE(n["max_error"], 8) << "as the graph asks for";
        for (const char* time : {"encode", "decode", "frame"}) EXPECT_GT(n[time], 0) << time;
    }
    for (const auto& [a, r] : s["items"].items())
        for (const auto& [b, q] : s["items"].items()) {
            if (a >= b || !a.starts_with("node:") || !b.starts_with("node:")) continue;
            EXPECT_TRUE(r[2] <= q[0] || q[2] <= r[0] || r[3] <= q[1] || q[3] <= r[1]) << a << " lies on " << b;
        }
    keep(editor.screenshot(), "editor");
    editor.click("reference:1");
    editor.wait_for("the other reference", [](const json& now) { return now["numbers"][1].value("image_rmse", -1.0) == 0 && now["numbers"][0].value("image_rmse", 0.0) > 0; });
    editor.click("against");
    keep(editor.screenshot(), "against");
    editor.click("against:uncompressed");
    const json without = editor.wait_for("both against the volume itself", [](const json& now) {
        return std::ranges::all_of(now["numbers"], [](const json& n) { return n.value("image_rmse", 0.0) > 0; });
    });
    EXPECT_EQ(without["problems"], 0);
    EXPECT_EQ(without["text"], s["text"]) << "the graph stays as it is";
    keep(editor.screenshot(), "uncompressed");
}

TEST_F(Window, aNodeThatIsDroppedOnAWireGoesIntoIt) {
    const std::string text = R"(voxloom: 1
outputs: [view.image]
nodes:
  - { id: head, type: readers.phantom, set: { kind: ct-head, dims: [24, 24, 24], type: u8 }, at: [0, 0] }
  - { id: tf, type: scene.transfer, in: { fit: head.volume }, at: [220, 200] }
  - { id: camera, type: scene.camera, in: { fit: head.volume }, at: [220, 400] }
  - { id: view, type: slicer.render, in: { source: head.volume, transfer: tf.transfer, camera: camera.camera }, set: { size: [48, 48] }, at: [700, 0] }
  - { id: code, type: wavelet.encode, at: [420, 520] }
)";
    std::ofstream(graph()) << text;
    VirtualDisplay display(1280, 720);
    EditorProcess editor(display, folder.path() / "e", {graph().string(), "--size", "1280x720"});
    editor.wait_for("a picture", [](const json& s) { return shows_final(s, "view.image"); });
    const json items = editor.with("node:code")["items"];
    auto middle = [&](const char* a, const char* b, int k) { return int((items[a][k].get<double>() + items[a][k + 2].get<double>() + items[b][k].get<double>() + items[b][k + 2].get<double>()) / 4); };
    editor.move_to("node:code");
    editor.press();
    editor.move_by(3, 3);
    editor.move_by(middle("out:head.volume", "in:view.source", 0) - middle("node:code", "node:code", 0) - 3,
                   middle("out:head.volume", "in:view.source", 1) - middle("node:code", "node:code", 1) - 3);
    editor.release();
    json s = editor.wait_for("the codec in the wire", [](const json& now) { return now["text"].get<std::string>().find("source: code.bricks") != std::string::npos && shows_final(now, "view.image"); });
    EXPECT_THAT(s["text"].get<std::string>(), HasSubstr("in: { volume: head.volume }"));
    EXPECT_EQ(s["problems"], 0);
    editor.key("z", "ctrl");
    editor.wait_for("undo of both at once", [&](const json& now) { return now["text"] == text; });
}

TEST_F(Window, theMapGoesWhereItIsClicked) {
    VirtualDisplay display(1280, 720);
    EditorProcess editor(display, folder.path() / "e", {graph().string(), "--size", "1280x720"});
    const json whole = editor.wait_for("a picture", [](const json& s) { return shows_final(s, "view.image"); });
    EXPECT_FALSE(whole["items"].contains("map")) << "all is seen";
    editor.move_to("node:head");
    for (int i = 0; i < 12; ++i) editor.press(4), editor.release(4);  // the wheel
    editor.wait_for("a near view", [](const json& now) { return now["items"].contains("map") && now["items"]["node:file"][0] > 1280; });
    auto shows = [](const json& now, const char* node) { return now["items"][node][0] < 768 && now["items"][node][2] > 0; };
    editor.click("map", 0.9, 0.4);
    editor.wait_for("the other end", [&](const json& now) { return shows(now, "node:file") && !shows(now, "node:head"); });
    editor.move_to("map", 0.9, 0.4);
    editor.press();
    editor.move_by(-60, 0);
    editor.move_by(-60, 0);
    const json back = editor.wait_for("the first end", [&](const json& now) { return shows(now, "node:head") && !shows(now, "node:file"); });
    editor.release();
    EXPECT_EQ(back["selected"], json::array());
    EXPECT_EQ(back["text"], kGraph);
}

TEST_F(Window, oneOfSeveralIsChosenByAClickAndKnobsAreThereWithoutAChoice) {
    VirtualDisplay display(1280, 720);
    EditorProcess editor(display, folder.path() / "e", {graph().string(), "--size", "1280x720"});
    editor.wait_for("a picture", [](const json& s) { return shows_final(s, "view.image"); });
    editor.with("param:view.slice_distance");
    editor.click("node:camera");
    editor.press_with("shift", "node:tf");
    editor.wait_for("two", [](const json& now) { return now["selected"] == json::array({"camera", "tf"}); });
    editor.click("node:tf");
    editor.wait_for("one", [](const json& now) { return now["selected"] == json::array({"tf"}); });
    editor.click("canvas", 0.02, 0.02);
    editor.wait_for("none", [](const json& now) { return now["selected"] == json::array(); });
    editor.click("knobs:view");
    editor.wait_for("the node of the knobs", [](const json& now) { return now["selected"] == json::array({"view"}); });
    editor.key("space", "ctrl");
    editor.wait_for("a large picture", [](const json& now) {
        return !now["items"].contains("canvas") && now["items"]["picture:0"][2] > 900 && now["items"].contains("param:view.slice_distance");
    });
    keep(editor.screenshot(), "large-picture");
    editor.key("space", "ctrl");
    EXPECT_EQ(editor.with("canvas")["text"], kGraph);
}

TEST_F(Window, keysThatAreFasterThanFramesAreNotLost) {
    VirtualDisplay display(1280, 720);
    EditorProcess editor(display, folder.path() / "e", {graph().string(), "--size", "1280x720"});
    editor.wait_for("a picture", [](const json& s) { return shows_final(s, "view.image"); });
    auto often = [](const std::string& key, int times) {
        std::string keys;
        for (int i = 0; i < times; ++i) keys += key + " ";
        return keys;
    };
    editor.click("node:tf");
    editor.keys_at_once(often("d", 15));  // off, on, off, …
    editor.wait_for("a disabled node", [](const json& now) { return now["resting"].get<bool>() && now["text"] != kGraph; });
    editor.keys_at_once(often("ctrl+z", 14));
    editor.wait_for("the first of the changes", [](const json& now) { return now["resting"].get<bool>() && now["text"] != kGraph; });
    editor.keys_at_once("ctrl+z");
    editor.wait_for("no change", [](const json& now) { return now["text"] == kGraph; });
    // What is typed waits for the field that its first key opens.
    editor.keys_at_once("Tab p h a n t o m Return");
    const json s = editor.with("node:phantom");
    EXPECT_TRUE(s["items"].contains("node:tf")) << "letters are no keys while a text is typed";
    editor.keys_at_once("F11 F12");
    auto written = [&](const std::string& begin) {
        std::error_code none;
        for (const auto& entry : fs::directory_iterator(folder.path() / "e/out", none))
            if (entry.path().filename().string().starts_with(begin)) return true;
        return false;
    };
    editor.wait_for("both pictures", [&](const json&) { return written("picture-") && written("screenshot-"); });
}

TEST_F(Window, aPointerThatRestsIsToldWhatItRestsOn) {
    VirtualDisplay display(1280, 720);
    EditorProcess editor(display, folder.path() / "e", {graph().string(), "--size", "1280x720"});
    editor.idle();
    editor.move_to("node:tf");
    editor.with("tooltip");
    keep(editor.screenshot(), "tooltip");
    editor.move_to("canvas", 0.02, 0.02);
    editor.wait_for("no tooltip", [](const json& s) { return !s["items"].contains("tooltip"); });
}

// However long the button was held, and nothing happens behind it.
TEST_F(Window, aQuestionIsDrawnToItsEndBeforeTheWindowRests) {
    VirtualDisplay display(1280, 720);
    EditorProcess editor(display, folder.path() / "e", {graph().string(), "--size", "1280x720"});
    editor.idle();
    editor.click("node:tf");
    editor.key("Delete");
    editor.wait_for("a change", [](const json& s) { return s["changed"].get<bool>(); });
    for (int hold = 0; hold < 8; ++hold) {
        editor.move_to("action:new");
        editor.press();
        usleep(useconds_t(hold) * 23000);
        editor.release();
        editor.with("changes:cancel");
        editor.wait_for("rest", [](const json& s) { return s["resting"].get<bool>(); });
        const std::string at_rest = display.screen();
        usleep(600000);
        EXPECT_TRUE(at_rest == display.screen()) << hold;
        if (hold == 7) keep(editor.screenshot(), "question");
        editor.click("changes:cancel");
        editor.wait_for("no question", [](const json& s) { return !s["items"].contains("changes:cancel"); });
    }
}

// Only what changes is drawn and brought to the screen; what many changes leave there is what one drawing of everything does.
TEST_F(Window, theScreenThatIsDrawnInPartsIsTheOneThatIsDrawnAsAWhole) {
    std::string text = kGraph;
    text.replace(text.find("[view.image]"), 12, "[view.image, coarse.image]");
    text += R"(  - id: coarse
    type: slicer.render
    in:  { source: head.volume, transfer: tf.transfer, camera: camera.camera }
    set: { size: [120, 120], slice_distance: 4 }
    at: [480, 280]
)";
    std::ofstream(graph()) << text;
    VirtualDisplay display(1280, 720);
    EditorProcess editor(display, folder.path() / "e", {graph().string(), "--size", "1280x720"});
    editor.wait_for("a picture", [](const json& s) { return shows_final(s, "view.image"); });
    auto screen_at_rest = [&] {
        editor.move_to("canvas", 0.02, 0.98);
        editor.idle();
        editor.wait_for("no message", [](const json& s) { return s["message"] == ""; });
        editor.idle();
        return display.screen();
    };
    for (const char* mode : {"single", "two", "wipe", "difference"}) {
        editor.click("node:camera");
        editor.drag("param:camera.azimuth", "param:camera.elevation");
        editor.key("F1");
        editor.with("help");
        editor.key("F1");
        editor.key("Tab");
        editor.with("add-query");
        editor.type("ph");
        editor.key("Escape");
        editor.drag("node:tf", "node:file");
        editor.drag("picture:0", "state");
        editor.move_to("node:head");
        editor.with("tooltip");
        for (int i = 0; i < 3; ++i) editor.press(4), editor.release(4);  // the wheel
        editor.move_to("action:undo");
        const std::string in_parts = screen_at_rest();
        for (int i = 0; i < 2; ++i) editor.key("t", "ctrl");  // everything has another colour
        EXPECT_TRUE(in_parts == screen_at_rest()) << mode;
        keep(editor.screenshot(), std::string("whole-") + mode);
        editor.key("f");
        editor.key("c");
    }
}

TEST_F(Window, everythingIsReadableOnALargeScreen) {
    VirtualDisplay display(2560, 1440);
    EditorProcess editor(display, folder.path() / "e", {graph().string(), "--size", "2560x1440", "--scale", "1.5"});
    editor.wait_for("a picture", [](const json& s) { return shows_final(s, "view.image"); });
    editor.click("node:view");
    const json s = editor.with("param:view.slice_distance");
    // Everything that has a name lies inside of the window.
    for (const auto& [name, r] : s["items"].items()) {
        if (name.starts_with("param:") || name.starts_with("name:") || name.starts_with("output:") || name == "expert") continue;  // may be scrolled
        EXPECT_GE(r[0].get<double>(), 0) << name;
        EXPECT_GE(r[1].get<double>(), 0) << name;
        EXPECT_LE(r[2].get<double>(), 2560) << name;
        EXPECT_LE(r[3].get<double>(), 1440) << name;
    }
    keep(editor.screenshot(), "large-2560x1440");
    editor.key("F1");
    editor.with("help");
    keep(editor.screenshot(), "help");
}

}  // namespace
}  // namespace voxloom
