// The graph being edited, evaluated while it is edited.
//
// submit() never waits. A thread of its own checks the newest graph and hands the plan to a LiveRunner;
// a newer request supersedes a running one, except that the coarse pictures of a movement are always
// finished, so that something is seen moving. What comes back is collected in a State, of which the
// interface takes a copy whenever its revision has changed.
#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <unordered_map>
#include <vector>

#include "core/graph/evaluate.h"

namespace voxloom::editor {

// What is known of a node, by id.
struct NodeStatus {
    // waiting: what is there, if anything, is of an older document.
    NodeState state = NodeState::not_asked;
    double fraction = -1;      // of a running node, 0 to 1; negative while unknown
    double seconds_left = -1;
    std::string what;          // it is doing
    std::string message;       // the sentence of a failure or of the check, or why the node is off
    std::vector<std::string> warnings;
    double wall_seconds = 0;   // of the run that made what is there; 0: not known
    std::uint64_t bytes = 0;   // of its outputs
    std::map<std::string, std::pair<double, std::string>> measurements;
    std::vector<ValueDesc> outputs;  // described before it ran, by index of the type's outputs
    Hash key;                  // of the result that the graph asks for now
};

struct LiveValue {
    Value value;
    bool fresh = false;        // of the document as it is; else of an older one, or a coarse one
    std::uint64_t serial = 0;  // another one for every value
};

class Evaluator final : RunObserver {
  public:
    struct Request {
        Graph graph;
        // Nodes of the interface's own, beside those of the graph. What is wrong with them is theirs: it is no
        // problem of the graph.
        std::vector<GraphNode> extra;
        // Outputs that are looked at, beside those that the graph asks for.
        std::vector<WireEnd> watched;
        // Something is moving: only what is watched is computed, with pictures a third the size.
        bool coarse = false;
        // Nodes that write files run too.
        bool write = false;
        std::filesystem::path output_folder = "out";
    };
    struct State {
        std::uint64_t revision = 0;
        bool busy = false;
        bool writing = false;                       // the request in progress writes files
        std::map<std::string, NodeStatus> nodes;
        std::map<std::string, LiveValue> values;    // images, tables, cameras and transfer functions, by "node.port"
        std::map<std::string, std::weak_ptr<const Volume>> volumes;  // as long as the cache keeps them
        std::map<std::string, std::weak_ptr<const Bricks>> bricks;    // as are these
        std::shared_ptr<const Graph> graph;         // that all of this is of
        std::vector<Problem> problems;
        std::vector<std::string> warnings;
        double wall_seconds = 0;                    // of the last whole run
        double first_picture_seconds = 0;           // from the last request to its first picture
    };

    // `changed` is called from any thread after the state has changed.
    Evaluator(const Registry& registry, std::function<void()> changed);
    ~Evaluator() override;

    void submit(Request request);
    void cancel();
    // Copies the state where it is newer than `state`; false where it is not.
    bool refresh(State& state) const;
    // Without a request waiting or running.
    void wait_idle();
    ResultCache& cache() { return cache_; }

  private:
    void loop();
    void publish(const Plan& plan, const Request& request);
    // With mutex_ held:
    void mark_stale(NodeStatus& status, const Plan::Node& node);
    void collect(const Plan::Node& node, const Hash& key, const ResultCache::Result& result, NodeState state);
    void show(const std::string& port, const Value& value, bool fresh);
    void touch();

    void began(const Plan& plan) override;
    void state_changed(int node, const NodeReport& report) override;
    void progress(int node, double fraction, std::string_view what, double seconds_left) override;
    void provisional(int node, int output, const Value& value) override;
    bool wants_provisional() const override { return true; }
    void done(const Plan& plan, const RunResult& result);

    const Registry& registry_;
    std::function<void()> changed_;
    ResultCache cache_;

    mutable std::mutex mutex_;
    std::condition_variable wake_;
    State state_;
    std::optional<Request> next_;
    bool planning_ = false;          // a request was taken and not yet handed on
    bool cancelled_ = false;         // it was cancelled meanwhile
    bool running_ = false, running_coarse_ = false;
    const Plan::Node* newest_ = nullptr;  // the nodes of the newest plan handed on: which one it is
    bool ending_ = false;
    std::int64_t submitted_ns_ = 0;
    bool picture_pending_ = false;
    std::uint64_t serial_ = 0;
    std::unordered_map<Hash, double, HashOfHash> wall_seconds_;  // of every result that was made here

    // Of the run in progress; written by its thread alone.
    const Plan* plan_ = nullptr;
    std::vector<Hash> keys_;

    std::unique_ptr<LiveRunner> runner_;  // before the thread, which uses it
    std::thread thread_;
};

// NODE.PARAM=VALUE for pictures a third the size: for every parameter `size` of a node that makes an
// image and says that it trades speed for error.
std::vector<std::string> coarse_overrides(const Plan& plan);

}  // namespace voxloom::editor
