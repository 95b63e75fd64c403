// What a picture's branch of the graph costs, and how wrong it is: from what its nodes have measured.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/editor/model/decoded.h"
#include "app/editor/model/evaluator.h"
#include "core/measure/image_error.h"
#include "core/plugin/registry.h"

namespace voxloom::editor {

// The nodes that say something of a picture, by id; empty where there is none.
struct Branch {
    WireEnd picture;
    std::string codec;         // the nearest upstream that makes bricks of a volume
    WireEnd bricks;            // that are drawn: the codec's, or those of a file
    WireEnd original;          // what the codec makes them of: a volume, or other bricks
    std::string decoder;       // between them, that makes a volume of bricks
    std::string volume_error;  // compares what is decoded: a table, by an input `volume`
    std::string image_error;   // compares the picture: a table, by an input `image`
};
Branch branch_of(const Graph& graph, const Registry& registry, const WireEnd& picture);

// What the editor itself has measured of a branch; null where it has not, or not yet.
struct OwnMeasures {
    std::shared_ptr<const Decoded> decoded;
    std::shared_ptr<const ImageError> image;  // of the picture, against the reference that is chosen
    bool decoding = false, comparing = false; // it is not there yet, but will be
    std::string decode_problem, image_problem; // why it never will be
    bool image_first = false;                 // somebody has chosen it: rather this than what image_error says
};

// Nothing where nobody has measured it.
struct BranchNumbers {
    std::optional<double> ratio, bits_per_voxel;
    // Of the volume: by volume_error, else measured here, else as the codec says.
    std::optional<double> psnr, max_error;
    std::optional<double> image_rmse, image_max;
    bool image_is_own = false;  // they are OwnMeasures::image's
    // Seconds. Encoding is the codec's own processor time where it tells it, else its node's; decoding is
    // processor time measured here, else the decoder's node's; all are of the run that made what is shown,
    // whenever that was.
    std::optional<double> encode, decode, frame;
    std::optional<double> decoded_bytes_per_second;
};
BranchNumbers numbers_of(const Branch& branch, const Evaluator::State& state, const OwnMeasures& own = {});

// What the bricks of a branch are measured by, as long as both are there and of the graph as it is.
struct Compared {
    BricksPtr bricks;
    Value original;  // a volume, bricks, or nothing
};
Compared compared_of(const Branch& branch, const Evaluator::State& state);

// Its codec has run and neither says how wrong it is, nor does a node of the graph: only decoding tells.
bool needs_decoding(const Branch& branch, const Evaluator::State& state);

// The nodes that draw the branch's picture without its codec: copies of those from the codec on, those that
// code and decode bypassed, named id_without_codec(). No node of a document has such a name.
std::vector<GraphNode> nodes_without_codec(const Graph& graph, const Registry& registry, const Branch& branch);
std::string id_without_codec(const std::string& id);
bool is_without_codec(std::string_view id);

// A setting of a codec that was tried, and what came of it.
struct Tried {
    std::string codec;
    Hash key;                        // of its result
    std::vector<GraphParam> params;  // all that were set
    double seconds = 0, psnr = 0;
};
// Adds the settings that the state has numbers for and that are not there yet; the oldest go first.
void collect_tried(std::vector<Tried>& tried, const std::vector<Branch>& branches, const std::vector<OwnMeasures>& own, const Evaluator::State& state);
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
