#include "core/graph/evaluate.h"

#include <sys/resource.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cassert>
#include <condition_variable>
#include <new>

#include "core/base/meter.h"
#include "core/base/tsan.h"
#include "core/gpu/thread.h"
#include "core/graph/result_key.h"

namespace voxloom {

std::string_view name_of(NodeState state) {
    constexpr std::string_view names[] = {"not asked", "waiting", "running", "done",
                                          "cached",    "failed",  "not run", "cancelled"};
    return names[std::size_t(state)];
}

namespace {

using Result = ResultCache::Result;

struct NodeRun {
    bool needed = false;
    int waiting_for = 0;                  // sources that have not finished yet
    int consumers_left = 0;               // that have not taken this node's outputs yet
    std::vector<int> consumers;
    std::shared_ptr<const Result> result; // dropped when the last consumer is done with it
    bool wanted = false;
    Hash key;
    std::int64_t started_ns = 0;
    double fraction = 0;
    bool finished = false;
};

class Run;

// What a running node sees. Lives on the stack of the thread that runs it.
class NodeEvaluation final : public Evaluation {
  public:
    NodeEvaluation(Run& run, int node);

    const Params& params() const override { return planned_.params; }
    const Value& value(std::string_view port) const override {
        static const Value empty;
        const auto& all = values(port);
        return all.empty() ? empty : all.front();
    }
    const std::vector<Value>& values(std::string_view port) const override {
        return inputs_[index_of(planned_.type->inputs, port)];
    }
    void output(std::string_view port, Value value) override {
        std::size_t i = index_of(planned_.type->outputs, port);
        assert(!is_empty(value) && planned_.type->outputs[i].types.has(type_of(value)));
        result_->outputs[i] = std::move(value);
    }
    void provisional(std::string_view port, Value value) override;
    bool wants_provisional() const override;
    const std::stop_token& stop() const override;
    void progress(double fraction, std::string_view what) override;
    void count(std::string_view counter, double amount) override {
        std::lock_guard lock(mutex_);
        counters_[std::string(counter)] += amount;
    }
    void measure(std::string_view name, double value, std::string_view unit) override {
        std::lock_guard lock(mutex_);
        result_->measurements[std::string(name)] = {value, std::string(unit)};
    }
    void warn(std::string message) override {
        std::lock_guard lock(mutex_);
        result_->warnings.push_back(std::move(message));
    }
    void add_draw_seconds(double seconds) override {
        std::lock_guard lock(mutex_);
        draw_seconds_ += seconds;
    }
    std::filesystem::path output_path(std::string_view param_key) const override;
    const std::string& node_id() const override { return planned_.id; }

    // Runs the node; throws what it throws.
    std::shared_ptr<const Result> evaluate();
    void fill(NodeReport& report) const;

  private:
    static std::size_t index_of(const std::vector<PortSpec>& ports, std::string_view key) {
        std::size_t i = 0;
        while (i < ports.size() && ports[i].key != key) ++i;
        assert(i < ports.size() && "no such port in the node's description");
        return i;
    }

    Run& run_;
    int node_;
    const Plan::Node& planned_;
    std::vector<std::vector<Value>> inputs_;  // by index of type->inputs
    std::shared_ptr<Result> result_ = std::make_shared<Result>();
    std::mutex mutex_;  // guards counters, measurements, warnings and draw time
    std::map<std::string, double> counters_;
    double draw_seconds_ = 0;
};

// One evaluation of a plan. Everything below is guarded by mutex_, except where noted.
class Run {
  public:
    Run(const Plan& plan, ResultCache& cache, const RunOptions& options)
        : plan_(plan), cache_(cache), options_(options),
          wanted_(options.wanted.empty() ? plan.wanted : options.wanted),
          runs_(plan.nodes.size()), workers_(tbb::global_control::max_allowed_parallelism,
                                             std::size_t(concurrency(options)) + 1),
          arena_(concurrency(options), 0), gl_arena_(concurrency(options), 1) {}

    RunResult operator()();

  private:
    friend class NodeEvaluation;

    static int concurrency(const RunOptions& options) {
        return options.threads > 0 ? options.threads : tbb::info::default_concurrency();
    }

    void prepare();
    void start(int node);            // queues a node whose inputs are there
    void execute(int node);          // on the node's thread
    void finish(int node, NodeState state, std::string error, std::shared_ptr<const Result> result);
    void task_done();
    void release_inputs(int node);
    void settle(int node, NodeState state, std::string error, std::shared_ptr<const Result> result);
    std::string why_not_run(int source) const;
    void report_state(int node) {
        if (options_.observer) options_.observer->state_changed(node, reports_[std::size_t(node)]);
    }
    void report_progress(int node, double fraction, std::string_view what);

    const Plan& plan_;
    ResultCache& cache_;
    const RunOptions& options_;
    const std::vector<Plan::Source> wanted_;
    std::vector<NodeRun> runs_;
    std::vector<NodeReport> reports_;
    // One more than work: the thread that asked only waits, but TBB counts it.
    tbb::global_control workers_;
    tbb::task_arena arena_, gl_arena_;  // the second one is for loops inside drawing nodes

    std::mutex mutex_;
    std::condition_variable all_done_;
    std::vector<int> running_;
    std::atomic<std::int64_t> last_progress_ns_{0};  // not guarded
    int unfinished_ = 0;   // needed nodes that have not finished
    int in_flight_ = 0;    // tasks queued or running: the run outlives them all
};

NodeEvaluation::NodeEvaluation(Run& run, int node)
    : run_(run), node_(node), planned_(run.plan_.nodes[std::size_t(node)]) {
    result_->outputs.resize(planned_.type->outputs.size());
    inputs_.resize(planned_.inputs.size());
    for (std::size_t i = 0; i < planned_.inputs.size(); ++i)
        for (const Plan::Source& source : planned_.inputs[i])
            inputs_[i].push_back(
                run.runs_[std::size_t(source.node)].result->outputs[std::size_t(source.output)]);
}

void NodeEvaluation::provisional(std::string_view port, Value value) {
    if (!wants_provisional()) return;
    std::size_t i = index_of(planned_.type->outputs, port);
    std::lock_guard lock(run_.mutex_);
    run_.options_.observer->provisional(node_, int(i), value);
}

bool NodeEvaluation::wants_provisional() const {
    return run_.options_.observer && run_.options_.observer->wants_provisional();
}

const std::stop_token& NodeEvaluation::stop() const { return run_.options_.stop; }

void NodeEvaluation::progress(double fraction, std::string_view what) {
    run_.report_progress(node_, fraction, what);
}

std::filesystem::path NodeEvaluation::output_path(std::string_view param_key) const {
    std::filesystem::path path = planned_.params.path(param_key);
    if (path.is_relative()) path = run_.options_.output_folder / path;
    std::error_code error;
    if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path(), error);
    if (error)
        fail("the output folder {} cannot be made: {}", path.parent_path().string(), error.message());
    return path;
}

std::shared_ptr<const Result> NodeEvaluation::evaluate() {
    check_stop(stop());
    planned_.type->evaluate(*this);
    check_stop(stop());  // a node that stopped early must not pass for a whole one
    for (std::size_t i = 0; i < result_->outputs.size(); ++i) {
        if (is_empty(result_->outputs[i]))
            fail("the node ended without giving its output '{}': a defect of its plugin",
                 planned_.type->outputs[i].key);
        result_->bytes += resident_bytes(result_->outputs[i]);
    }
    return result_;
}

void NodeEvaluation::fill(NodeReport& report) const {
    for (const auto& values : inputs_)
        for (const Value& value : values) report.bytes_in += resident_bytes(value);
    report.bytes_out = result_->bytes;
    report.counters = counters_;
    report.measurements = result_->measurements;
    report.warnings = result_->warnings;
    report.draw_seconds = draw_seconds_;
}

// Finds what is needed: the wanted nodes, and the sources of whatever is not in the cache.
void Run::prepare() {
    std::vector<Hash> keys = result_keys(plan_);
    reports_.resize(plan_.nodes.size());
    for (std::size_t i = 0; i < plan_.nodes.size(); ++i) {
        reports_[i].id = plan_.nodes[i].id;
        reports_[i].type = plan_.nodes[i].type ? plan_.nodes[i].type->id : "";
        runs_[i].key = keys[i];
    }
    for (const Plan::Source& source : wanted_) {
        runs_[std::size_t(source.node)].needed = true;
        runs_[std::size_t(source.node)].wanted = true;
    }
    for (std::size_t i = plan_.nodes.size(); i-- > 0;) {
        NodeRun& run = runs_[i];
        const Plan::Node& node = plan_.nodes[i];
        if (!run.needed) continue;
        ++unfinished_;
        reports_[i].state = NodeState::waiting;
        if (!node.ok) continue;
        const bool again = std::ranges::find(options_.again, int(i)) != options_.again.end();
        if (!node.type->writes_files && !again)
            run.result = cache_.find(run.key);
        if (run.result) continue;
        for (const auto& sources : node.inputs)
            for (const Plan::Source& source : sources) {
                NodeRun& from = runs_[std::size_t(source.node)];
                from.needed = true;
                from.consumers.push_back(int(i));
                ++from.consumers_left;
                ++run.waiting_for;
            }
    }
}

RunResult Run::operator()() {
    const std::int64_t begin = wall_ns();
    if (options_.observer) options_.observer->began(plan_);
    prepare();
    {
        std::unique_lock lock(mutex_);
        for (std::size_t i = 0; i < runs_.size(); ++i) {
            if (!runs_[i].needed || runs_[i].finished) continue;
            if (runs_[i].result) {
                auto result = runs_[i].result;
                reports_[i].measurements = result->measurements;
                reports_[i].warnings = result->warnings;
                reports_[i].bytes_out = result->bytes;
                finish(int(i), NodeState::cached, {}, result);
            } else if (!plan_.nodes[i].ok) {
                finish(int(i), NodeState::not_run,
                       plan_.nodes[i].off.empty() ? "the check found a problem" : plan_.nodes[i].off, nullptr);
            } else if (runs_[i].waiting_for == 0 && reports_[i].state == NodeState::waiting) {
                start(int(i));
            }
        }
        all_done_.wait(lock, [&] { return unfinished_ == 0 && in_flight_ == 0; });
    }

    RunResult result;
    result.ok = true;
    for (const Plan::Source& source : wanted_) {
        const auto& kept = runs_[std::size_t(source.node)].result;
        result.ok = result.ok && kept;
        result.outputs.push_back(kept && source.output >= 0 ? kept->outputs[std::size_t(source.output)]
                                                            : Value());
    }
    result.cancelled = options_.stop.stop_requested() && !result.ok;
    result.nodes = std::move(reports_);
    result.wall_seconds = double(wall_ns() - begin) * 1e-9;
    result.peak_bytes = buffer_bytes_peak();
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    result.peak_resident_bytes = std::uint64_t(usage.ru_maxrss) * 1024;
    return result;
}

void Run::start(int node) {
    reports_[std::size_t(node)].state = NodeState::running;
    ++in_flight_;
    report_state(node);
    running_.push_back(node);
    tsan::before_tasks();
    if (plan_.nodes[std::size_t(node)].type->thread == NodeType::Thread::opengl)
        // Loops of a drawing node get an arena that only the OpenGL thread enters, so that it
        // always runs its own part itself.
        gpu::post([this, node] {
            gl_arena_.execute([this, node] { execute(node); });
            task_done();
        });
    else
        arena_.enqueue([this, node] {
            tsan::InTask in_task;
            execute(node);
            task_done();
        });
}

void Run::task_done() {
    std::lock_guard lock(mutex_);
    --in_flight_;
    if (unfinished_ == 0 && in_flight_ == 0) all_done_.notify_all();
}

void Run::execute(int node) {
    const NodeType& type = *plan_.nodes[std::size_t(node)].type;
    const bool draws = type.thread == NodeType::Thread::opengl;
    NodeReport report = reports_[std::size_t(node)];  // nobody else touches it while it runs
    const std::int64_t started_ns = wall_ns();
    {
        std::lock_guard lock(mutex_);
        runs_[std::size_t(node)].started_ns = started_ns;
    }
    const std::int64_t process_cpu = draws ? process_cpu_ns() : 0;
    Meter meter;
    NodeState state = NodeState::done;
    std::string error;
    std::shared_ptr<const Result> result;
    {
        MeterScope charge(&meter);
        NodeEvaluation evaluation(*this, node);
        try {
            if (draws) gpu::require_context();
            result = evaluation.evaluate();
        } catch (const Cancelled&) {
            state = NodeState::cancelled;
        } catch (const std::bad_alloc&) {
            state = NodeState::failed;
            error = "there is not enough memory for it; use a smaller volume or a coarser level";
        } catch (const std::exception& e) {
            state = NodeState::failed;
            error = e.what();
        } catch (...) {
            state = NodeState::failed;
            error = "an exception of an unknown type: a defect of its plugin";
        }
        evaluation.fill(report);
    }
    report.wall_seconds = double(wall_ns() - started_ns) * 1e-9;
    report.cpu_seconds = double(draws ? process_cpu_ns() - process_cpu : meter.cpu_ns()) * 1e-9;
    report.peak_bytes = std::uint64_t(meter.peak_bytes());
    if (result && !type.writes_files)
        cache_.store(runs_[std::size_t(node)].key, result);

    std::lock_guard lock(mutex_);
    reports_[std::size_t(node)] = std::move(report);
    std::erase(running_, node);
    finish(node, state, std::move(error), std::move(result));
}

void Run::finish(int node, NodeState state, std::string error, std::shared_ptr<const Result> result) {
    settle(node, state, std::move(error), std::move(result));
    // A list, not recursion: a failure at the head of a long chain settles all of it.
    std::vector<int> settled{node};
    while (!settled.empty()) {
        const int source = settled.back();
        settled.pop_back();
        NodeRun& run = runs_[std::size_t(source)];
        for (int consumer : run.consumers) {
            NodeRun& next = runs_[std::size_t(consumer)];
            if (next.finished) continue;
            if (run.result) {
                if (--next.waiting_for == 0) start(consumer);
                continue;
            }
            settle(consumer, options_.stop.stop_requested() ? NodeState::cancelled : NodeState::not_run,
                   why_not_run(source), nullptr);
            settled.push_back(consumer);
        }
        if (run.consumers_left == 0 && !run.wanted) run.result.reset();
    }
}

void Run::settle(int node, NodeState state, std::string error, std::shared_ptr<const Result> result) {
    NodeRun& run = runs_[std::size_t(node)];
    run.finished = true;
    run.result = std::move(result);
    NodeReport& report = reports_[std::size_t(node)];
    report.state = state;
    report.error = std::move(error);
    --unfinished_;
    report_state(node);
    release_inputs(node);
}

std::string Run::why_not_run(int source) const {
    const NodeReport& report = reports_[std::size_t(source)];
    if (report.state == NodeState::cancelled) return "the run was cancelled";
    return "it needs '" + report.id + "', which " +
           (report.state == NodeState::failed ? "failed" : "was not run");
}

// The outputs that this node used are freed as soon as nobody else needs them in this run.
void Run::release_inputs(int node) {
    if (reports_[std::size_t(node)].state == NodeState::cached) return;
    for (const auto& sources : plan_.nodes[std::size_t(node)].inputs)
        for (const Plan::Source& source : sources) {
            NodeRun& from = runs_[std::size_t(source.node)];
            if (--from.consumers_left == 0 && !from.wanted && from.finished) from.result.reset();
        }
}

void Run::report_progress(int node, double fraction, std::string_view what) {
    if (!options_.observer) return;
    // Nodes report as often as they like; people can follow twenty times a second.
    constexpr std::int64_t kInterval = 50'000'000;
    const std::int64_t now = wall_ns();
    std::int64_t last = last_progress_ns_;
    if (now - last < kInterval || !last_progress_ns_.compare_exchange_strong(last, now)) return;
    std::lock_guard lock(mutex_);
    runs_[std::size_t(node)].fraction = fraction;
    double left = -1;
    for (int other : running_) {
        const NodeRun& run = runs_[std::size_t(other)];
        if (run.fraction <= 0) continue;
        double spent = double(now - run.started_ns) * 1e-9;
        left = std::max(left, spent * (1 - run.fraction) / run.fraction);
    }
    options_.observer->progress(node, fraction, what, left);
}

}  // namespace

RunResult evaluate(const Plan& plan, ResultCache& cache, const RunOptions& options) {
    assert(!gpu::on_thread());
    return Run(plan, cache, options)();
}

}  // namespace voxloom
