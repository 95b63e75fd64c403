// Every node of every built plugin, by what its description says, without a line about any of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <fstream>
#include <set>

#include "core/gpu/thread.h"
#include "core/graph/check.h"
#include "core/plugin/plugin.h"
#include "tests/support/run_node.h"
#include "tests/support/sample_values.h"
#include "tests/support/volumes.h"

namespace voxloom {
namespace {

namespace fs = std::filesystem;
using testing::built_plugins;
using testing::NodeInputs;
using testing::NodeRun;
using testing::sample_value;
using testing::TempFolder;

bool is_sentence(const std::string& s) {
    return s.size() > 3 && (s.back() == '.' || s.back() == ')');
}

// Drawing nodes run where there is OpenGL; Mesa is not instrumented for sanitizers.
bool can_run(const NodeType& type) {
    if (type.thread == NodeType::Thread::worker) return true;
    return std::string_view(VOXLOOM_SANITIZER) == "none" && gpu::why_unavailable().empty();
}

PortType first_of(PortTypes types) {
    int t = 0;
    while (!types.has(PortType(t))) ++t;
    return PortType(t);
}

std::vector<PortType> all_of(PortTypes types) {
    std::vector<PortType> all;
    for (int t = 0; t < kPortTypes; ++t)
        if (types.has(PortType(t))) all.push_back(PortType(t));
    return all;
}

// Defaults, but for the size of pictures: what is tested here does not depend on it.
Params small_params(const NodeType& type) {
    Params params(type.params, VOXLOOM_SOURCE_DIR);
    if (const ParamSpec* size = type.find_param("size");
        size && size->kind == ParamKind::vector && size->length == 2)
        params.set("size", std::vector<double>{24, 17});
    return params;
}

// What to wire: one of each required port, optional ones too when asked for; `pick` chooses among
// the types that the first input accepts.
NodeInputs inputs_for(const NodeType& type, Index3 dims, bool optional, PortType pick) {
    NodeInputs inputs;
    for (const PortSpec& port : type.inputs)
        if (!port.optional || optional) {
            const PortType t = port.types.has(pick) ? pick : first_of(port.types);
            inputs[port.key].push_back(sample_value(t, dims));
            if (port.many) inputs[port.key].push_back(sample_value(t, dims));
        }
    return inputs;
}

// Each way to wire a node: with and without its optional inputs, with each type of its first input.
template <class F>
void for_each_wiring(const NodeType& type, Index3 dims, const F& f) {
    const std::vector<PortType> picks = type.inputs.empty()
                                            ? std::vector<PortType>{PortType::volume}
                                            : all_of(type.inputs.front().types);
    for (PortType pick : picks)
        for (bool optional : {false, true}) {
            SCOPED_TRACE(std::string(name_of(pick)) +
                         (optional ? ", every input" : ", required inputs"));
            f(inputs_for(type, dims, optional, pick));
        }
}

// The outcome of a run: every byte of its outputs and files, or the sentence of its error.
struct Outcome {
    std::string error;
    std::map<std::string, std::vector<std::byte>> outputs;
    friend bool operator==(const Outcome&, const Outcome&) = default;
};

Outcome outcome_of(const NodeType& type, const NodeInputs& inputs) {
    TempFolder folder;
    testing::RunNodeOptions options;
    options.output_folder = folder.path();
    Outcome outcome;
    try {
        NodeRun run = testing::run_node(type, small_params(type), inputs, options);
        for (const auto& [port, value] : run.outputs)
            outcome.outputs[port] = testing::bytes_of_value(value);
    } catch (const Error& e) {
        outcome.error = e.what();
        // A sentence names the place; only the folder's name differs from run to run.
        for (std::size_t at;
             (at = outcome.error.find(folder.path().string())) != std::string::npos;)
            outcome.error.erase(at, folder.path().string().size());
        EXPECT_GT(outcome.error.size(), 15u) << outcome.error;
    }
    for (const auto& entry : fs::recursive_directory_iterator(folder.path())) {
        if (!entry.is_regular_file()) continue;
        EXPECT_TRUE(outcome.error.empty()) << "left behind: " << entry.path();
        std::ifstream in(entry.path(), std::ios::binary);
        const std::string content(std::istreambuf_iterator<char>(in), {});
        auto bytes = std::as_bytes(std::span(content));
        outcome.outputs["file " + entry.path().filename().string()].assign(bytes.begin(),
                                                                           bytes.end());
    }
    return outcome;
}

TEST(RegistrySweep, ThereAreNodesOfSeveralPlugins) {
    std::set<std::string> origins;
    for (const std::string& id : built_plugins().ids()) origins.insert(built_plugins().origin(id));
    EXPECT_GE(origins.size(), 3u);
}

TEST(RegistrySweep, EveryNodeSaysWhatItIs) {
    for (const NodeType* type : built_plugins().all()) {
        SCOPED_TRACE(type->id);
        EXPECT_EQ(problem_with(*type), "");
        EXPECT_GE(type->version, 1);
        EXPECT_FALSE(type->title.empty());
        EXPECT_TRUE(is_sentence(type->doc)) << type->doc;
        EXPECT_FALSE(type->keywords.empty());
        EXPECT_GT(type->method.size(), 80u) << "no words on method, use and limits";
        for (const auto* ports : {&type->inputs, &type->outputs})
            for (const PortSpec& port : *ports)
                EXPECT_TRUE(is_sentence(port.doc)) << port.key << ": " << port.doc;
        EXPECT_TRUE(type->writes_files || !type->outputs.empty()) << "it has no effect";
    }
}

TEST(RegistrySweep, EveryParameterIsDescribedAndItsRangesHoldTogether) {
    for (const NodeType* type : built_plugins().all())
        for (const ParamSpec& spec : type->params) {
            SCOPED_TRACE(type->id + "." + spec.key);
            EXPECT_TRUE(is_sentence(spec.doc)) << spec.doc;
            EXPECT_LE(spec.min, spec.max);
            EXPECT_LE(spec.slider_min, spec.slider_max);
            if (spec.slider_min < spec.slider_max) {
                EXPECT_GE(spec.slider_min, spec.min);
                EXPECT_LE(spec.slider_max, spec.max);
            }
            if (spec.kind == ParamKind::choice) {
                EXPECT_GE(spec.choices.size(), 2u);
                EXPECT_EQ(std::set<std::string>(spec.choices.begin(), spec.choices.end()).size(),
                          spec.choices.size());
            }
            if (!spec.shown_if_key.empty()) {
                const ParamSpec* other = type->find_param(spec.shown_if_key);
                ASSERT_NE(other, nullptr);
                EXPECT_FALSE(spec.shown_if_values.empty());
                if (other->kind != ParamKind::choice) continue;
                for (const std::string& v : spec.shown_if_values)
                    EXPECT_NE(std::find(other->choices.begin(), other->choices.end(), v),
                              other->choices.end())
                        << v;
            }
        }
}

TEST(RegistrySweep, ParametersSurviveTheGraphsText) {
    for (const NodeType* type : built_plugins().all())
        for (const ParamSpec& spec : type->params) {
            SCOPED_TRACE(type->id + "." + spec.key);
            std::vector<ParamValue> values = {spec.initial};
            for (const std::string& choice : spec.choices) values.emplace_back(choice);
            if (spec.kind == ParamKind::boolean) values.insert(values.end(), {true, false});
            if (spec.kind == ParamKind::real)
                for (double v : {spec.min, spec.max, 1.0 / 3})
                    if (std::isfinite(v) && v >= spec.min && v <= spec.max) values.emplace_back(v);
            if (spec.kind == ParamKind::text)
                values.emplace_back(std::string("a 'quoted' \"text\": # not a comment, [1]"));
            for (const ParamValue& value : values) {
                const std::string yaml = "{" + spec.key + ": " + to_yaml(value) + "}";
                EXPECT_EQ(testing::params_from_yaml(*type, yaml).value(spec.key), value) << yaml;
            }
        }
}

// A registry with one more node for each port type, which only has an output of that type.
Registry with_sources() {
    Registry registry = built_plugins();
    for (int t = 0; t < kPortTypes; ++t) {
        NodeType source;
        source.id = "test.source" + std::to_string(t);
        source.title = source.doc = "Source.";
        source.outputs = {{"out", PortType(t), "A value."}};
        source.evaluate = [t](Evaluation& e) {
            e.output("out", sample_value(PortType(t), {4, 4, 4}));
        };
        registry.add(source);
    }
    return registry;
}

TEST(RegistrySweep, AWireOfAWrongTypeIsRefusedWithBothTypesNamed) {
    const Registry registry = with_sources();
    for (const NodeType* type : built_plugins().all())
        for (const PortSpec& port : type->inputs)
            for (int t = 0; t < kPortTypes; ++t) {
                const Document document = Document::parse(
                    "voxloom: 1\nnodes:\n  - {id: s, type: test.source" + std::to_string(t) +
                    "}\n  - {id: n, type: " + type->id + ", in: {" + port.key + ": s.out}}\n");
                const Plan plan = check(document.graph(), registry);
                std::string message;
                for (const Problem& problem : plan.problems)
                    if (problem.node == "n" && problem.where == port.key)
                        message += problem.message;
                SCOPED_TRACE(type->id + "." + port.key + " <- " +
                             std::string(name_of(PortType(t))) + ": " + message);
                if (port.types.has(PortType(t))) continue;
                EXPECT_NE(message.find(name_of(PortType(t))), std::string::npos);
                EXPECT_NE(message.find(port.types.text()), std::string::npos);
                EXPECT_FALSE(plan.nodes[std::size_t(plan.find("n"))].ok);
            }
}

TEST(RegistrySweep, VolumesOfNoAndOfOneVoxelGiveAResultOrAClearError) {
    for (const NodeType* type : built_plugins().all()) {
        if (!can_run(*type)) continue;
        for (Index3 dims : {Index3(0, 0, 0), Index3(5, 0, 3), Index3(1, 1, 1), Index3(1, 7, 5),
                            Index3(2, 3, 1)}) {
            SCOPED_TRACE(fmt::format("{} {}x{}x{}", type->id, dims.x, dims.y, dims.z));
            for_each_wiring(*type, dims, [&](const NodeInputs& inputs) {
                EXPECT_NO_THROW(outcome_of(*type, inputs));
            });
        }
    }
}

TEST(RegistrySweep, RunTwiceGivesTheSameBytes) {
    for (const NodeType* type : built_plugins().all()) {
        if (!can_run(*type)) continue;
        SCOPED_TRACE(type->id);
        for_each_wiring(*type, {19, 17, 11}, [&](const NodeInputs& inputs) {
            const Outcome first = outcome_of(*type, inputs);
            EXPECT_TRUE(first == outcome_of(*type, inputs)) << first.error;
        });
    }
}

// A gigabyte that nobody should read: counts the voxels that are asked for after the stop.
class Endless final : public Volume {
  public:
    Endless() : Volume(big()) {}
    void read(const Box& box, std::span<std::byte> out,
              const std::stop_token& stop) const override {
        check_stop(stop);
        voxels_read_ += box.voxels();
        std::fill(out.begin(), out.end(), std::byte(7));
    }
    static VolumeDesc big() {
        VolumeDesc desc;
        desc.dims = {1024, 1024, 1024};
        return desc;
    }
    mutable std::atomic<std::uint64_t> voxels_read_{0};
};

TEST(RegistrySweep, AStoppedNodeReturnsAtOnceAndLeavesNothingBehind) {
    std::stop_source stop;
    stop.request_stop();
    for (const NodeType* type : built_plugins().all()) {
        if (!can_run(*type)) continue;
        SCOPED_TRACE(type->id);
        auto endless = std::make_shared<Endless>();
        NodeInputs inputs = inputs_for(*type, {4, 4, 4}, true, PortType::volume);
        for (const PortSpec& port : type->inputs)
            if (port.types.has(PortType::volume))
                inputs[port.key].assign(port.many ? 2 : 1, Value(VolumePtr(endless)));
        TempFolder folder;
        testing::RunNodeOptions options;
        options.output_folder = folder.path();
        options.stop = stop.get_token();
        bool finished = false;  // right where there was nothing to stop
        try {
            testing::run_node(*type, small_params(*type), inputs, options);
            finished = true;
        } catch (const Cancelled&) {
        } catch (const Error& e) {
            EXPECT_NE(std::string(e.what()), "");  // refused before it began
        }
        EXPECT_LE(endless->voxels_read_, 64u << 20) << "it went on reading";
        EXPECT_TRUE(finished || fs::is_empty(folder.path()));
    }
}

}  // namespace
}  // namespace voxloom
