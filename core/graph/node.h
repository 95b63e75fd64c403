// What a node says of itself. One description, as data, is all that the command line, the editor,
// the docs and the generic tests know of a node.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "core/data/value.h"
#include "core/graph/params.h"

namespace voxloom {

struct PortSpec {
    std::string key;
    PortTypes types;       // an output has exactly one
    std::string doc;       // one sentence
    bool optional = false; // inputs only
    bool many = false;     // inputs only: takes a list of wires, in order
};

// Given to NodeType::describe: input descriptions in, output descriptions and problems out.
// Runs on every edit, so it touches no voxel and takes microseconds (readers: a header's read).
class Description {
  public:
    virtual ~Description() = default;
    virtual const Params& params() const = 0;
    // Null when the input is not wired.
    virtual const ValueDesc* input(std::string_view port) const = 0;
    virtual const std::vector<ValueDesc>& inputs(std::string_view port) const = 0;
    virtual void output(std::string_view port, ValueDesc desc) = 0;
    // A problem with the node as a whole, or with one parameter or input port (named by `where`).
    virtual void problem(std::string message, std::string_view where = {}) = 0;
    // Memory that evaluating needs beside its outputs, for the check's estimate.
    virtual void working_memory(std::uint64_t bytes) = 0;
};

// Given to NodeType::evaluate: everything that running a node may see or do. Valid during the call.
class Evaluation {
  public:
    virtual ~Evaluation() = default;
    virtual const Params& params() const = 0;
    // The value wired to an input; empty when it is optional and not wired.
    virtual const Value& value(std::string_view port) const = 0;
    virtual const std::vector<Value>& values(std::string_view port) const = 0;  // of a `many` port
    virtual void output(std::string_view port, Value value) = 0;
    // Shown at once, never cached, never saved: a coarse picture on the way to the final one.
    virtual void provisional(std::string_view port, Value value) = 0;
    virtual bool wants_provisional() const = 0;  // somebody is looking

    virtual const std::stop_token& stop() const = 0;
    // Fraction done, 0 to 1, and what is being done. Cheap: call it at will. [any thread]
    virtual void progress(double fraction, std::string_view what = {}) = 0;
    // Adds to a counter of the report ("bricks drawn", "bytes uploaded"). [any thread]
    virtual void count(std::string_view counter, double amount = 1) = 0;
    // A measurement for the report ("psnr", 43.2, "dB"). [any thread]
    virtual void measure(std::string_view name, double value, std::string_view unit = {}) = 0;
    virtual void warn(std::string message) = 0;
    // Time spent drawing, of this node. [any thread]
    virtual void add_draw_seconds(double seconds) = 0;
    // Where a path_out goes: relative paths into the run's output folder, which is made.
    virtual std::filesystem::path output_path(std::string_view param_key) const = 0;
    virtual const std::string& node_id() const = 0;

    // The input as shared_ptr<const T>, null when not wired; types were checked before.
    template <class T>
    std::shared_ptr<const T> input(std::string_view port) const {
        auto* p = std::get_if<std::shared_ptr<const T>>(&value(port));
        return p ? *p : nullptr;
    }
};

struct NodeType {
    enum class Thread {
        worker,  // any thread of the pool; may use parallel_for
        opengl,  // the thread that owns the OpenGL context
    };
    std::string id;        // "plugin.verb", for ever
    int version = 1;       // raised when the same inputs give another output
    std::string title;
    std::string doc;       // one sentence
    std::vector<std::string> keywords;
    std::vector<PortSpec> inputs, outputs;
    std::vector<ParamSpec> params;
    Thread thread = Thread::worker;
    bool writes_files = false;   // never cached; asked for when it has no consumer
    std::string method;          // Markdown for the docs: method, when to use, when not, reference

    std::function<void(Description&)> describe;  // null: outputs have their type alone
    std::function<void(Evaluation&)> evaluate;
    // Files that the result depends on beside those named by path_in parameters.
    std::function<std::vector<std::filesystem::path>(const Params&)> files;

    const PortSpec* find_input(std::string_view key) const;
    const PortSpec* find_output(std::string_view key) const;
    const ParamSpec* find_param(std::string_view key) const;
};

}  // namespace voxloom
