// What a picture's branch of the graph costs, and how wrong it is: from what its nodes have measured.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/editor/model/evaluator.h"
#include "core/plugin/registry.h"

namespace voxloom::editor {

// The nodes that say something of a picture, by id; empty where there is none.
struct Branch {
    WireEnd picture;
    std::string codec;         // the nearest upstream that makes bricks of a volume
    std::string decoder;       // between them, that makes a volume of bricks
    std::string volume_error;  // compares what is decoded: a table, by an input `volume`
    std::string image_error;   // compares the picture: a table, by an input `image`
};
Branch branch_of(const Graph& graph, const Registry& registry, const WireEnd& picture);

// Nothing where nobody has measured it.
struct BranchNumbers {
    std::optional<double> ratio, bits_per_voxel;
    std::optional<double> psnr, max_error;  // of the volume, by volume_error, else as the codec says
    std::optional<double> image_rmse;
    // Seconds. Encoding is the codec's own time where it tells it, else its node's; all are of the run
    // that made what is shown, whenever that was.
    std::optional<double> encode, decode, frame;
};
BranchNumbers numbers_of(const Branch& branch, const Evaluator::State& state);

// A setting of a codec that was tried, and what came of it.
struct Tried {
    std::string codec;
    Hash key;                        // of its result
    std::vector<GraphParam> params;  // all that were set
    double seconds = 0, psnr = 0;
};
// Adds the settings that the state has numbers for and that are not there yet; the oldest go first.
void collect_tried(std::vector<Tried>& tried, const std::vector<Branch>& branches, const Evaluator::State& state);
// Gives the codec the parameters that it had then; one step of undo. Throws Error where it is gone.
void bring_back(Document& document, const Tried& tried, const Registry& registry);

// The parameter that trades speed for error and is in use, and values of it all over its soft range.
// Nothing where the node has no such parameter with a slider.
struct Sweep {
    std::string node, param;
    std::vector<ParamValue> values;
    std::size_t next = 0;  // that is to be tried
};
std::optional<Sweep> sweep_of(const Graph& graph, const Registry& registry, const std::string& node, int steps = 7);
// The graph with that value.
Graph graph_with(const Graph& graph, const Sweep& sweep, std::size_t value);

}  // namespace voxloom::editor
