// Runs one node of a registry by itself: describe, then evaluate, without graph, cache or plan.
//
//     NodeRun run = run_node(built_plugins(), "readers.phantom", "{kind: ramp, dims: [8, 8, 8]}");
//     VolumePtr volume = run.volume();
#pragma once

#include <filesystem>
#include <map>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/graph/node.h"
#include "core/plugin/registry.h"

namespace voxloom::testing {

// Every plugin of the build, loaded once a process from VOXLOOM_PLUGIN_PATH, else from the build
// folder. Throws Error when one of them is refused.
const Registry& built_plugins();

// What is wired to the input ports; a port that takes many has several.
using NodeInputs = std::map<std::string, std::vector<Value>, std::less<>>;

struct RunNodeOptions {
    std::stop_token stop;
    std::filesystem::path graph_folder;  // base of relative path_in; empty: the source folder
    std::filesystem::path
        output_folder;  // base of relative path_out; empty: path_out stays as given
    bool wants_provisional = false;
};

// All that a node said of itself while it was described and evaluated.
struct NodeRun {
    std::map<std::string, Value, std::less<>> outputs;
    std::map<std::string, ValueDesc, std::less<>> described;
    std::vector<std::pair<std::string, Value>> provisional;
    std::map<std::string, double> counters;
    std::map<std::string, std::pair<double, std::string>> measurements;  // value, unit
    std::vector<std::string> warnings;
    std::vector<double> progress;  // fractions, in the order in which they came
    std::uint64_t working_memory = 0;
    double draw_seconds = 0;

    // The output as shared_ptr<const T>; throws Error when it is missing or of another type.
    template <class T>
    std::shared_ptr<const T> output(std::string_view port) const {
        auto it = outputs.find(port);
        auto* p =
            it == outputs.end() ? nullptr : std::get_if<std::shared_ptr<const T>>(&it->second);
        if (!p || !*p) fail("output '{}' is not there", port);
        return *p;
    }
    VolumePtr volume(std::string_view port = "volume") const { return output<Volume>(port); }
    ImagePtr image(std::string_view port = "image") const { return output<Image>(port); }
    double measured(std::string_view name) const;  // throws Error when it was not measured
};

// The parameters of a node type, from a YAML mapping in one line ("{size: [64, 64], shading:
// true}"). Throws Error for unknown keys and for what is no value of theirs.
Params params_from_yaml(const NodeType& type, const std::string& yaml,
                        const std::filesystem::path& graph_folder = {});

// Describes only. `problems` are what the node reported, as "where: message".
struct NodeDescribed {
    std::map<std::string, ValueDesc, std::less<>> outputs;
    std::vector<std::string> problems;
    std::uint64_t working_memory = 0;
};
NodeDescribed describe_node(
    const NodeType& type, const Params& params,
    const std::map<std::string, std::vector<ValueDesc>, std::less<>>& inputs);

// Describes and evaluates; the node's own thread (worker or OpenGL) is respected. Problems of the
// description are thrown as Error, as are the evaluation's; so is an output that is missing or is
// not what the description said.
NodeRun run_node(const NodeType& type, const Params& params, const NodeInputs& inputs = {},
                 const RunNodeOptions& options = {});
NodeRun run_node(const Registry& registry, std::string_view type,
                 const std::string& params_yaml = {}, const NodeInputs& inputs = {},
                 const RunNodeOptions& options = {});

}  // namespace voxloom::testing
