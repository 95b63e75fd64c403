// What a graph of 10 000 nodes costs before anything is evaluated: reading its text, checking it,
// and one edit with its undo. Chains test depth, fans test breadth.
#include <benchmark/benchmark.h>

#include "core/graph/check.h"
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

BENCHMARK(read_graph)->ArgName("chain")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);
BENCHMARK(check_graph)->ArgName("chain")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);
BENCHMARK(edit_and_undo)->ArgName("chain")->Arg(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace voxloom
