#include "tests/support/run_node.h"

#include <cstdlib>
#include <mutex>

#include "core/base/text.h"
#include "core/gpu/thread.h"
#include "core/graph/document.h"
#include "core/plugin/loader.h"

namespace voxloom::testing {

const Registry& built_plugins() {
    static const Registry registry = [] {
        Registry all;
        auto folders = plugin_search_path();
        if (!std::getenv("VOXLOOM_PLUGIN_PATH"))
            folders = {std::filesystem::path(VOXLOOM_BINARY_DIR) / "lib/voxloom/plugins"};
        LoadReport report = load_plugins(all, folders);
        if (!report.problems.empty()) fail("{}", join(report.problems, "\n"));
        return all;
    }();
    return registry;
}

double NodeRun::measured(std::string_view name) const {
    auto it = measurements.find(std::string(name));
    if (it == measurements.end()) fail("nothing was measured as '{}'", name);
    return it->second.first;
}

namespace {

std::vector<std::string> keys_of(const NodeType& type) {
    std::vector<std::string> keys;
    for (const ParamSpec& spec : type.params) keys.push_back(spec.key);
    return keys;
}

class OneDescription final : public Description {
  public:
    OneDescription(const NodeType& type, const Params& params,
                   const std::map<std::string, std::vector<ValueDesc>, std::less<>>& inputs)
        : type_(type), params_(params), inputs_(inputs) {
        for (const PortSpec& port : type.outputs)
            for (int t = 0; t < kPortTypes; ++t)
                if (port.types.has(PortType(t))) result.outputs[port.key] = ValueDesc(PortType(t));
    }
    const Params& params() const override { return params_; }
    const ValueDesc* input(std::string_view port) const override {
        const auto& all = inputs(port);
        return all.empty() ? nullptr : &all.front();
    }
    const std::vector<ValueDesc>& inputs(std::string_view port) const override {
        static const std::vector<ValueDesc> none;
        if (!type_.find_input(port))
            fail("{}: asks for an input '{}' that it does not have", type_.id, port);
        auto it = inputs_.find(port);
        return it == inputs_.end() ? none : it->second;
    }
    void output(std::string_view port, ValueDesc desc) override {
        if (!type_.find_output(port))
            fail("{}: describes an output '{}' that it does not have", type_.id, port);
        result.outputs[std::string(port)] = std::move(desc);
    }
    void problem(std::string message, std::string_view where) override {
        result.problems.push_back(where.empty() ? message : std::string(where) + ": " + message);
    }
    void working_memory(std::uint64_t bytes) override { result.working_memory = bytes; }

    NodeDescribed result;

  private:
    const NodeType& type_;
    const Params& params_;
    const std::map<std::string, std::vector<ValueDesc>, std::less<>>& inputs_;
};

class OneEvaluation final : public Evaluation {
  public:
    OneEvaluation(const NodeType& type, const Params& params, const NodeInputs& inputs,
                  const RunNodeOptions& options)
        : type_(type), params_(params), inputs_(inputs), options_(options) {}
    const Params& params() const override { return params_; }
    const Value& value(std::string_view port) const override {
        static const Value none;
        const auto& all = values(port);
        return all.empty() ? none : all.front();
    }
    const std::vector<Value>& values(std::string_view port) const override {
        static const std::vector<Value> none;
        if (!type_.find_input(port))
            fail("{}: asks for an input '{}' that it does not have", type_.id, port);
        auto it = inputs_.find(port);
        return it == inputs_.end() ? none : it->second;
    }
    void output(std::string_view port, Value value) override {
        check_port(port, value);
        result.outputs[std::string(port)] = std::move(value);
    }
    void provisional(std::string_view port, Value value) override {
        check_port(port, value);
        std::lock_guard lock(mutex_);
        result.provisional.emplace_back(port, std::move(value));
    }
    bool wants_provisional() const override { return options_.wants_provisional; }
    const std::stop_token& stop() const override { return options_.stop; }
    void progress(double fraction, std::string_view) override {
        std::lock_guard lock(mutex_);
        result.progress.push_back(fraction);
    }
    void count(std::string_view counter, double amount) override {
        std::lock_guard lock(mutex_);
        result.counters[std::string(counter)] += amount;
    }
    void measure(std::string_view name, double value, std::string_view unit) override {
        std::lock_guard lock(mutex_);
        result.measurements[std::string(name)] = {value, std::string(unit)};
    }
    void warn(std::string message) override {
        std::lock_guard lock(mutex_);
        result.warnings.push_back(std::move(message));
    }
    void add_draw_seconds(double seconds) override {
        std::lock_guard lock(mutex_);
        result.draw_seconds += seconds;
    }
    std::filesystem::path output_path(std::string_view key) const override {
        std::filesystem::path path = params_.path(key);
        if (path.is_absolute() || options_.output_folder.empty()) return path;
        path = options_.output_folder / path;
        std::filesystem::create_directories(path.parent_path());
        return path;
    }
    const std::string& node_id() const override { return type_.id; }

    NodeRun result;

  private:
    void check_port(std::string_view port, const Value& value) const {
        const PortSpec* spec = type_.find_output(port);
        if (!spec) fail("{}: delivers an output '{}' that it does not have", type_.id, port);
        if (is_empty(value) || !spec->types.has(type_of(value)))
            fail("{}: its output '{}' is not a {}", type_.id, port, spec->types.text());
    }

    const NodeType& type_;
    const Params& params_;
    const NodeInputs& inputs_;
    const RunNodeOptions& options_;
    std::mutex mutex_;
};

// A description is a promise: consumers were checked against it.
void check_promise(const NodeType& type, const NodeRun& run) {
    for (const PortSpec& port : type.outputs) {
        auto it = run.outputs.find(port.key);
        if (it == run.outputs.end())
            fail("{}: does not deliver its output '{}'", type.id, port.key);
        const VolumeDesc* promised = run.described.find(port.key)->second.volume();
        if (!promised) continue;
        ValueDesc desc = describe(it->second);
        const VolumeDesc* delivered = desc.volume();
        if (!delivered || summary(*promised) != summary(*delivered) ||
            promised->index_to_world != delivered->index_to_world)
            fail("{}: describes its output '{}' as {} and delivers {}", type.id, port.key,
                 summary(*promised), delivered ? summary(*delivered) : "nothing");
    }
}

}  // namespace

Params params_from_yaml(const NodeType& type, const std::string& yaml,
                        const std::filesystem::path& graph_folder) {
    Params params(type.params,
                  graph_folder.empty() ? std::filesystem::path(VOXLOOM_SOURCE_DIR) : graph_folder);
    if (yaml.empty()) return params;
    const Document document = Document::parse(
        "voxloom: 1\nnodes:\n  - {id: node, type: " + type.id + ", set: " + yaml + "}\n");
    for (const GraphParam& given : document.graph().nodes.front().params) {
        const ParamSpec* spec = type.find_param(given.key);
        if (!spec)
            fail("{}: unknown parameter '{}'{}", type.id, given.key,
                 did_you_mean(given.key, keys_of(type)));
        std::string reason;
        std::optional<ParamValue> value = parse_param(*spec, given.yaml, reason);
        if (!value) fail("{}: parameter '{}' {}", type.id, given.key, reason);
        params.set(given.key, std::move(*value));
    }
    return params;
}

NodeDescribed describe_node(
    const NodeType& type, const Params& params,
    const std::map<std::string, std::vector<ValueDesc>, std::less<>>& inputs) {
    OneDescription description(type, params, inputs);
    if (type.describe) type.describe(description);
    return std::move(description.result);
}

NodeRun run_node(const NodeType& type, const Params& params, const NodeInputs& inputs,
                 const RunNodeOptions& options) {
    std::map<std::string, std::vector<ValueDesc>, std::less<>> descs;
    for (const auto& [port, values] : inputs) {
        const PortSpec* spec = type.find_input(port);
        if (!spec) fail("{}: has no input '{}'", type.id, port);
        for (const Value& value : values) {
            if (is_empty(value) || !spec->types.has(type_of(value)))
                fail("{}: input '{}' takes {}", type.id, port, spec->types.text());
            descs[port].push_back(describe(value));
        }
    }
    for (const PortSpec& port : type.inputs)
        if (!port.optional && !inputs.contains(port.key))
            fail("{}: input '{}' is not wired", type.id, port.key);

    NodeDescribed described = describe_node(type, params, descs);
    if (!described.problems.empty()) fail("{}: {}", type.id, join(described.problems, "\n"));

    OneEvaluation evaluation(type, params, inputs, options);
    if (type.thread == NodeType::Thread::opengl)
        gpu::run([&] { type.evaluate(evaluation); });
    else
        type.evaluate(evaluation);

    NodeRun run = std::move(evaluation.result);
    run.described = std::move(described.outputs);
    run.working_memory = described.working_memory;
    check_promise(type, run);
    return run;
}

NodeRun run_node(const Registry& registry, std::string_view type, const std::string& params_yaml,
                 const NodeInputs& inputs, const RunNodeOptions& options) {
    const NodeType* found = registry.find(type);
    if (!found) fail("no node type '{}'{}", type, did_you_mean(type, registry.ids()));
    return run_node(*found, params_from_yaml(*found, params_yaml, options.graph_folder), inputs,
                    options);
}

}  // namespace voxloom::testing
