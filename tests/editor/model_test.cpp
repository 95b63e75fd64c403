// The editor without its window: what is edited, wired, found, laid out and undone.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <random>

#include "app/editor/model/autosave.h"
#include "app/editor/model/camera_control.h"
#include "app/editor/model/commands.h"
#include "app/editor/model/histogram.h"
#include "app/editor/model/param_values.h"
#include "app/editor/model/search.h"
#include "app/editor/model/settings.h"
#include "app/editor/model/thumbnail.h"
#include "core/base/error.h"
#include "core/data/dense_pyramid.h"
#include "tests/support/fake_nodes.h"
#include "tests/support/volumes.h"

namespace voxloom::editor {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

const Registry& registry() {
    static const Registry& fakes = *new Registry(voxloom::testing::fake_registry());
    return fakes;
}

const NodeType& type(const char* id) { return *registry().find(id); }

Workspace workspace_of(const std::string& text) {
    Workspace work;
    work.document = Document::parse(text);
    work.saved_text = text;
    return work;
}

// source -> add -> table
const char* const kChain = R"(voxloom: 1
# A chain of three.
nodes:
  - id: source
    type: fake.source
    set: { size: 2, value: 3 }  # small
  - id: add
    type: fake.add
    in:  { volume: source.volume }
  - id: table
    type: fake.table
    in:  { source: add.volume }
)";

template <class F>
std::string error_of(F&& f) {
    try {
        f();
    } catch (const Error& e) {
        return e.what();
    }
    return "";
}

// --- wires ---------------------------------------------------------------------------------------

TEST(Wiring, saysWhyAWireIsWrong) {
    Workspace work = workspace_of(kChain);
    auto why = [&](WireEnd from, WireEnd to) { return why_not_wired(work.graph(), registry(), from, to); };
    EXPECT_THAT(why({"source", "volume", {}}, {"table", "source", {}}), IsEmpty());
    EXPECT_THAT(why({"table", "table", {}}, {"source", "volume", {}}), HasSubstr("cycle"));
    EXPECT_THAT(why({"add", "volume", {}}, {"add", "volume", {}}), HasSubstr("itself"));
    work.document.add_node("other", "fake.add");
    EXPECT_THAT(why({"table", "table", {}}, {"other", "volume", {}}), HasSubstr("takes Volume, and this is Table"));
    EXPECT_THAT(why({"gone", "volume", {}}, {"other", "volume", {}}), HasSubstr("not there"));
    EXPECT_THAT(error_of([&] { connect(work, registry(), {"table", "table", {}}, {"other", "volume", {}}); }), HasSubstr("Volume"));
}

TEST(Wiring, portsThatTakeManyKeepTheirWires) {
    Workspace work = workspace_of(kChain);
    const std::string gather = add_node(work, registry(), type("fake.gather"), {0, 0});
    const std::string port = type("fake.gather").inputs.front().key;
    connect(work, registry(), {"source", "volume", {}}, {gather, port, {}});
    connect(work, registry(), {"add", "volume", {}}, {gather, port, {}});
    connect(work, registry(), {"add", "volume", {}}, {gather, port, {}});  // there already
    EXPECT_EQ(work.graph().find(gather)->inputs.at(0).from.size(), 2u);
    disconnect(work, {"source", "volume", {}}, {gather, port, {}});
    ASSERT_EQ(work.graph().find(gather)->inputs.at(0).from.size(), 1u);
    EXPECT_EQ(work.graph().find(gather)->inputs.at(0).from[0].node, "add");
}

TEST(Wiring, offersOnlyWhatFits) {
    for (const Fit& fit : nodes_taking(registry(), PortType::table))
        EXPECT_TRUE(fit.type->find_input(fit.port)->types.has(PortType::table)) << fit.type->id;
    EXPECT_FALSE(nodes_taking(registry(), PortType::volume).empty());
    for (const Fit& fit : nodes_giving(registry(), PortType::volume))
        EXPECT_EQ(type_of(*fit.type->find_output(fit.port)), PortType::volume) << fit.type->id;
}

TEST(Wiring, unknownNodesKeepTheirPorts) {
    Workspace work = workspace_of("voxloom: 1\nnodes:\n  - id: a\n    type: not.here\n    in: { x: b.y }\n"
                                  "  - id: b\n    type: nor.here\n");
    const auto ports = ports_of(work.graph(), registry());
    EXPECT_EQ(ports[0].input("x"), 0);
    EXPECT_EQ(ports[1].output("y"), 0);
    EXPECT_EQ(ports[0].type, nullptr);
}

TEST(Wiring, aNodeGoesIntoAWireInOneStep) {
    Workspace work = workspace_of(kChain);
    const std::string before = work.document.text();
    work.document.add_node("middle", "fake.add");
    const std::string with = work.document.text();
    EXPECT_TRUE(insert_on_wire(work, registry(), "middle", {"add", "volume", {}}, {"table", "source", {}}));
    EXPECT_EQ(work.graph().find("middle")->inputs.at(0).from.at(0).node, "add");
    EXPECT_EQ(work.graph().find("table")->inputs.at(0).from.at(0).node, "middle");
    work.document.undo();
    EXPECT_EQ(work.document.text(), with);
    work.document.undo();
    EXPECT_EQ(work.document.text(), before);
}

// --- nodes ---------------------------------------------------------------------------------------

TEST(Commands, newNodesGetFreeNamesAndPlaces) {
    Workspace work;
    for (int i = 0; i < 12; ++i) add_node(work, registry(), type("fake.add"), {100, 100});
    EXPECT_TRUE(work.graph().find("add"));
    EXPECT_TRUE(work.graph().find("add-12"));
    const auto boxes = boxes_of(work.graph(), ports_of(work.graph(), registry()));
    for (std::size_t i = 0; i < boxes.size(); ++i)
        for (std::size_t k = 0; k < i; ++k)
            EXPECT_FALSE(boxes[i].overlaps(boxes[k].at, boxes[k].at + boxes[k].size)) << i << " " << k;
    EXPECT_EQ(work.selected, std::set<std::string>{"add-12"});
}

TEST(Commands, whatIsCopiedComesBackUnderOtherNames) {
    Workspace work = workspace_of(kChain);
    work.selected = {"source", "add"};
    const std::string yaml = copy_selected(work, registry());
    EXPECT_THAT(yaml, HasSubstr("fake.source"));
    EXPECT_EQ(Document::parse(yaml).graph().nodes.size(), 2u);
    const std::string before = work.document.text();
    paste(work, registry(), yaml, {500, 500});
    ASSERT_TRUE(work.graph().find("add-2"));
    EXPECT_EQ(work.graph().find("add-2")->inputs.at(0).from.at(0).node, "source-2");
    EXPECT_EQ(work.graph().find("source-2")->params.size(), 2u);
    EXPECT_EQ(work.selected, (std::set<std::string>{"add-2", "source-2"}));
    work.document.undo();
    EXPECT_EQ(work.document.text(), before);
    EXPECT_THAT(error_of([&] { paste(work, registry(), "a letter to somebody", {}); }), HasSubstr("clipboard"));
    EXPECT_EQ(work.document.text(), before);
}

TEST(Commands, removingTakesWiresAndOutputsAlong) {
    Workspace work = workspace_of(kChain);
    set_output(work, {"table", "table", {}}, true);
    EXPECT_TRUE(is_output(work.graph(), {"table", "table", {}}));
    work.selected = {"add", "table"};
    remove_selected(work);
    EXPECT_EQ(work.graph().nodes.size(), 1u);
    EXPECT_TRUE(work.graph().outputs.empty());
    EXPECT_TRUE(work.selected.empty());
    work.document.undo();
    EXPECT_EQ(work.graph().nodes.size(), 3u);
}

TEST(Commands, selectionFollowsUndo) {
    Workspace work;
    add_node(work, registry(), type("fake.add"), {});
    work.document.undo();
    forget_missing(work);
    EXPECT_TRUE(work.selected.empty());
    EXPECT_EQ(work.single(), nullptr);
}

// --- nodes that are not used, and what is written beside them --------------------------------------

TEST(Use, isTurnedOnAndOffForAllThatIsSelected) {
    Workspace work = workspace_of(kChain);
    work.selected = {"add", "table"};
    work.document.set_use({"add"}, GraphNode::Use::disabled);
    toggle_use(work, GraphNode::Use::disabled);
    for (const char* id : {"add", "table"}) EXPECT_EQ(work.graph().find(id)->use, GraphNode::Use::disabled) << id;
    toggle_use(work, GraphNode::Use::bypassed);
    EXPECT_EQ(work.graph().find("add")->use, GraphNode::Use::bypassed);
    toggle_use(work, GraphNode::Use::bypassed);
    EXPECT_EQ(work.graph().find("table")->use, GraphNode::Use::normal);
    while (work.document.can_undo()) work.document.undo();
    EXPECT_EQ(work.document.text(), kChain);
}

TEST(Notes, groupsFollowTheirNodes) {
    Workspace work = workspace_of(kChain);
    work.selected = {"source", "add"};
    group_selected(work, "First, and: #second");
    work.selected = {"add", "table"};
    EXPECT_EQ(group_selected(work, "Second"), 1u);
    auto groups = [&] { return groups_of(Document::parse(work.document.text()).graph()); };
    ASSERT_EQ(groups().size(), 2u);
    EXPECT_EQ(groups()[0].title, "First, and: #second");
    EXPECT_EQ(groups()[0].nodes, std::vector<std::string>{"source"}) << "a node is in one group";
    rename_node(work, "table", "other");
    EXPECT_EQ(groups()[1].nodes, (std::vector<std::string>{"add", "other"}));
    EXPECT_EQ(work.selected, (std::set<std::string>{"add", "other"}));
    set_title(work, 1, "Renamed");
    const std::string before = work.document.text();
    work.selected = {"add", "other"};
    remove_selected(work);
    ASSERT_EQ(groups().size(), 1u);
    EXPECT_THAT(work.document.text(), ::testing::Not(HasSubstr("Renamed"))) << "no trace of a group without nodes";
    work.document.undo();
    EXPECT_EQ(work.document.text(), before);
    work.selected = {"other"};
    ungroup_selected(work);
    EXPECT_EQ(groups().size(), 1u);
    while (work.document.can_undo()) work.document.undo();
    EXPECT_EQ(work.document.text(), kChain);
}

TEST(Notes, commentsMoveAndAreCopiedWithNodes) {
    Workspace work = workspace_of(kChain);
    arrange(work, registry());
    EXPECT_EQ(add_comment(work, "look\n\"here\"", {13, -26}), 0u);
    EXPECT_EQ(comments_of(work.graph())[0].at, glm::dvec2(10, -30));
    work.selected = {"add", "source"};
    group_selected(work, "Pair");
    const auto boxes = boxes_of(work.graph(), ports_of(work.graph(), registry()));
    const std::string before = work.document.text();
    move_selected(work, boxes, {100, 0});
    EXPECT_EQ(comments_of(work.graph())[0].at, glm::dvec2(110, -30));
    EXPECT_EQ(*work.graph().find("add")->at, boxes[1].at + glm::dvec2(100, 0));
    work.document.undo();
    EXPECT_EQ(work.document.text(), before) << "one step";

    work.selected_comments = {0};
    const std::string copied = copy_selected(work, registry());
    Workspace other = workspace_of(kChain);
    paste(other, registry(), copied, {500, 500});
    ASSERT_EQ(comments_of(other.graph()).size(), 1u);
    EXPECT_EQ(comments_of(other.graph())[0].text, "look\n\"here\"");
    EXPECT_EQ(groups_of(other.graph()).at(0).nodes, (std::vector<std::string>{"add-2", "source-2"}));
    EXPECT_EQ(other.selected_comments, std::set<std::size_t>{0});
    other.document.undo();
    EXPECT_EQ(other.document.text(), kChain);

    set_comment(work, 0, "");
    EXPECT_TRUE(comments_of(work.graph()).empty());
    work.document.undo();
    work.selected.clear();
    work.selected_comments = {0};
    remove_selected(work);
    EXPECT_TRUE(comments_of(work.graph()).empty());
}

TEST(Notes, boxesOfGroupsHoldTheirNodes) {
    Workspace work = workspace_of(kChain);
    work.selected = {"source", "table"};
    group_selected(work, "Ends");
    const auto nodes = boxes_of(work.graph(), ports_of(work.graph(), registry()));
    const NodeBox box = boxes_of_groups(groups_of(work.graph()), work.graph(), nodes).at(0);
    for (std::size_t i : {0, 2}) {
        EXPECT_LT(box.at.x, nodes[i].at.x);
        EXPECT_LE(box.at.y + kGroupTitle, nodes[i].at.y);
        EXPECT_GT(box.at.x + box.size.x, nodes[i].at.x + nodes[i].size.x);
        EXPECT_GT(box.at.y + box.size.y, nodes[i].at.y + nodes[i].size.y);
    }
}

TEST(Notes, whatIsNotUnderstoodIsLeftOut) {
    const Graph graph = Document::parse("voxloom: 1\nnodes: [{ id: a, type: t }]\neditor: { groups: [7, [x], [[y], a], [t, b], [u, a, a]], "
                                        "comments: [[c, 1], [c, x, 1], [c, .inf, 1], [d, 1, 2]], later: [1] }\n").graph();
    ASSERT_EQ(groups_of(graph).size(), 1u);
    EXPECT_EQ(groups_of(graph)[0].title, "u");
    EXPECT_EQ(groups_of(graph)[0].nodes, std::vector<std::string>{"a"});
    ASSERT_EQ(comments_of(graph).size(), 1u);
    EXPECT_EQ(comments_of(graph)[0].text, "d");
}

// --- layout --------------------------------------------------------------------------------------

TEST(Layout, nothingOverlapsAndSourcesStandLeft) {
    Workspace work = workspace_of(kChain);
    for (int i = 0; i < 40; ++i) {
        const std::string id = add_node(work, registry(), type(i % 3 ? "fake.add" : "fake.sum"), {});
        const std::string from = i < 2 ? "source" : work.graph().nodes[std::size_t(3 + i / 2)].id;
        if (from != id) connect(work, registry(), {from, "volume", {}}, {id, i % 3 ? "volume" : "a", {}});
    }
    arrange(work, registry());
    const auto boxes = boxes_of(work.graph(), ports_of(work.graph(), registry()));
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        for (std::size_t k = 0; k < i; ++k)
            EXPECT_FALSE(boxes[i].overlaps(boxes[k].at, boxes[k].at + boxes[k].size)) << i << " " << k;
        for (const GraphInput& input : work.graph().nodes[i].inputs)
            for (const WireEnd& end : input.from)
                for (std::size_t k = 0; k < boxes.size(); ++k)
                    if (work.graph().nodes[k].id == end.node) {
                        EXPECT_LT(boxes[k].at.x + boxes[k].size.x, boxes[i].at.x);
                    }
    }
    work.document.undo();
    EXPECT_FALSE(work.graph().nodes[0].at);
}

TEST(Layout, putsPartsWithoutWiresBetweenThemBesideEachOther) {
    Workspace work = workspace_of(kChain);
    for (int i = 0; i < 40; ++i) {
        const std::string source = add_node(work, registry(), type("fake.source"), {}), add = add_node(work, registry(), type("fake.add"), {});
        connect(work, registry(), {source, "volume", {}}, {add, "volume", {}});
    }
    arrange(work, registry());
    const auto boxes = boxes_of(work.graph(), ports_of(work.graph(), registry()));
    glm::dvec2 lo(1e300), hi(-1e300);
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        lo = glm::min(lo, boxes[i].at), hi = glm::max(hi, boxes[i].at + boxes[i].size);
        for (std::size_t k = 0; k < i; ++k) EXPECT_FALSE(boxes[i].overlaps(boxes[k].at, boxes[k].at + boxes[k].size)) << i << " " << k;
    }
    EXPECT_LT((hi - lo).x, 3 * (hi - lo).y);
    EXPECT_LT((hi - lo).y, 2 * (hi - lo).x);
}

TEST(Layout, acceptsCyclesAndEmptyGraphs) {
    EXPECT_TRUE(auto_layout({}, {}).empty());
    Workspace work = workspace_of("voxloom: 1\nnodes:\n  - { id: a, type: fake.add, in: { volume: b.volume } }\n"
                                  "  - { id: b, type: fake.add, in: { volume: a.volume } }\n");
    EXPECT_EQ(auto_layout(work.graph(), ports_of(work.graph(), registry())).size(), 2u);
}

// --- search --------------------------------------------------------------------------------------

TEST(Search, findsLettersInOrderAndPrefersBeginnings) {
    EXPECT_EQ(fuzzy_score("xyz", "Slicing renderer"), 0);
    EXPECT_EQ(fuzzy_score("rs", "sr"), 0);
    EXPECT_GT(fuzzy_score("sr", "Slicing renderer"), fuzzy_score("sr", "desires r"));
    EXPECT_GT(fuzzy_score("SLI", "slicing"), 0);
    EXPECT_GT(fuzzy_score("trans", "Transfer function"), fuzzy_score("trans", "turns a strand"));
    EXPECT_GT(fuzzy_score("phantom", "Phantom"), fuzzy_score("phantom", "Moving phantom"));
    EXPECT_EQ(find_nodes(registry().all(), "").size(), registry().all().size());
    EXPECT_EQ(find_nodes(registry().all(), "gather").front()->id, "fake.gather");
    EXPECT_TRUE(find_nodes(registry().all(), "qqqq").empty());
}

// --- files ---------------------------------------------------------------------------------------

TEST(Workspace, savingElsewhereKeepsWhatPathsName) {
    voxloom::testing::TempFolder folder;
    std::filesystem::create_directories(folder.path() / "a/b");
    Workspace work;
    save_workspace(work, folder.path() / "a/g.yaml", registry());
    work.document.add_node("source", "fake.source");
    work.document.set_param("source", "path", std::string("data.raw"));
    const std::filesystem::path named = work.graph().folder() / work.graph().nodes[0].params[0].yaml.text;
    save_workspace(work, folder.path() / "a/b/g.yaml", registry());
    EXPECT_EQ(work.graph().nodes[0].params[0].yaml.text, "../data.raw");
    EXPECT_EQ((work.graph().folder() / "../data.raw").lexically_normal(), named.lexically_normal());
    EXPECT_FALSE(work.changed());
    EXPECT_EQ(open_workspace(folder.path() / "a/b/g.yaml").document.text(), work.document.text());
}

TEST(Workspace, knowsWhatSavingWouldDestroy) {
    voxloom::testing::TempFolder folder;
    const std::filesystem::path mine = folder.path() / "mine.yaml", other = folder.path() / "other.yaml";
    Workspace work = workspace_of(kChain);
    EXPECT_EQ(what_saving_destroys(work, mine), "") << "nothing is there";
    std::ofstream(other) << kChain;
    EXPECT_NE(what_saving_destroys(work, other), "") << "never saved here";
    save_workspace(work, mine, registry());
    EXPECT_NE(what_saving_destroys(work, other), "");
    EXPECT_EQ(what_saving_destroys(work, mine), "");
    EXPECT_EQ(what_saving_destroys(work, folder.path() / "." / "mine.yaml"), "") << "the same file";
    work.document.remove_node("add");
    EXPECT_EQ(what_saving_destroys(work, mine), "") << "changed here alone";
    std::ofstream(mine, std::ios::app) << "# by another\n";
    EXPECT_NE(what_saving_destroys(work, mine), "");
    std::ofstream(mine) << "no graph";
    EXPECT_NE(what_saving_destroys(work, mine), "");
    save_workspace(work, mine, registry());
    EXPECT_EQ(what_saving_destroys(work, mine), "");
    std::filesystem::remove(mine);
    EXPECT_EQ(what_saving_destroys(work, mine), "") << "gone";
}

TEST(Workspace, settingsComeBack) {
    voxloom::testing::TempFolder folder;
    Settings settings;
    settings.dark = false;
    settings.text_scale = 1.25;
    for (int i = 0; i < 20; ++i) remember(settings, folder.path() / ("g " + std::to_string(i) + ".yaml"));
    remember(settings, folder.path() / "g 15.yaml");
    save_settings(settings, folder.path() / "deep/settings");
    const Settings back = load_settings(folder.path() / "deep/settings");
    EXPECT_EQ(back.dark, false);
    EXPECT_EQ(back.text_scale, 1.25);
    EXPECT_EQ(back.recent, settings.recent);
    EXPECT_EQ(back.recent.front(), folder.path() / "g 15.yaml");
    const std::size_t count = settings.recent.size();
    forget(settings, folder.path() / "a/../g 15.yaml");
    EXPECT_EQ(settings.recent.size(), count - 1);
    EXPECT_EQ(settings.recent.front(), folder.path() / "g 19.yaml");
    forget(settings, folder.path() / "never there.yaml");
    EXPECT_EQ(settings.recent.size(), count - 1);
    EXPECT_EQ(load_settings(folder.path() / "none").recent.size(), 0u);
}

TEST(Autosave, bringsBackWhatACrashedSessionHadNotSaved) {
    voxloom::testing::TempFolder folder;
    Workspace work = workspace_of(kChain);
    save_workspace(work, folder.path() / "g.yaml", registry());
    {
        Autosave autosave(folder.path() / "state");
        autosave.update(work, 0);
        EXPECT_FALSE(std::filesystem::exists(folder.path() / "state")) << "nothing is unsaved";
        work.document.remove_node("add");
        autosave.update(work, 10);
        work.document.remove_node("table");
        autosave.update(work, 10.5);
        EXPECT_TRUE(autosave.due());
        autosave.update(work, 11);
        EXPECT_FALSE(autosave.due());
        EXPECT_TRUE(find_recoverable(folder.path() / "state").empty()) << "this session still runs";
        // As if another process had written it, which is gone.
        const auto entry = *std::filesystem::directory_iterator(folder.path() / "state");
        std::filesystem::copy_file(entry.path(), folder.path() / "state/999999999.unsaved");
        std::ofstream(folder.path() / "state/999999998.unsaved") << "no graph";
    }
    const auto found = find_recoverable(folder.path() / "state");
    ASSERT_EQ(found.size(), 1u) << "the session that ended well left nothing";
    EXPECT_EQ(found[0].workspace.document.text(), work.document.text());
    EXPECT_EQ(found[0].workspace.file, std::filesystem::absolute(folder.path() / "g.yaml"));
    EXPECT_TRUE(found[0].workspace.changed());
    EXPECT_FALSE(std::filesystem::exists(folder.path() / "state/999999998.unsaved"));
}

// --- histograms ----------------------------------------------------------------------------------

TEST(Histogram, countsEveryVoxelOfASmallVolume) {
    using voxloom::testing::make_volume;
    const auto ramp = make_volume({256, 3, 2}, ScalarType::u8, [](auto x, auto, auto) { return double(x); });
    const Histogram h = histogram_of(*ramp);
    EXPECT_EQ(h.range, (ValueRange{0, 255}));
    EXPECT_FALSE(h.sampled);
    for (double count : h.counts) EXPECT_EQ(count, 6);
    const Histogram constant = histogram_of(*make_volume({5, 1, 1}, ScalarType::f32, [](auto...) { return 7; }));
    EXPECT_EQ(constant.range, (ValueRange{7, 7}));
    EXPECT_EQ(constant.counts[0], 5);
    EXPECT_EQ(histogram_of(*make_volume({0, 3, 3}, ScalarType::u8, [](auto...) { return 0; })).range, ValueRange{});
}

TEST(Histogram, leavesOutWhatIsNotFiniteAndSurvivesExtremes) {
    const double values[] = {NAN, INFINITY, -INFINITY, -1e308, 1e308, 0};
    const auto volume = voxloom::testing::make_volume({6, 1, 1}, ScalarType::f64, [&](auto x, auto, auto) { return values[x]; });
    const Histogram h = histogram_of(*volume);
    EXPECT_EQ(h.range, (ValueRange{-1e308, 1e308}));
    double all = 0;
    for (double count : h.counts) all += count;
    EXPECT_EQ(all, 3);
    EXPECT_EQ(h.counts[128], 1);
}

TEST(Histogram, readsAPartOfLargeVolumesAndSaysSo) {
    const auto volume = voxloom::testing::make_volume({16, 16, 16}, ScalarType::u16, [](auto x, auto y, auto z) { return double(x + y + z); });
    const Histogram h = histogram_of(*volume, {}, 512);
    EXPECT_TRUE(h.sampled);
    double all = 0;
    for (double count : h.counts) all += count;
    EXPECT_GT(all, 256);
    EXPECT_LT(all, 1024);
}

TEST(GradientHistogram, separatesFlatPartsFromRampsInTheWorld) {
    using voxloom::testing::make_volume;
    auto sum = [](const GradientHistogram& h, std::size_t from, std::size_t to) {
        double all = 0;
        for (std::size_t i = from * kHistogramBins; i < to * kHistogramBins; ++i) all += h.counts[i];
        return all;
    };
    const auto flat = make_volume({8, 4, 4}, ScalarType::u8, [](auto x, auto...) { return x < 4 ? 0 : 255; });
    GradientHistogram h = gradient_histogram_of(*flat, {0, 255});
    EXPECT_EQ(sum(h, 0, 1), 6 * 16) << "two columns touch the step";
    EXPECT_EQ(sum(h, 1, kGradientBins), 2 * 16);
    // A ramp of 1/8 of the range a voxel is the same along every axis, and is of the world, not of voxels.
    const double height = std::log(0.125 / kLeastGradient) / -std::log(kLeastGradient);
    const auto ramp = make_volume({2, 9, 2}, ScalarType::f32, [](auto, auto y, auto) { return double(y) / 8; });
    h = gradient_histogram_of(*ramp, {0, 1});
    const auto row = std::size_t(height * double(kGradientBins));
    EXPECT_EQ(sum(h, row, row + 1), 36);
    EXPECT_EQ(h.counts[row * kHistogramBins + kHistogramBins / 2], 4);
    // Nothing to tell, nothing to fall over.
    for (const auto& empty : {make_volume({0, 3, 3}, ScalarType::u8, [](auto...) { return 0; }), make_volume({3, 1, 1}, ScalarType::f64, [](auto...) { return NAN; })}) {
        h = gradient_histogram_of(*empty, {0, 1});
        EXPECT_EQ(sum(h, 0, kGradientBins), 0);
    }
    EXPECT_EQ(sum(gradient_histogram_of(*flat, {7, 7}), 0, kGradientBins), 0);
    EXPECT_EQ(sum(gradient_histogram_of(*flat, {0, 255}, {}, 32), 0, kGradientBins), 32) << "a part of the rows";
}

// --- small pictures, and what makes them -------------------------------------------------------------

TEST(Thumbnail, isTheMeanOfThePixelsThatFallTogether) {
    Image image({320, 480}, Image::Format::rgba32f);
    for (int y = 0; y < 480; ++y)
        for (int x = 0; x < 320; ++x) image.rgba32f()[std::size_t(y * 320 + x)] = glm::vec4((x + y) % 2, y < 240, NAN, 0.5);
    const auto small = thumbnail_of(image);
    EXPECT_EQ(small->size, glm::ivec2(107, 160));
    EXPECT_NEAR(small->aspect, 2.0 / 3, 1e-12);
    EXPECT_NEAR(small->pixels.front().r, 128, 15);
    EXPECT_EQ(small->pixels.front().g, 255);
    EXPECT_EQ(small->pixels.back().g, 0);
    EXPECT_EQ(small->pixels.front().b, 0) << "not a number is black";
    EXPECT_EQ(small->pixels.front().a, 255);
    EXPECT_EQ(thumbnail_of(Image({1, 1}, Image::Format::rgba8))->size, glm::ivec2(1, 1));
}

TEST(Thumbnail, showsTheMiddleSliceOfAVolume) {
    using voxloom::testing::make_volume;
    const auto volume = make_volume({7, 5, 3}, ScalarType::i16, [](auto x, auto y, auto z) { return double(z == 1 ? x + 10 * y : -1000); });
    const auto small = thumbnail_of(*volume);
    ASSERT_EQ(small->size, glm::ivec2(7, 5));
    EXPECT_EQ(small->pixels[4 * 7].r, 0) << "the first row is at the bottom";
    EXPECT_EQ(small->pixels[6].r, 255);
    // Thin ones are seen from their flat side; large ones a part of their voxels.
    EXPECT_EQ(thumbnail_of(*make_volume({1, 6, 9}, ScalarType::u8, [](auto...) { return 3; }))->size, glm::ivec2(6, 9));
    EXPECT_EQ(thumbnail_of(*make_volume({1, 1, 1}, ScalarType::f32, [](auto...) { return NAN; }))->size, glm::ivec2(1, 1));
    EXPECT_EQ(thumbnail_of(*make_volume({0, 4, 4}, ScalarType::u8, [](auto...) { return 0; }))->size, glm::ivec2(0, 0));
    const auto large = thumbnail_of(*make_volume({701, 331, 2}, ScalarType::f64, [](auto x, auto...) { return x == 0 ? -1e308 : 1e308; }));
    EXPECT_LE(large->size.x, 2 * kThumbnailPixels);
    EXPECT_EQ(large->pixels[0].r, 0);
    EXPECT_EQ(large->pixels[1].r, 255);
}

TEST(Thumbnail, showsTheCoarsestLevelOfBricksThatIsFineEnough) {
    using voxloom::testing::make_volume;
    BrickCache cache(64 << 20);
    auto small_of = [&](Index3 dims, auto&& f) {
        return thumbnail_of(make_dense_pyramid(make_volume(dims, ScalarType::u8, f), glm::ivec3(16), PyramidFilter::subsample), cache);
    };
    // Level 1 is 70 x 65 x 64; its middle slice is slice 64 of the volume.
    const auto small = small_of({139, 130, 127}, [](auto x, auto y, auto z) { return z == 64 && x >= 70 && y >= 66 ? 200 : z == 64 ? 10 : 100; });
    ASSERT_EQ(small->size, glm::ivec2(70, 65));
    EXPECT_EQ(small->pixels[0].r, 0);
    EXPECT_EQ(small->pixels[69].r, 255) << "the last row is at the top";
    EXPECT_EQ(small->pixels[64 * 70 + 69].r, 0);
    EXPECT_EQ(small_of({127, 127, 1}, [](auto...) { return 1; })->size, glm::ivec2(64, 64));
    EXPECT_EQ(small_of({40, 33, 17}, [](auto...) { return 1; })->size, glm::ivec2(40, 33));
}

// --- the camera ----------------------------------------------------------------------------------

struct CameraControl : ::testing::Test {
    Registry nodes;
    Workspace work;

    CameraControl() {
        NodeType camera;
        camera.id = "test.camera";
        camera.title = camera.doc = "test";
        camera.outputs = {{"camera", PortType::camera, "the camera"}};
        camera.params = {param::choice("mode", {"orbit", "look-at"}, "orbit", "Mode."),
                         param::real("azimuth", 30, "Azimuth.").range(-36000, 36000), param::real("elevation", 20, "Elevation."),
                         param::real("roll", 0, "Roll."), param::real("distance", 1, "Distance."),
                         param::real("zoom", 1, "Zoom.").range(1e-3, 1e6), param::real("fov", 30, "Angle."),
                         param::vector("offset", {0, 0, 0}, "Offset."), param::vector("eye", {0, -3, 0}, "Eye."),
                         param::vector("target", {0, 0, 0}, "Target."), param::vector("up", {0, 0, 1}, "Up.")};
        NodeType draw;
        draw.id = "test.draw";
        draw.title = draw.doc = "test";
        draw.inputs = {{"camera", PortType::camera, "the camera"}};
        draw.outputs = {{"image", PortType::image, "the picture"}};
        for (NodeType* type : {&camera, &draw}) {
            type->evaluate = [](Evaluation&) {};
            nodes.add(*type);
        }
        work.document.add_node("eye", "test.camera");
        work.document.add_node("view", "test.draw");
        work.document.connect("eye", "camera", "view", "camera");
    }
    double real(const char* key) const {
        return std::get<double>(value_of(*work.graph().find("eye"), *nodes.find("test.camera")->find_param(key)));
    }
    std::vector<double> numbers(const char* key) const {
        return std::get<std::vector<double>>(value_of(*work.graph().find("eye"), *nodes.find("test.camera")->find_param(key)));
    }
};

TEST_F(CameraControl, findsTheCameraBehindAPicture) {
    EXPECT_EQ(camera_of(work.graph(), nodes, "view"), "eye");
    work.document.disconnect("view", "camera");
    EXPECT_FALSE(camera_of(work.graph(), nodes, "view"));
    EXPECT_FALSE(camera_of(work.graph(), nodes, "nothing"));
}

TEST_F(CameraControl, turnsByAnglesWithinTheirRangeInOneStep) {
    const std::string before = work.document.text();
    orbit(work, nodes, "eye", {40, 100});
    EXPECT_EQ(real("azimuth"), -10);
    EXPECT_EQ(real("elevation"), 90) << "no further than straight above";
    work.document.undo();
    EXPECT_EQ(work.document.text(), before);
    orbit(work, nodes, "eye", {-160, 0});
    EXPECT_EQ(real("azimuth"), -170) << "wrapped at half a turn";
    look_from(work, nodes, "eye", 90, -90);
    EXPECT_EQ(real("elevation"), -90);
    magnify(work, nodes, "eye", 1e-9);
    EXPECT_EQ(real("zoom"), 1e-3) << "no further than the range";
    reset_camera(work, nodes, "eye");
    EXPECT_EQ(work.document.text(), before);
}

TEST_F(CameraControl, goesAroundTheTargetAtTheSameDistance) {
    work.document.set_param("eye", "mode", std::string("look-at"));
    orbit(work, nodes, "eye", {90, 0});
    std::vector<double> eye = numbers("eye");
    EXPECT_NEAR(eye[0], -3, 1e-5);
    EXPECT_NEAR(eye[1], 0, 1e-5);
    orbit(work, nodes, "eye", {0, 30});
    eye = numbers("eye");
    EXPECT_NEAR(std::sqrt(eye[0] * eye[0] + eye[1] * eye[1] + eye[2] * eye[2]), 3, 1e-4);
    EXPECT_NEAR(eye[2], 1.5, 1e-4) << "lifted by 30 degrees";
}

TEST_F(CameraControl, movesWhatIsSeenWithTheHand) {
    // A unit sphere fitted at 30 degrees, seen along +y with z up: a picture is 2 tan(15) d high.
    Camera now;
    now.vertical_fov = glm::radians(30.0);
    now.eye = {0, -1 / std::sin(glm::radians(15.0)), 0};
    now.up = {0, 0, 1};
    pan(work, nodes, "eye", {0.5, -0.25}, now);
    const double height = 2 * std::tan(glm::radians(15.0)) * -now.eye.y;
    EXPECT_NEAR(numbers("offset")[0], -0.5 * height, 1e-5);
    EXPECT_NEAR(numbers("offset")[1], 0, 1e-9);
    EXPECT_NEAR(numbers("offset")[2], -0.25 * height, 1e-5);
}

// --- undo ----------------------------------------------------------------------------------------

// One of all the edits there are, most of which apply.
void random_edit(Workspace& work, std::mt19937& random) {
    auto pick = [&](std::size_t n) { return std::uniform_int_distribution<std::size_t>(0, n - 1)(random); };
    const auto& nodes = work.graph().nodes;
    auto some = [&] { return nodes[pick(nodes.size())].id; };
    const double x = double(pick(2000)) / 8;
    // Graphs stay small: what is tested is many edits, and each reads the whole text again.
    const std::size_t kind = nodes.size() < 3 ? 0 : nodes.size() > 7 ? 14 : pick(nodes.size() > 5 ? 16 : 14);
    switch (kind) {
        case 0: add_node(work, registry(), type(pick(2) ? "fake.add" : "fake.sum"), {x, x}); break;
        case 1: connect(work, registry(), {some(), "volume", {}}, {some(), "volume", {}}); break;
        case 2: connect(work, registry(), {some(), "volume", {}}, {some(), "a", {}}); break;
        case 3: work.document.set_param(some(), "amount", x); break;
        case 4: work.document.reset_param(some(), "amount"); break;
        case 5: work.document.move_node(some(), {x, -x}); break;
        case 6: work.document.rename_node(some(), "n" + std::to_string(pick(40))); break;
        case 7: set_output(work, {some(), "volume", {}}, pick(2)); break;
        case 8: work.document.disconnect(some(), "volume"); break;
        case 10: work.document.set_use({some(), some()}, GraphNode::Use(pick(3))); break;
        case 11:
            work.selected = {some(), some()};
            pick(3) ? void(group_selected(work, "Group " + std::to_string(pick(9)))) : ungroup_selected(work);
            break;
        case 12: pick(3) ? void(add_comment(work, "text: '" + std::to_string(pick(9)), {x, x})) : set_comments(work.document, {}); break;
        case 13: rename_node(work, some(), "g" + std::to_string(pick(40))); break;
        case 9:
            work.selected = {some()};
            paste(work, registry(), copy_selected(work, registry()), {x, x});
            break;
        default:
            work.selected = {some(), some()};
            remove_selected(work);
    }
}

TEST(Undo, thousandsOfRandomEditsAreTakenBackExactly) {
    std::mt19937 random(7);
    Workspace work = workspace_of(kChain);
    std::vector<std::string> texts{work.document.text()};  // after each step that can be undone
    for (int i = 0; i < 10000; ++i) {
        const bool back = random() % 3 == 0;
        if (back && work.document.can_undo()) {
            work.document.undo();
            texts.pop_back();
        } else if (!back) {
            const std::string before = work.document.text();
            {
                Document::Step step(work.document);
                try {
                    random_edit(work, random);
                } catch (const Error&) {
                    // It did not apply; the document must be as it was, or as the parts before left it.
                }
            }
            if (work.document.text() != before) texts.push_back(work.document.text());
        }
        forget_missing(work);
        ASSERT_EQ(work.document.text(), texts.back()) << "after " << i;
    }
    const std::string last = work.document.text();
    std::size_t undone = 0;
    for (; work.document.can_undo(); ++undone) work.document.undo();
    EXPECT_EQ(work.document.text(), kChain);
    EXPECT_EQ(undone, texts.size() - 1);
    for (std::size_t i = 0; i < undone; ++i) work.document.redo();
    EXPECT_EQ(work.document.text(), last);
}

}  // namespace
}  // namespace voxloom::editor
