// Demand-driven parallel evaluation with a content-hash cache.
#pragma once

#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/base/hash.h"
#include "core/graph/check.h"

namespace voxloom {

// Results by content hash, least recently used out first, under a byte limit. Thread-safe.
class ResultCache {
  public:
    explicit ResultCache(std::uint64_t byte_limit = std::uint64_t(4) << 30) : limit_(byte_limit) {}
    struct Result {
        std::vector<Value> outputs;
        // Shown again on a hit.
        std::map<std::string, std::pair<double, std::string>> measurements;
        std::vector<std::string> warnings;
        std::uint64_t bytes = 0;
    };
    using ResultPtr = std::shared_ptr<const Result>;
    ResultPtr find(const Hash& key);
    void store(const Hash& key, ResultPtr result);
    void set_byte_limit(std::uint64_t bytes);
    std::uint64_t bytes() const;
    std::size_t size() const;
    void clear();

  private:
    void shrink();
    mutable std::mutex mutex_;
    std::uint64_t limit_, bytes_ = 0;
    struct Entry {
        Hash key;
        ResultPtr result;
    };
    std::list<Entry> order_;  // most recently used first
    std::unordered_map<Hash, std::list<Entry>::iterator, HashOfHash> index_;
};

enum class NodeState { not_asked, waiting, running, done, cached, failed, not_run, cancelled };
std::string_view name_of(NodeState state);

// What a run says of one node.
struct NodeReport {
    std::string id, type;
    NodeState state = NodeState::not_asked;
    std::string error;                 // the sentence, when failed; why, when not run
    std::vector<std::string> warnings;
    double wall_seconds = 0;
    double cpu_seconds = 0;            // of its threads; drawing: of the whole process meanwhile
    double draw_seconds = 0;
    std::uint64_t bytes_in = 0, bytes_out = 0, peak_bytes = 0;
    std::map<std::string, double> counters;
    std::map<std::string, std::pair<double, std::string>> measurements;  // value, unit
};

struct RunResult {
    bool ok = false;                   // everything asked for is there
    bool cancelled = false;
    double wall_seconds = 0;
    std::vector<NodeReport> nodes;     // as Plan::nodes
    std::vector<Value> outputs;        // as Plan::wanted; empty where not there
    std::uint64_t peak_bytes = 0;      // voxel and image memory of the process
    std::uint64_t peak_resident_bytes = 0;  // of the process, as the system counts it
};

// Called from any thread, one at a time.
struct RunObserver {
    virtual ~RunObserver() = default;
    // Before anything else of a run; the plan lives as long as the run does.
    virtual void began(const Plan& /*plan*/) {}
    virtual void state_changed(int /*node*/, const NodeReport& /*report*/) {}
    // Fraction of the node, and the time that the slowest of the running nodes still needs at its
    // pace so far; negative while unknown.
    virtual void progress(int /*node*/, double /*fraction*/, std::string_view /*what*/,
                          double /*seconds_left*/) {}
    virtual void provisional(int /*node*/, int /*output*/, const Value& /*value*/) {}
    virtual bool wants_provisional() const { return false; }
};

struct RunOptions {
    std::stop_token stop;
    RunObserver* observer = nullptr;
    std::filesystem::path output_folder = "out";
    int threads = 0;                   // 0: all cores
    std::vector<Plan::Source> wanted;  // instead of the plan's, when not empty
    std::vector<int> again;            // nodes to compute although the cache has their result
};

// Runs what is asked for, branches in parallel. Blocks the calling thread, which must not be the
// OpenGL thread. Nodes that fail are reported, the other branches go on.
RunResult evaluate(const Plan& plan, ResultCache& cache, const RunOptions& options = {});

// Runs the newest request, for people who edit while they look: a newer one cancels the running
// one, the last always wins, submit() never waits.
class LiveRunner {
  public:
    // done(plan, result) and the observer are called from the runner's thread.
    using Done = std::function<void(const Plan&, const RunResult&)>;
    LiveRunner(ResultCache& cache, RunObserver* observer, Done done);
    ~LiveRunner();  // cancels and waits
    void submit(Plan plan, RunOptions options = {});
    void cancel();
    void wait_idle();

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace voxloom
