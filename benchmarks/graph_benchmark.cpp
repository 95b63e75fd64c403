// What a graph of 10 000 nodes costs beside the work of its nodes: reading its text, checking it, one
// edit with its undo, and evaluating it when the nodes do nothing. Chains test depth, fans breadth.
#include <benchmark/benchmark.h>

#include "core/graph/check.h"
#include "core/graph/evaluate.h"
#include "tests/support/fake_nodes.h"

namespace voxloom {
namespace {

constexpr int kNodes = 10'000;

// Node i takes node i-1 (a chain), or the source (a fan, gathered by every hundredth node).
std::string graph_text(bool chain) {
    std::string text =
        "voxloom: 1\nnodes:\n  - id: n0\n    type: fake.source\n    set: { size: 16 }\n";
    for (int i = 1; i < kNodes; ++i) {
        std::string id = "n" + std::to_string(i);
        text += "  - id: " + id + "\n";
        if (!chain && i % 100 == 0) {
            text += "    type: fake.gather\n    in:\n      volumes:\n";
            for (int k = i - 99; k < i; ++k)
                text += "        - n" + std::to_string(k) + ".volume\n";
        } else {
            text += "    type: fake.add\n    in: { volume: n" + std::to_string(chain ? i - 1 : 0) +
                    ".volume }\n    set: { amount: 0.5 }  # a little\n";
        }
        text += "    at: [" + std::to_string(i % 100 * 40) + ", " + std::to_string(i / 100 * 40) +
                "]\n";
    }
    return text;
}

void read_graph(benchmark::State& state) {
    std::string text = graph_text(state.range(0));
    for (auto _ : state) benchmark::DoNotOptimize(Document::parse(text));
    state.SetBytesProcessed(std::int64_t(state.iterations()) * std::int64_t(text.size()));
}

void check_graph(benchmark::State& state) {
    Document document = Document::parse(graph_text(state.range(0)));
    Registry registry = testing::fake_registry();
    for (auto _ : state) {
        Plan plan = check(document.graph(), registry);
        if (!plan.problems.empty()) state.SkipWithError(plan.problems[0].message.c_str());
        benchmark::DoNotOptimize(plan);
    }
    state.SetItemsProcessed(std::int64_t(state.iterations()) * kNodes);
}

void edit_and_undo(benchmark::State& state) {
    Document document = Document::parse(graph_text(state.range(0)));
    for (auto _ : state) {
        document.set_param("n5", "amount", 0.25);
        document.undo();
    }
}

// Nodes that hand on what they get: all the time there is, is the runtime's own.
Registry idle_registry() {
    Registry registry;
    NodeType type;
    type.id = "idle.pass";
    type.title = type.doc = "Hands on a table.";
    type.inputs = {{"in", PortType::table, "Any table.", true}};
    type.outputs = {{"out", PortType::table, "The same table."}};
    type.evaluate = [](Evaluation& ev) {
        static const TablePtr empty = std::make_shared<Table>();
        ev.output("out", is_empty(ev.value("in")) ? Value(empty) : ev.value("in"));
    };
    registry.add(std::move(type));
    return registry;
}

void evaluate_idle_nodes(benchmark::State& state) {
    std::string text = "voxloom: 1\nnodes:\n  - { id: n0, type: idle.pass }\n";
    for (int i = 1; i < kNodes; ++i)
        text += "  - { id: n" + std::to_string(i) + ", type: idle.pass, in: { in: n" +
                std::to_string(state.range(0) ? i - 1 : 0) + ".out } }\n";
    const Registry registry = idle_registry();
    const Document document = Document::parse(text);
    const Plan plan = check(document.graph(), registry);
    for (auto _ : state) {
        ResultCache cache;
        if (!evaluate(plan, cache).ok) state.SkipWithError("the graph did not run");
    }
    state.counters["time per node"] = benchmark::Counter(
        double(state.iterations()) * kNodes,
        benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

BENCHMARK(read_graph)->ArgName("chain")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);
BENCHMARK(check_graph)->ArgName("chain")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);
BENCHMARK(edit_and_undo)->ArgName("chain")->Arg(1)->Unit(benchmark::kMillisecond);

BENCHMARK(evaluate_idle_nodes)->ArgName("chain")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace voxloom
