// The editor without its window: what is edited, wired, found, laid out and undone.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "app/editor/model/commands.h"
#include "app/editor/model/search.h"
#include "app/editor/model/settings.h"
#include "core/base/error.h"
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
    EXPECT_EQ(load_settings(folder.path() / "none").recent.size(), 0u);
}

// --- undo ----------------------------------------------------------------------------------------

// One of all the edits there are, most of which apply.
void random_edit(Workspace& work, std::mt19937& random) {
    auto pick = [&](std::size_t n) { return std::uniform_int_distribution<std::size_t>(0, n - 1)(random); };
    const auto& nodes = work.graph().nodes;
    auto some = [&] { return nodes[pick(nodes.size())].id; };
    const double x = double(pick(2000)) / 8;
    const std::size_t kind = nodes.size() < 3 ? 0 : pick(nodes.size() > 5 ? 12 : 10);
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
