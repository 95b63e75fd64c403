#include "app/editor/model/evaluator.h"

#include <fmt/format.h>

#include <algorithm>

#include "app/editor/model/ports.h"
#include "core/base/meter.h"
#include "core/graph/result_key.h"

namespace voxloom::editor {

namespace {

bool is_shown(PortType type) {
    return type == PortType::image || type == PortType::table || type == PortType::camera || type == PortType::transfer;
}

std::optional<Plan::Source> source_of(const Plan& plan, const WireEnd& end) {
    const int node = plan.find(end.node);
    if (node < 0 || !plan.nodes[std::size_t(node)].ok) return {};
    const NodeType& type = *plan.nodes[std::size_t(node)].type;
    const PortSpec* port = type.find_output(end.port);
    if (!port) return {};
    return Plan::Source{node, int(port - type.outputs.data())};
}

// Files are written when somebody asks for it, not whenever a parameter moves.
std::vector<Plan::Source> wanted_of(const Plan& plan, const Evaluator::Request& request) {
    std::vector<Plan::Source> wanted;
    auto add = [&](const Plan::Source& source) {
        for (const Plan::Source& w : wanted)
            if (w.node == source.node && w.output == source.output) return;
        wanted.push_back(source);
    };
    for (const WireEnd& end : request.watched)
        if (auto source = source_of(plan, end)) add(*source);
    if (request.coarse) return wanted;
    for (const Plan::Source& source : plan.wanted) {
        const Plan::Node& node = plan.nodes[std::size_t(source.node)];
        if (node.ok && (request.write || !node.type->writes_files)) add(source);
    }
    if (request.write)
        for (int i = 0; i < int(plan.nodes.size()); ++i)
            if (plan.nodes[std::size_t(i)].ok && plan.nodes[std::size_t(i)].type->writes_files) add({i, -1});
    return wanted;
}

}  // namespace

std::vector<std::string> coarse_overrides(const Plan& plan) {
    std::vector<std::string> overrides;
    for (const Plan::Node& node : plan.nodes) {
        if (!node.ok) continue;
        const ParamSpec* size = node.type->find_param("size");
        const bool draws = std::any_of(node.type->outputs.begin(), node.type->outputs.end(),
                                       [](const PortSpec& port) { return type_of(port) == PortType::image; });
        if (!draws || !size || !size->quality || size->kind != ParamKind::vector || size->length != 2) continue;
        const std::vector<double>& full = node.params.numbers("size");
        overrides.push_back(fmt::format("{}.size=[{}, {}]", node.id, std::max(1.0, std::round(full[0] / 3)),
                                        std::max(1.0, std::round(full[1] / 3))));
    }
    return overrides;
}

Evaluator::Evaluator(const Registry& registry, std::function<void()> changed)
    : registry_(registry), changed_(std::move(changed)) {
    runner_ = std::make_unique<LiveRunner>(
        cache_, static_cast<RunObserver*>(this), [this](const Plan& plan, const RunResult& result) { done(plan, result); });
    thread_ = std::thread([this] { loop(); });
}

Evaluator::~Evaluator() {
    {
        std::lock_guard lock(mutex_);
        ending_ = true;
    }
    wake_.notify_all();
    thread_.join();
    runner_.reset();  // cancels and waits: nothing calls back afterwards
}

void Evaluator::submit(Request request) {
    {
        std::lock_guard lock(mutex_);
        // What was asked to be written is written, whatever is changed meanwhile.
        if ((next_ && next_->write) || state_.writing) request.write = true;
        if (request.write) request.coarse = false;
        next_ = std::move(request);
        submitted_ns_ = wall_ns();
        picture_pending_ = true;
        touch();
    }
    wake_.notify_all();
}

void Evaluator::cancel() {
    runner_->cancel();
    std::lock_guard lock(mutex_);
    next_.reset();
    cancelled_ = planning_;
    newest_ = nullptr;
    running_ = running_coarse_ = state_.writing = false;
    for (auto& [id, status] : state_.nodes)
        if (status.state == NodeState::running) status.state = NodeState::cancelled;
    touch();
    wake_.notify_all();
}

bool Evaluator::refresh(State& state) const {
    std::lock_guard lock(mutex_);
    if (state.revision == state_.revision) return false;
    state = state_;
    return true;
}

void Evaluator::wait_idle() {
    std::unique_lock lock(mutex_);
    wake_.wait(lock, [&] { return !next_ && !planning_ && !running_; });
}

void Evaluator::touch() {
    ++state_.revision;
    state_.busy = next_ || planning_ || running_;
    if (changed_) changed_();
}

// --- requests to plans ---------------------------------------------------------------------------

void Evaluator::loop() {
    std::unique_lock lock(mutex_);
    for (;;) {
        wake_.wait(lock, [&] { return ending_ || (next_ && !(running_coarse_ && next_->coarse)); });
        if (ending_) return;
        Request request = std::move(*next_);
        next_.reset();
        planning_ = true;
        cancelled_ = false;
        lock.unlock();

        Graph graph = request.graph;
        graph.nodes.insert(graph.nodes.end(), request.extra.begin(), request.extra.end());
        Plan plan = check(graph, registry_);
        auto is_extra = [&](const Problem& problem) {
            return std::ranges::any_of(request.extra, [&](const GraphNode& node) { return node.id == problem.node; });
        };
        std::erase_if(plan.problems, is_extra);
        publish(plan, request);
        if (request.coarse) plan = check(graph, registry_, {coarse_overrides(plan), {}, 0});
        RunOptions options;
        options.wanted = wanted_of(plan, request);
        options.output_folder = request.output_folder;

        lock.lock();
        const bool anything = !options.wanted.empty() && !cancelled_;
        planning_ = false;
        running_ = anything;
        newest_ = plan.nodes.data();  // a vector that is moved keeps its elements where they are
        running_coarse_ = anything && request.coarse;
        state_.writing = anything && request.write;
        if (anything)
            runner_->submit(std::move(plan), std::move(options));
        else
            runner_->cancel();
        touch();
        wake_.notify_all();
    }
}

// What the check says, and what of the results is there already. A node whose result would be another
// one now is stale.
void Evaluator::publish(const Plan& plan, const Request& request) {
    const std::vector<Hash> keys = result_keys(plan);
    std::lock_guard lock(mutex_);
    std::map<std::string, NodeStatus> before;
    before.swap(state_.nodes);
    for (std::size_t i = 0; i < plan.nodes.size(); ++i) {
        const Plan::Node& node = plan.nodes[i];
        NodeStatus status;
        if (auto old = before.find(node.id); old != before.end()) status = std::move(old->second);
        if (status.key != keys[i] || !node.ok) mark_stale(status, node);
        status.key = keys[i];
        status.outputs = node.outputs;
        state_.nodes[node.id] = std::move(status);
        if (!node.ok || node.type->writes_files) continue;
        if (auto result = cache_.find(keys[i])) collect(node, keys[i], *result, NodeState::cached);
    }
    for (const Problem& problem : plan.problems)
        if (auto found = state_.nodes.find(problem.node); found != state_.nodes.end()) {
            found->second.state = NodeState::failed;
            found->second.message = problem.message;
        }
    for (const Plan::Node& node : plan.nodes) {
        NodeStatus& status = state_.nodes[node.id];
        if (node.ok || status.state == NodeState::failed) continue;
        status.state = node.off.empty() ? NodeState::not_run : NodeState::not_asked;
        status.message = node.off.empty() ? "something that it needs has a problem" : node.off;
    }
    auto node_of = [&](const auto& entry) { return plan.find(std::string_view(entry.first).substr(0, entry.first.find('.'))); };
    auto gives_nothing = [&](const auto& entry) { return node_of(entry) < 0 || !plan.nodes[std::size_t(node_of(entry))].ok; };
    std::erase_if(state_.values, [&](const auto& entry) { return node_of(entry) < 0; });
    std::erase_if(state_.volumes, gives_nothing);
    std::erase_if(state_.bricks, gives_nothing);
    state_.graph = std::make_shared<const Graph>(request.graph);
    state_.problems.clear();
    if (!plan.nodes.empty()) state_.problems = plan.problems;  // an empty graph is a beginning
    state_.warnings = plan.warnings;
    if (!request.coarse) touch();
}

void Evaluator::mark_stale(NodeStatus& status, const Plan::Node& node) {
    if (status.state != NodeState::not_asked) status.state = NodeState::waiting;
    status.message.clear();
    status.warnings.clear();
    status.fraction = -1;
    if (!node.type) return;
    for (const PortSpec& port : node.type->outputs)
        if (auto value = state_.values.find(node.id + "." + port.key); value != state_.values.end())
            value->second.fresh = false;
}

// --- results -------------------------------------------------------------------------------------

void Evaluator::collect(const Plan::Node& node, const Hash& key, const ResultCache::Result& result,
                        NodeState state) {
    NodeStatus& status = state_.nodes[node.id];
    const bool fresh = status.key == key;
    if (fresh) {
        if (status.state != NodeState::done) status.state = state;
        status.message.clear();
        status.bytes = result.bytes;
        status.measurements = result.measurements;
        status.warnings = result.warnings;
        auto took = wall_seconds_.find(key);
        status.wall_seconds = took == wall_seconds_.end() ? 0 : took->second;
    }
    // A run that was superseded may still end; what it brings must not replace what is newer.
    auto keep = [&](auto& kept, const auto& value) {
        if (fresh || kept.expired()) kept = value;
    };
    for (std::size_t o = 0; o < result.outputs.size(); ++o) {
        const std::string port = node.id + "." + node.type->outputs[o].key;
        if (auto* volume = std::get_if<VolumePtr>(&result.outputs[o])) keep(state_.volumes[port], *volume);
        if (auto* bricks = std::get_if<BricksPtr>(&result.outputs[o])) keep(state_.bricks[port], *bricks);
        if (is_shown(voxloom::type_of(result.outputs[o]))) show(port, result.outputs[o], fresh);
    }
}

// Nor must it here.
void Evaluator::show(const std::string& port, const Value& value, bool fresh) {
    LiveValue& shown = state_.values[port];
    if (shown.fresh && !fresh) return;
    if (shown.value != value) shown = {value, fresh, ++serial_};
    shown.fresh = fresh;
    if (picture_pending_ && std::holds_alternative<ImagePtr>(value)) {
        picture_pending_ = false;
        state_.first_picture_seconds = double(wall_ns() - submitted_ns_) * 1e-9;
    }
}

void Evaluator::began(const Plan& plan) {
    plan_ = &plan;
    keys_ = result_keys(plan);
}

// Everything that ran is in the cache by now, and so are the values that nobody but the interface
// wants to keep.
void Evaluator::state_changed(int index, const NodeReport& report) {
    const Plan::Node& node = plan_->nodes[std::size_t(index)];
    const Hash& key = keys_[std::size_t(index)];
    std::lock_guard lock(mutex_);
    auto found = state_.nodes.find(report.id);
    if (found == state_.nodes.end()) return;  // removed meanwhile
    NodeStatus& status = found->second;
    if (report.state == NodeState::done) wall_seconds_[key] = report.wall_seconds;
    if (status.key == key) {
        status.state = report.state == NodeState::cancelled ? NodeState::waiting : report.state;
        status.message = report.error;
        status.fraction = status.seconds_left = -1;
        if (report.state == NodeState::done) {
            status.wall_seconds = report.wall_seconds;
            status.bytes = report.bytes_out;
            status.measurements = report.measurements;
            status.warnings = report.warnings;
        }
    }
    if (report.state == NodeState::done || report.state == NodeState::cached)
        if (auto result = cache_.find(key)) collect(node, key, *result, report.state);
    touch();
}

void Evaluator::progress(int index, double fraction, std::string_view what, double seconds_left) {
    std::lock_guard lock(mutex_);
    auto found = state_.nodes.find(plan_->nodes[std::size_t(index)].id);
    if (found == state_.nodes.end() || found->second.key != keys_[std::size_t(index)]) return;
    found->second.fraction = fraction;
    found->second.what = what;
    found->second.seconds_left = seconds_left;
    touch();
}

void Evaluator::provisional(int index, int output, const Value& value) {
    const Plan::Node& node = plan_->nodes[std::size_t(index)];
    if (!is_shown(voxloom::type_of(value))) return;
    std::lock_guard lock(mutex_);
    if (!state_.nodes.count(node.id)) return;
    show(node.id + "." + node.type->outputs[std::size_t(output)].key, value, false);
    touch();
}

void Evaluator::done(const Plan& plan, const RunResult& result) {
    std::lock_guard lock(mutex_);
    if (plan.nodes.data() != newest_) return;  // a newer one was handed on meanwhile
    if (!running_coarse_) state_.wall_seconds = result.wall_seconds;
    running_ = running_coarse_ = state_.writing = false;
    touch();
    wake_.notify_all();
}

}  // namespace voxloom::editor
