// Evaluation: what runs, what is kept, what is said when something goes wrong.

#include "core/graph/evaluate.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <fstream>
#include <thread>

#include "core/base/parallel.h"
#include "core/graph/document.h"
#include "core/graph/report.h"
#include "tests/support/volumes.h"

namespace voxloom {
namespace {

using namespace std::chrono_literals;

// Numbers travel as tables of one cell.
TablePtr number(double v) {
    auto table = std::make_shared<Table>();
    table->columns = {{"value", ""}};
    table->rows = {{Table::Cell(v)}};
    return table;
}
double number_of(const Value& v) { return std::get<double>(std::get<TablePtr>(v)->rows[0][0]); }

// Nodes whose runs are counted.
struct Fixture : ::testing::Test {
    Registry registry;
    ResultCache cache;
    std::map<std::string, int> runs;  // by node id
    std::mutex mutex;
    std::atomic<bool> slow_started{false};

    void count(Evaluation& ev) {
        std::lock_guard lock(mutex);
        ++runs[ev.node_id()];
    }

    NodeType make(const char* id, std::vector<PortSpec> inputs, std::vector<ParamSpec> params,
                  std::function<void(Evaluation&)> f) {
        NodeType type;
        type.id = id;
        type.title = type.doc = "test";
        type.inputs = std::move(inputs);
        type.outputs = {{"value", PortType::table, "the number"}};
        type.params = std::move(params);
        type.evaluate = [this, f](Evaluation& ev) {
            count(ev);
            f(ev);
        };
        return type;
    }

    Fixture() {
        using namespace param;
        registry.add(make("test.number", {}, {real("value", 1, "v"), integer("cost", 0, "c").changes(Affects::cost)},
                          [](Evaluation& ev) { ev.output("value", number(ev.params().real("value"))); }));
        registry.add(make("test.add", {{"in", PortType::table, "numbers", false, true}},
                          {real("plus", 0, "p")}, [](Evaluation& ev) {
                              double sum = ev.params().real("plus");
                              for (const Value& v : ev.values("in")) sum += number_of(v);
                              ev.measure("sum", sum);
                              ev.count("added", double(ev.values("in").size()));
                              ev.output("value", number(sum));
                          }));
        registry.add(make("test.fail", {{"in", PortType::table, "number", true}}, {},
                          [](Evaluation&) { fail("the well is dry; dig deeper"); }));
        registry.add(make("test.forget", {}, {}, [](Evaluation&) {}));
        registry.add(make("test.slow", {}, {}, [this](Evaluation& ev) {
            slow_started = true;
            while (true) {
                check_stop(ev.stop());
                std::this_thread::sleep_for(1ms);
            }
        }));
        registry.add(make("test.file", {}, {path_in("path", "file")}, [](Evaluation& ev) {
            std::ifstream in(ev.params().path("path"));
            double v = 0;
            in >> v;
            ev.output("value", number(v));
        }));
        registry.add(make("test.coarse", {}, {}, [](Evaluation& ev) {
            if (ev.wants_provisional()) ev.provisional("value", number(-1));
            ev.output("value", number(2));
        }));
        registry.add(make("test.busy", {}, {}, [](Evaluation& ev) {
            std::atomic<std::int64_t> sum{0};
            Buffer scratch(1 << 20);
            parallel_for(0, 64, 1, [&](std::int64_t lo, std::int64_t hi) {
                std::int64_t mine = 0;
                for (std::int64_t i = lo * 200'000; i < hi * 200'000; ++i) mine += i ^ (i >> 3);
                sum += mine;
            }, ev.stop());
            ev.progress(1);
            ev.output("value", number(double(sum)));
        }));
    }

    Plan plan(const std::string& text, std::filesystem::path file = {}) {
        document = Document::parse(text, file);
        Plan p = check(document.graph(), registry);
        for (const Problem& problem : p.problems) ADD_FAILURE() << problem.text("test");
        return p;
    }
    Document document;
};

const char* const kDiamond = R"(voxloom: 1
outputs: [d.value]
nodes:
  - { id: a, type: test.number, set: { value: 3 } }
  - { id: b, type: test.add, in: { in: [a.value] }, set: { plus: 1 } }
  - { id: c, type: test.add, in: { in: [a.value] }, set: { plus: 2 } }
  - { id: d, type: test.add, in: { in: [b.value, c.value] } }
  - { id: lonely, type: test.number }
)";

using Evaluate = Fixture;

TEST_F(Evaluate, computesTheAskedAndNothingElse) {
    Plan p = plan(kDiamond);
    RunResult r = evaluate(p, cache);
    ASSERT_TRUE(r.ok);
    EXPECT_EQ(number_of(r.outputs[0]), 9);
    EXPECT_EQ(runs.count("lonely"), 0u);
    EXPECT_EQ(r.nodes[std::size_t(p.find("lonely"))].state, NodeState::not_asked);
    EXPECT_EQ(r.nodes[std::size_t(p.find("d"))].measurements.at("sum").first, 9);
    EXPECT_EQ(r.nodes[std::size_t(p.find("d"))].counters.at("added"), 2);
}

TEST_F(Evaluate, aChangeTouchesOnlyWhatDependsOnIt) {
    evaluate(plan(kDiamond), cache);
    document.set_param("b", "plus", 10.0);
    RunResult r = evaluate(check(document.graph(), registry), cache);
    EXPECT_EQ(number_of(r.outputs[0]), 18);
    EXPECT_EQ(runs, (std::map<std::string, int>{{"a", 1}, {"b", 2}, {"c", 1}, {"d", 2}}));
}

TEST_F(Evaluate, undoShowsItsResultFromTheCache) {
    evaluate(plan(kDiamond), cache);
    document.set_param("a", "value", 4.0);
    evaluate(check(document.graph(), registry), cache);
    document.undo();
    auto before = runs;
    Plan p = check(document.graph(), registry);
    RunResult r = evaluate(p, cache);
    EXPECT_EQ(number_of(r.outputs[0]), 9);
    EXPECT_EQ(runs, before);
    EXPECT_EQ(r.nodes[std::size_t(p.find("d"))].state, NodeState::cached);
    EXPECT_EQ(r.nodes[std::size_t(p.find("d"))].measurements.at("sum").first, 9);
}

TEST_F(Evaluate, aCostParameterDoesNotRunAnythingAgain) {
    evaluate(plan(kDiamond), cache);
    document.set_param("a", "cost", std::int64_t(7));
    auto before = runs;
    evaluate(check(document.graph(), registry), cache);
    EXPECT_EQ(runs, before);
}

TEST_F(Evaluate, aFailureNamesItselfAndTheOtherBranchesGoOn) {
    Plan p = plan(R"(voxloom: 1
nodes:
  - { id: bad, type: test.fail }
  - { id: after, type: test.add, in: { in: [bad.value] } }
  - { id: good, type: test.number }
)");
    RunResult r = evaluate(p, cache);
    EXPECT_FALSE(r.ok);
    const NodeReport& bad = r.nodes[std::size_t(p.find("bad"))];
    const NodeReport& after = r.nodes[std::size_t(p.find("after"))];
    EXPECT_EQ(bad.state, NodeState::failed);
    EXPECT_EQ(bad.error, "the well is dry; dig deeper");
    EXPECT_EQ(after.state, NodeState::not_run);
    EXPECT_EQ(after.error, "it needs 'bad', which failed");
    EXPECT_EQ(r.nodes[std::size_t(p.find("good"))].state, NodeState::done);
    EXPECT_EQ(runs.count("after"), 0u);
}

TEST_F(Evaluate, aNodeThatForgetsItsOutputFails) {
    Plan p = plan("voxloom: 1\nnodes:\n  - { id: x, type: test.forget }\n");
    RunResult r = evaluate(p, cache);
    EXPECT_EQ(r.nodes[0].state, NodeState::failed);
    EXPECT_NE(r.nodes[0].error.find("'value'"), std::string::npos);
}

TEST_F(Evaluate, canBeCancelledAtAnyMoment) {
    Plan p = plan(R"(voxloom: 1
nodes:
  - { id: slow, type: test.slow }
  - { id: after, type: test.add, in: { in: [slow.value] } }
)");
    std::stop_source source;
    RunOptions options;
    options.stop = source.get_token();
    std::thread canceller([&] {
        while (!slow_started) std::this_thread::sleep_for(1ms);
        source.request_stop();
    });
    RunResult r = evaluate(p, cache, options);
    canceller.join();
    EXPECT_TRUE(r.cancelled);
    EXPECT_EQ(r.nodes[std::size_t(p.find("slow"))].state, NodeState::cancelled);
    EXPECT_EQ(r.nodes[std::size_t(p.find("after"))].state, NodeState::cancelled);
    EXPECT_EQ(cache.size(), 0u);
}

TEST_F(Evaluate, cancelledBeforeItBeganRunsNothing) {
    std::stop_source source;
    source.request_stop();
    RunOptions options;
    options.stop = source.get_token();
    RunResult r = evaluate(plan(kDiamond), cache, options);
    EXPECT_TRUE(r.cancelled);
    EXPECT_TRUE(runs.empty());
}

TEST_F(Evaluate, aFileThatChangedIsReadAgain) {
    testing::TempFolder folder;
    const auto file = folder.path() / "n.txt";
    std::ofstream(file) << 5;
    const std::string text = "voxloom: 1\nnodes:\n  - { id: f, type: test.file, set: { path: n.txt } }\n";
    EXPECT_EQ(number_of(evaluate(plan(text, folder.path() / "g.yaml"), cache).outputs[0]), 5);
    EXPECT_EQ(number_of(evaluate(plan(text, folder.path() / "g.yaml"), cache).outputs[0]), 5);
    EXPECT_EQ(runs["f"], 1);
    std::ofstream(file) << 77;
    EXPECT_EQ(number_of(evaluate(plan(text, folder.path() / "g.yaml"), cache).outputs[0]), 77);
}

TEST_F(Evaluate, provisionalResultsAreShownAndNeverKept) {
    struct Watcher : RunObserver {
        std::vector<double> shown;
        void provisional(int, int, const Value& v) override { shown.push_back(number_of(v)); }
        bool wants_provisional() const override { return true; }
    } watcher;
    RunOptions options;
    options.observer = &watcher;
    Plan p = plan("voxloom: 1\nnodes:\n  - { id: x, type: test.coarse }\n");
    EXPECT_EQ(number_of(evaluate(p, cache, options).outputs[0]), 2);
    EXPECT_EQ(watcher.shown, std::vector<double>{-1});
    EXPECT_EQ(number_of(evaluate(p, cache, options).outputs[0]), 2);  // from the cache: the final one
    EXPECT_EQ(watcher.shown.size(), 1u);
}

TEST_F(Evaluate, theCacheKeepsToItsLimit) {
    cache.set_byte_limit(3000);  // tables count as 1024 bytes each
    evaluate(plan(kDiamond), cache);
    EXPECT_LE(cache.bytes(), 3000u);
    EXPECT_EQ(cache.size(), 2u);
    cache.set_byte_limit(0);
    EXPECT_EQ(cache.bytes(), 0u);
}

TEST_F(Evaluate, branchesRunAtTheSameTime) {
    // Both branches wait for each other: this ends only when they overlap.
    std::atomic<int> there{0};
    registry.add(make("test.meet", {}, {param::real("n", 0, "n")}, [&](Evaluation& ev) {
        ++there;
        for (int i = 0; there < 2 && i < 20'000; ++i) std::this_thread::sleep_for(1ms);
        ev.output("value", number(there));
    }));
    RunOptions options;
    options.threads = 2;
    RunResult r = evaluate(plan(R"(voxloom: 1
nodes:
  - { id: a, type: test.meet, set: { n: 1 } }
  - { id: b, type: test.meet, set: { n: 2 } }
)"), cache, options);
    EXPECT_TRUE(r.ok);
    EXPECT_EQ(there, 2);
}

TEST_F(Evaluate, theReportHoldsTimesAndMemory) {
    Plan p = plan("voxloom: 1\nnodes:\n  - { id: x, type: test.busy }\n");
    RunResult r = evaluate(p, cache);
    EXPECT_GT(r.nodes[0].wall_seconds, 0);
    EXPECT_GT(r.nodes[0].cpu_seconds, 0);
    EXPECT_GE(r.nodes[0].peak_bytes, 1u << 20);
    const std::string json = run_to_json(p, r);
    EXPECT_NE(json.find("\"peak_bytes\""), std::string::npos);
    EXPECT_NE(json.find("\"state\": \"done\""), std::string::npos);
}

TEST_F(Evaluate, theSameForAnyNumberOfThreads) {
    for (int threads : {1, 2, 7}) {
        ResultCache own;
        RunOptions options;
        options.threads = threads;
        EXPECT_EQ(number_of(evaluate(plan(kDiamond), own, options).outputs[0]), 9);
    }
}

TEST_F(Evaluate, tenThousandNodesInAChain) {
    std::string text = "voxloom: 1\nnodes:\n  - { id: n0, type: test.number }\n";
    for (int i = 1; i < 10'000; ++i)
        text += "  - { id: n" + std::to_string(i) + ", type: test.add, in: { in: [n" +
                std::to_string(i - 1) + ".value] }, set: { plus: 1 } }\n";
    Plan p = plan(text);
    RunResult r = evaluate(p, cache);
    ASSERT_TRUE(r.ok);
    EXPECT_EQ(number_of(r.outputs[0]), 10'000);
    // One parameter in the middle: exactly what depends on it runs again.
    runs.clear();
    document.set_param("n5000", "plus", 2.0);
    r = evaluate(check(document.graph(), registry), cache);
    EXPECT_EQ(number_of(r.outputs[0]), 10'001);
    EXPECT_EQ(runs.size(), 5000u);
}

// Passed on without exhausting the stack.
TEST_F(Evaluate, aLongChainAfterAFailureIsNotRun) {
    std::string text = "voxloom: 1\nnodes:\n  - { id: n0, type: test.fail }\n";
    for (int i = 1; i < 10'000; ++i)
        text += "  - { id: n" + std::to_string(i) + ", type: test.add, in: { in: [n" +
                std::to_string(i - 1) + ".value] } }\n";
    RunResult r = evaluate(plan(text), cache);
    EXPECT_FALSE(r.ok);
    for (const NodeReport& report : r.nodes)
        EXPECT_EQ(report.state, report.id == "n0" ? NodeState::failed : NodeState::not_run) << report.id;
}

struct Live : Fixture {
    std::mutex shown_mutex;
    std::vector<double> shown;
    LiveRunner::Done done() {
        return [this](const Plan&, const RunResult& r) {
            std::lock_guard lock(shown_mutex);
            if (r.ok) shown.push_back(number_of(r.outputs[0]));
        };
    }
};

TEST_F(Live, aNewerRequestSupersedesTheRunningOne) {
    LiveRunner live(cache, nullptr, done());
    live.submit(plan("voxloom: 1\nnodes:\n  - { id: x, type: test.slow }\n"));
    while (!slow_started) std::this_thread::sleep_for(1ms);
    live.submit(plan("voxloom: 1\nnodes:\n  - { id: x, type: test.number, set: { value: 8 } }\n"));
    live.wait_idle();
    EXPECT_EQ(shown, std::vector<double>{8});
}

TEST_F(Live, theLastOfManyAlwaysWins) {
    LiveRunner live(cache, nullptr, done());
    for (int i = 0; i < 200; ++i)
        live.submit(plan("voxloom: 1\nnodes:\n  - { id: x, type: test.number, set: { value: " +
                         std::to_string(i) + " } }\n"));
    live.wait_idle();
    ASSERT_FALSE(shown.empty());
    EXPECT_EQ(shown.back(), 199);
}

TEST_F(Live, endsWhileANodeRuns) {
    auto live = std::make_unique<LiveRunner>(cache, nullptr, done());
    live->submit(plan("voxloom: 1\nnodes:\n  - { id: x, type: test.slow }\n"));
    while (!slow_started) std::this_thread::sleep_for(1ms);
    live.reset();
    EXPECT_TRUE(shown.empty());
}

}  // namespace
}  // namespace voxloom
