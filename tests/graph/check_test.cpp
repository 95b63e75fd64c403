#include "core/graph/check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/text.h"
#include "tests/support/fake_nodes.h"
#include "tests/support/volumes.h"

namespace voxloom {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

Plan check_text(const std::string& text, const CheckOptions& options = {}) {
    static const Registry registry = testing::fake_registry();
    return check(Document::parse(text, "g.yaml").graph(), registry, options);
}

// All problems as the user sees them, one a line.
std::string problems_of(const Plan& plan) {
    std::string all;
    for (const Problem& problem : plan.problems) all += problem.text(plan.file) + "\n";
    return all;
}

struct FakeCountsRegistry {
    testing::FakeCounts counts;
    Registry registry = testing::fake_registry(&counts);
};

constexpr const char* kChain = R"(voxloom: 1
nodes:
  - id: last
    type: fake.add
    in: { volume: first.volume }
  - id: first
    type: fake.source
    set: { size: 3 }
)";

TEST(Check, PutsEverySourceBeforeItsConsumers) {
    Plan plan = check_text(kChain);
    EXPECT_EQ(problems_of(plan), "");
    ASSERT_EQ(plan.nodes.size(), 2u);
    EXPECT_EQ(plan.nodes[0].id, "first");
    EXPECT_EQ(plan.nodes[1].id, "last");
    EXPECT_EQ(plan.find("last"), 1);
    EXPECT_EQ(plan.find("nobody"), -1);
    ASSERT_EQ(plan.nodes[1].inputs.size(), 1u);
    ASSERT_EQ(plan.nodes[1].inputs[0].size(), 1u);
    EXPECT_EQ(plan.nodes[1].inputs[0][0].node, 0);
    EXPECT_EQ(plan.nodes[1].inputs[0][0].output, 0);
    EXPECT_TRUE(plan.nodes[0].ok && plan.nodes[1].ok);
}

TEST(Check, FindsEveryProblemInOrderOfLine) {
    Plan plan = check_text(R"(voxloom: 1
outputs: [nobody.volume, sum.volum, table, all.image]
nodes:
  - id: source
    type: fake.sourc
  - id: ct
    type: fake.source
    set: { sizes: 3, value: high, scalar: u9 }
  - id: lost
    type: fake.add
  - id: sum
    type: fake.sum
    in: { a: ct.volum, c: ct.volume, b: tc.volume }
  - id: table
    type: fake.table
    in: { source: all.image }
  - id: all
    type: fake.every
    set: { vector: [0, 8] }
  - id: writer
    type: fake.write
    in: { volume: [ct.volume, ct] }
  - id: after
    type: fake.add
    in: { volume: writer.volume }
)");
    EXPECT_EQ(
        problems_of(plan),
        "g.yaml:2:11: there is no node 'nobody'\n"
        "g.yaml:2:26: node 'sum' (fake.sum) has no output 'volum'; did you mean 'volume'?\n"
        "g.yaml:2:37: 'table' names no output; write table.table or table.transfer\n"
        "g.yaml:5:11: node 'source': unknown node type 'fake.sourc'; did you mean 'fake.source'?\n"
        "g.yaml:8:12: node 'ct': fake.source has no parameter 'sizes'; did you mean 'size'?\n"
        "g.yaml:8:29: node 'ct': parameter 'value' must be a number, not 'high'\n"
        "g.yaml:8:43: node 'ct': parameter 'scalar': 'u9' is not one of u8, f32; did you mean "
        "'u8'?\n"
        "g.yaml:9:9: node 'lost': input 'volume' is not wired; it needs a Volume; ct.volume would "
        "fit\n"
        "g.yaml:13:14: node 'sum': node 'ct' (fake.source) has no output 'volum'; did you mean "
        "'volume'?\n"
        "g.yaml:13:24: node 'sum': fake.sum has no input 'c'; it has: a, b\n"
        "g.yaml:13:41: node 'sum': there is no node 'tc'; did you mean 'ct'?\n"
        "g.yaml:16:19: node 'table': input 'source' takes Volume or Bricks, but all.image is "
        "Image; ct.volume would fit\n"
        "g.yaml:19:20: node 'all': parameter 'vector' must be between 1 and 4096, not 0\n"
        "g.yaml:22:11: node 'writer': input 'volume' takes one wire, not 2\n"
        "g.yaml:22:31: node 'writer': 'ct' names no output; write ct.volume\n"
        "g.yaml:25:19: node 'after': node 'writer' (fake.write) has no output 'volume'; it has "
        "none\n");
    for (const Plan::Node& node : plan.nodes) EXPECT_FALSE(node.ok) << node.id;
}

TEST(Check, NamesTheOutputsThatWouldFit) {
    EXPECT_THAT(problems_of(check_text(R"(voxloom: 1
nodes:
  - { id: ct, type: fake.source }
  - { id: t, type: fake.table, in: { source: ct.volume } }
  - { id: add, type: fake.add, in: { volume: t.transfer } }
)")),
                HasSubstr("g.yaml:5:46: node 'add': input 'volume' takes Volume, but t.transfer is "
                          "TransferFunction; "
                          "ct.volume would fit"));
}

TEST(Check, NamesTheNodesAlongEachCycle) {
    Plan plan = check_text(R"(voxloom: 1
nodes:
  - { id: a, type: fake.sum, in: { a: c.volume } }
  - { id: b, type: fake.add, in: { volume: a.volume } }
  - { id: c, type: fake.add, in: { volume: b.volume } }
  - { id: behind, type: fake.add, in: { volume: c.volume } }
  - { id: self, type: fake.sum, in: { a: self.volume, b: behind.volume } }
  - { id: apart, type: fake.source }
)");
    EXPECT_EQ(
        problems_of(plan),
        "g.yaml:3:11: node 'a': the wires run in a cycle: a -> b -> c -> a; remove one of them\n"
        "g.yaml:7:11: node 'self': the wires run in a cycle: self -> self; remove one of them\n");
    for (const Plan::Node& node : plan.nodes) EXPECT_EQ(node.ok, node.id == "apart") << node.id;
    EXPECT_EQ(plan.nodes.size(), 6u);
}

TEST(Check, ShortensALongCycle) {
    std::string text = "voxloom: 1\nnodes:\n";
    for (int i = 0; i < 1000; ++i)
        text += "  - { id: n" + std::to_string(i) + ", type: fake.add, in: { volume: n" +
                std::to_string((i + 999) % 1000) + ".volume } }\n";
    Plan plan = check_text(text);
    ASSERT_EQ(plan.problems.size(), 1u);
    EXPECT_THAT(plan.problems[0].message,
                HasSubstr("n0 -> n1 -> n2 -> n3 -> n4 -> ... 991 more ... -> "));
    EXPECT_LT(plan.problems[0].message.size(), 200u);
}

TEST(Check, SaysThatThereIsNothingToRun) {
    EXPECT_EQ(problems_of(check_text("voxloom: 1\n")),
              "g.yaml:1:1: there is nothing to run: the graph has no nodes\n");
}

TEST(Check, DescribesInOrderAndOnlyWhatHasNoProblem) {
    FakeCountsRegistry r;
    Plan plan = check(Document::parse(R"(voxloom: 1
nodes:
  - { id: a, type: fake.source, set: { size: 5, scalar: u8 } }
  - { id: b, type: fake.add, in: { volume: a.volume } }
  - { id: other, type: fake.source, set: { size: 6 } }
  - id: sum
    type: fake.sum
    in: { a: b.volume, b: other.volume }
  - { id: later, type: fake.add, in: { volume: sum.volume } }
  - { id: bad, type: fake.fail, set: { when: describe } }
  - { id: missing, type: fake.source, set: { path: no.nrrd } }
)",
                                      "/somewhere/g.yaml")
                          .graph(),
                      r.registry);
    EXPECT_EQ(problems_of(plan),
              "/somewhere/g.yaml:8:24: node 'sum': the volumes have different sizes: Volume 5 x 5 "
              "x 5 u8, spacing 1 x 1 x 1 "
              "and Volume 6 x 6 x 6 f32, spacing 1 x 1 x 1\n"
              "/somewhere/g.yaml:10:11: node 'bad': it failed; take another node\n"
              "/somewhere/g.yaml:11:52: node 'missing': there is no file /somewhere/no.nrrd\n");
    EXPECT_EQ(plan.nodes[std::size_t(plan.find("b"))].outputs[0].volume()->dims, Index3(5));
    EXPECT_FALSE(plan.nodes[std::size_t(plan.find("later"))].ok);
    EXPECT_TRUE(plan.nodes[std::size_t(plan.find("b"))].ok);
    EXPECT_EQ(r.counts.descriptions("fake.add"), 1);  // not of 'later'
    EXPECT_EQ(r.counts.descriptions("fake.source"), 3);
}

TEST(Check, WantsTheOutputsElseWhateverHasNoConsumer) {
    constexpr const char* nodes = R"(
nodes:
  - { id: w, type: fake.write, in: { volume: a.volume } }
  - { id: t, type: fake.table, in: { source: a.volume } }
  - { id: a, type: fake.source }
)";
    auto wanted = [&](const std::string& outputs) {
        Plan plan = check_text("voxloom: 1\n" + outputs + nodes);
        EXPECT_EQ(problems_of(plan), "");
        std::vector<std::string> names;
        for (Plan::Source s : plan.wanted)
            names.push_back(plan.nodes[std::size_t(s.node)].id + ":" + std::to_string(s.output));
        return names;
    };
    EXPECT_THAT(wanted(""), ElementsAre("w:-1", "t:0", "t:1"));
    EXPECT_THAT(wanted("outputs: [a.volume, t.transfer, w]"), ElementsAre("a:0", "t:1", "w:-1"));
}

// What is asked for, with what each node takes: "last(first:0)".
std::string wiring_of(const Plan& plan) {
    std::string all;
    for (const Plan::Source& wanted : plan.wanted) {
        const Plan::Node& node = plan.nodes[std::size_t(wanted.node)];
        all += (all.empty() ? "" : " ") + node.id + "(";
        std::string sources;
        for (const auto& port : node.inputs)
            for (const Plan::Source& source : port)
                sources += (sources.empty() ? "" : " ") + plan.nodes[std::size_t(source.node)].id + ":" +
                           std::to_string(source.output);
        all += sources + ")";
    }
    return all;
}

TEST(Check, ABypassedNodePassesItsInputOn) {
    const std::string text = R"(voxloom: 1
nodes:
  - { id: t, type: fake.table, in: { source: c.volume } }
  - { id: c, type: fake.add, use: bypassed, in: { volume: b.volume }, set: { nonsense: 1 } }
  - { id: b, type: fake.add, use: bypassed, in: { volume: a.volume } }
  - { id: a, type: fake.source, set: { size: 5 } }
)";
    const Plan plan = check_text(text);
    EXPECT_EQ(problems_of(plan), "") << "parameters of what does not run are not checked";
    EXPECT_EQ(wiring_of(plan), "t(a:0) t(a:0)");
    EXPECT_EQ(plan.nodes[std::size_t(plan.find("c"))].off, "it is bypassed");
    EXPECT_TRUE(plan.nodes[std::size_t(plan.find("t"))].ok);
    // Asked for by name, and as the last of a chain.
    EXPECT_EQ(wiring_of(check_text("outputs: [c.volume]\n" + text)), "a()");
    EXPECT_EQ(wiring_of(check_text("voxloom: 1\nnodes:\n  - { id: b, type: fake.add, use: bypassed, in: { volume: a.volume } }\n"
                                   "  - { id: a, type: fake.source }\n")), "a()");
    EXPECT_EQ(wiring_of(check_text("voxloom: 1\nnodes:\n  - { id: w, type: fake.write, use: bypassed, in: { volume: a.volume } }\n"
                                   "  - { id: a, type: fake.source }\n")), "");
}

TEST(Check, SaysWhatCannotBeBypassed) {
    Plan plan = check_text(R"(voxloom: 1
nodes:
  - { id: a, type: fake.source, use: bypassed }
  - { id: b, type: fake.add, in: { volume: a.volume } }
  - { id: c, type: fake.sum, in: { a: b.volume, b: a.volume } }
)");
    EXPECT_EQ(problems_of(plan),
              "g.yaml:3:11: node 'a': it cannot be bypassed: nothing that is wired to it could stand for its output "
              "'volume' (Volume), asked for by 'b'; disable it instead\n");
    EXPECT_FALSE(plan.nodes[std::size_t(plan.find("c"))].ok);
    plan = check_text(R"(voxloom: 1
nodes:
  - { id: a, type: fake.add, use: bypassed, in: { volume: b.volume } }
  - { id: b, type: fake.add, use: bypassed, in: { volume: a.volume } }
  - { id: c, type: fake.table, in: { source: a.volume } }
  - { id: d, type: fake.unheard-of, use: bypassed, in: { volume: c.volume } }
  - { id: e, type: fake.add, in: { volume: d.volume } }
)");
    EXPECT_THAT(problems_of(plan), HasSubstr("cannot be bypassed")) << "they pass on nothing but each other";
    EXPECT_THAT(problems_of(plan), HasSubstr("unknown node type"));
    EXPECT_FALSE(plan.nodes[std::size_t(plan.find("e"))].ok);
    EXPECT_THAT(problems_of(check_text("voxloom: 1\noutputs: [a.volume]\nnodes: [{ id: a, type: fake.source, use: bypassed }]\n")),
                HasSubstr("asked for by the graph's outputs"));
}

TEST(Check, DisabledNodesTakeAwayWhatNeedsThem) {
    const Plan plan = check_text(R"(voxloom: 1
nodes:
  - { id: off, type: fake.unheard-of, use: disabled, in: { x: nobody.y } }
  - { id: needs, type: fake.add, in: { volume: off.volume } }
  - { id: after, type: fake.table, in: { source: needs.volume } }
  - { id: a, type: fake.source }
  - { id: no, type: fake.source, use: disabled, set: { size: nonsense } }
  - { id: both, type: fake.sum, in: { a: a.volume, b: no.volume } }
  - { id: many, type: fake.gather, in: { volumes: [a.volume, no.volume, needs.volume] } }
  - { id: none, type: fake.gather, in: { volumes: [no.volume] } }
)");
    EXPECT_EQ(problems_of(plan), "");
    EXPECT_EQ(wiring_of(plan), "both(a:0) many(a:0)");
    auto off = [&](const char* id) { return plan.nodes[std::size_t(plan.find(id))].off; };
    EXPECT_EQ(off("off"), "it is disabled");
    EXPECT_EQ(off("needs"), "it needs 'off', which is disabled");
    EXPECT_EQ(off("after"), "it needs 'off', which is disabled");
    EXPECT_EQ(off("none"), "it needs 'no', which is disabled");
    EXPECT_THAT(plan.warnings, ::testing::Contains(HasSubstr("'after' is left out: it needs 'off', which is disabled")));
    EXPECT_THAT(plan.warnings, ::testing::Contains(HasSubstr("'both' runs without 'no'")));
    EXPECT_THAT(problems_of(check_text("voxloom: 1\nnodes: [{ id: a, type: fake.source, use: disabled }]\n")),
                HasSubstr("nothing to run"));
}

TEST(Check, TakesListsWhereAPortTakesMany) {
    Plan plan = check_text(R"(voxloom: 1
nodes:
  - { id: a, type: fake.source }
  - { id: b, type: fake.source }
  - { id: one, type: fake.gather, in: { volumes: a.volume } }
  - { id: all, type: fake.gather, in: { volumes: [b.volume, a.volume, b.volume] } }
  - { id: single, type: fake.add, in: { volume: [a.volume] } }
)");
    EXPECT_EQ(problems_of(plan), "");
    std::vector<std::string> from;
    for (Plan::Source s : plan.nodes[std::size_t(plan.find("all"))].inputs[0])
        from.push_back(plan.nodes[std::size_t(s.node)].id);
    EXPECT_THAT(from, ElementsAre("b", "a", "b"));
    EXPECT_THAT(problems_of(check_text(
                    "voxloom: 1\nnodes: [{ id: g, type: fake.gather, in: { volumes: [] } }]\n")),
                HasSubstr("input 'volumes' has no wire; it needs at least one Volume"));
}

TEST(Check, AppliesOverridesAsIfTheyStoodInTheGraph) {
    CheckOptions options;
    options.overrides_base = "/base";
    options.overrides = {"first.size=7",           "all.vector=[3, 4]", "all.text=a: [b",
                         "all.path_in=x/../y.raw", "all.boolean=true",  "all.rows=[[1, 2]]",
                         "all.texts=[a, 'b c']",   "all.choice=blue",   "all.real=1e-1",
                         "all.path_out=o.txt"};
    std::string text = std::string(kChain) + "  - { id: all, type: fake.every }\n";
    Plan plan = check_text(text, options);
    EXPECT_EQ(problems_of(plan), "");
    const Params& first = plan.nodes[std::size_t(plan.find("first"))].params;
    const Params& all = plan.nodes[std::size_t(plan.find("all"))].params;
    EXPECT_EQ(first.integer("size"), 7);
    EXPECT_EQ(plan.nodes[std::size_t(plan.find("last"))].outputs[0].volume()->dims.x, 7);
    EXPECT_EQ(all.size2("vector"), glm::ivec2(3, 4));
    EXPECT_EQ(all.text("text"), "a: [b");
    EXPECT_EQ(all.path("path_in"), "/base/y.raw");
    EXPECT_TRUE(all.boolean("boolean"));
    EXPECT_EQ(all.rows("rows"), (Rows{{1, 2}}));
    EXPECT_THAT(all.texts("texts"), ElementsAre("a", "b c"));
    EXPECT_EQ(all.real("real"), 0.1);
    EXPECT_TRUE(all.was_set("real"));
    EXPECT_FALSE(all.was_set("integer"));
}

TEST(Check, SaysWhatIsWrongWithAnOverride) {
    CheckOptions options;
    auto problem = [&](const std::string& text) {
        options.overrides = {text};
        Plan plan = check_text(kChain, options);
        return plan.problems.empty() ? "" : plan.problems[0].message;
    };
    EXPECT_EQ(problem("first.sise=3"),
              "--set first.sise=3: node 'first' (fake.source) has no parameter 'sise'; did you "
              "mean 'size'?");
    EXPECT_EQ(problem("frist.size=3"),
              "--set frist.size=3: there is no node 'frist'; did you mean 'first'?");
    EXPECT_EQ(problem("first.size=x"),
              "--set first.size=x: parameter 'size' must be a whole number, not 'x'");
    EXPECT_EQ(problem("first.size=-1"),
              "--set first.size=-1: parameter 'size' must be between 0 and 1e+09, not -1");
    EXPECT_EQ(problem("size=3"), "--set size=3: write NODE.PARAM=VALUE");
    EXPECT_EQ(problem("first.size"), "--set first.size: write NODE.PARAM=VALUE");
    EXPECT_EQ(check_text(kChain, options).problems[0].text("g.yaml"),
              "--set first.size: write NODE.PARAM=VALUE");
}

TEST(Check, WarnsWhenTheMemoryWouldNotDo) {
    CheckOptions options;
    options.memory_limit = 1000;
    EXPECT_THAT(check_text(kChain, options).warnings, ElementsAre());  // 2 * 27 * 4 bytes
    options.overrides = {"first.size=10"};
    ASSERT_EQ(check_text(kChain, options).warnings.size(), 1u);
    EXPECT_THAT(check_text(kChain, options).warnings[0],
                HasSubstr("may need 7.8 KiB of memory at once, 3.9 KiB of it for node"));
    options.overrides = {"first.size=1000000000"};  // overflows 64 bits
    EXPECT_EQ(check_text(kChain, options).warnings.size(), 1u);
    // What nobody asked for costs nothing.
    options.overrides = {};
    EXPECT_THAT(check_text("voxloom: 1\noutputs: [b.volume]\nnodes:\n- { id: a, type: fake.source, "
                           "set: { size: 99 } }\n"
                           "- { id: b, type: fake.source, set: { size: 2 } }\n",
                           options)
                    .warnings,
                ElementsAre());
}

TEST(Check, VolumesReadByRegionCostNoMemory) {
    VolumeDesc large;
    large.dims = {1000, 1000, 1000};
    ValueDesc streamed(large);
    streamed.by_region = true;
    NodeType source;
    source.id = "fake.streamed";
    source.title = "Streamed";
    source.doc = "A volume.";
    source.outputs = {{"volume", PortType::volume, "A volume."}};
    source.describe = [&](Description& d) { d.output("volume", streamed); };
    source.evaluate = [](Evaluation&) {};
    Registry registry;
    registry.add(source);
    CheckOptions options;
    options.memory_limit = 1000;
    const Document document = Document::parse("voxloom: 1\nnodes:\n- { id: a, type: fake.streamed }\n");
    EXPECT_THAT(check(document.graph(), registry, options).warnings, ElementsAre());
    streamed.by_region = false;
    EXPECT_EQ(check(document.graph(), registry, options).warnings.size(), 1u);
}

TEST(Check, TakesTenThousandNodesInChainsAndFans) {
    std::string text = "voxloom: 1\nnodes:\n  - { id: n0, type: fake.source }\n";
    for (int i = 1; i < 10000; ++i)
        text += "  - { id: n" + std::to_string(i) + ", type: fake.add, in: { volume: n" +
                std::to_string(i % 2 ? 0 : i - 2) + ".volume } }\n";
    Plan plan = check_text(text);
    EXPECT_EQ(problems_of(plan), "");
    EXPECT_EQ(plan.nodes.size(), 10000u);
    EXPECT_EQ(plan.wanted.size(), 5001u);
    for (std::size_t i = 0; i < plan.nodes.size(); ++i)
        for (const auto& port : plan.nodes[i].inputs)
            for (Plan::Source s : port) ASSERT_LT(s.node, int(i));
    // Ten thousand wrong names are no harder.
    for (std::size_t at = 0; (at = text.find("n0.volume", at)) != std::string::npos;)
        text.replace(at, 2, "m0");
    EXPECT_EQ(check_text(text).problems.size(), 5001u);
}

}  // namespace
}  // namespace voxloom
