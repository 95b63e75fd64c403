// Evaluation while editing: what is shown belongs to the newest graph.
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "app/editor/model/evaluator.h"
#include "tests/support/fake_nodes.h"

namespace voxloom::editor {
namespace {

const char* const kText = R"(voxloom: 1
nodes:
  - id: source
    type: fake.source
    set: { size: 2, value: 3 }
  - id: add
    type: fake.add
    in:  { volume: source.volume }
    set: { amount: 1 }
  - id: table
    type: fake.table
    in:  { source: add.volume }
)";

struct Live : ::testing::Test {
    voxloom::testing::FakeCounts counts;
    Registry registry = voxloom::testing::fake_registry(&counts);
    Evaluator evaluator{registry, [] {}};
    Document document = Document::parse(kText);
    Evaluator::State state;

    void submit(bool coarse = false) {
        Evaluator::Request request;
        request.graph = document.graph();
        request.coarse = coarse;
        request.watched = {{"table", "table", {}}};
        evaluator.submit(std::move(request));
    }
    void finish() {
        evaluator.wait_idle();
        evaluator.refresh(state);
    }
    double shown() const {
        const auto& value = state.values.at("table.table");
        const Table::Cell& cell = std::get<TablePtr>(value.value)->rows.at(0).back();
        return std::holds_alternative<double>(cell) ? std::get<double>(cell) : double(std::get<std::int64_t>(cell));
    }
};

TEST_F(Live, showsValuesAndStatesOfAllThatRan) {
    submit();
    finish();
    EXPECT_FALSE(state.busy);
    for (const char* id : {"source", "add", "table"}) EXPECT_EQ(state.nodes.at(id).state, NodeState::done) << id;
    EXPECT_TRUE(state.values.at("table.table").fresh);
    EXPECT_EQ(shown(), 4);
    EXPECT_FALSE(evaluator.refresh(state)) << "nothing has changed since";
}

TEST_F(Live, undoFindsItsResultWithoutRunningAnything) {
    submit();
    finish();
    const auto serial = state.values.at("table.table").serial;
    document.set_param("add", "amount", 10.0);
    submit();
    finish();
    EXPECT_EQ(shown(), 13);
    EXPECT_EQ(counts.evaluations("source"), 1);
    const int before = counts.evaluations();
    document.undo();
    submit();
    finish();
    EXPECT_EQ(shown(), 4);
    EXPECT_EQ(counts.evaluations(), before);
    EXPECT_NE(state.values.at("table.table").serial, serial) << "a value shown again is another one to draw";
}

TEST_F(Live, theLastOfManyChangesWins) {
    document.set_param("add", "milliseconds", 3.0);
    for (int i = 0; i < 50; ++i) {
        document.set_param("add", "amount", double(i));
        submit(i % 2 == 0);
    }
    submit();
    finish();
    EXPECT_EQ(shown(), 3 + 49);
    EXPECT_TRUE(state.values.at("table.table").fresh);
}

TEST_F(Live, problemsLandOnTheirNodes) {
    submit();
    finish();
    EXPECT_EQ(state.volumes.count("add.volume"), 1u);
    document.set_param("add", "amount", std::string("much"));
    document.add_node("odd", "not.here");
    submit();
    finish();
    EXPECT_EQ(state.volumes.count("add.volume"), 0u) << "what does not run gives nothing";
    EXPECT_EQ(state.volumes.count("source.volume"), 1u);
    EXPECT_EQ(state.nodes.at("add").state, NodeState::failed);
    EXPECT_FALSE(state.nodes.at("add").message.empty());
    EXPECT_EQ(state.nodes.at("table").state, NodeState::not_run);
    EXPECT_EQ(state.nodes.at("odd").state, NodeState::failed);
    EXPECT_EQ(state.problems.size(), 2u);
    document.reset_param("add", "amount");
    document.remove_node("odd");
    submit();
    finish();
    EXPECT_TRUE(state.problems.empty());
    EXPECT_EQ(state.nodes.at("table").state, NodeState::cached) << "as before";
    EXPECT_EQ(state.nodes.count("odd"), 0u);
}

TEST_F(Live, aFailingNodeSaysItsSentence) {
    document.add_node("bad", "fake.fail");
    document.set_param("bad", "message", std::string("the moon is full"));
    submit();
    finish();
    EXPECT_EQ(state.nodes.at("bad").state, NodeState::failed);
    EXPECT_NE(state.nodes.at("bad").message.find("the moon is full"), std::string::npos);
    EXPECT_EQ(state.nodes.at("table").state, NodeState::done) << "the other branch goes on";
}

TEST_F(Live, isBusyFromTheRequestOnUntilNothingIsLeftToDo) {
    auto busy_until = [&](auto&& there) {
        submit();
        for (int i = 0; i < 50000; ++i) {
            evaluator.refresh(state);
            if (there()) return;
            ASSERT_TRUE(state.busy);
            std::this_thread::sleep_for(std::chrono::microseconds(100));
        }
        FAIL() << "it never was";
    };
    document.set_param("add", "milliseconds", 60000.0);
    for (double amount : {1.0, 2.0}) {  // the second supersedes the first
        document.set_param("add", "amount", amount);
        busy_until([&] { return state.graph && same_content(*state.graph, document.graph()) && state.nodes.at("add").state == NodeState::running; });
        EXPECT_TRUE(state.busy);
    }
    document.set_param("add", "milliseconds", 1.0);
    busy_until([&] { return !state.busy; });
    EXPECT_EQ(shown(), 3 + 2);
}

TEST_F(Live, stopsWhenAsked) {
    document.set_param("add", "milliseconds", 60000.0);
    submit();
    for (int i = 0; i < 2000; ++i) {
        evaluator.refresh(state);
        if (state.nodes.count("add") && state.nodes.at("add").state == NodeState::running) break;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_EQ(state.nodes.at("add").state, NodeState::running);
    evaluator.cancel();
    finish();
    EXPECT_FALSE(state.busy);
    EXPECT_NE(state.nodes.at("add").state, NodeState::running);
}

// --- coarse pictures -----------------------------------------------------------------------------

TEST(Coarse, makesPicturesAThirdTheSize) {
    Registry registry;
    NodeType type;
    type.id = "draw.picture";
    type.title = type.doc = "test";
    type.outputs = {{"image", PortType::image, "the picture"}};
    type.params = {param::vector("size", {300, 2}, "Size.").range(1, 4096).whole().is_quality()};
    type.evaluate = [](Evaluation&) {};
    registry.add(type);
    const Document document = Document::parse("voxloom: 1\nnodes:\n  - { id: a, type: draw.picture }\n");
    const auto overrides = coarse_overrides(check(document.graph(), registry));
    ASSERT_EQ(overrides.size(), 1u);
    EXPECT_EQ(overrides[0], "a.size=[100, 1]");
    EXPECT_TRUE(check(document.graph(), registry, {overrides, {}, 0}).problems.empty());
}

}  // namespace
}  // namespace voxloom::editor
