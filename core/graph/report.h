// Reports of runs and descriptions of nodes, for programs (JSON).
#pragma once

#include <string>

#include "core/graph/evaluate.h"

namespace voxloom {

// What a run did, node by node: docs/report.md names every field. `earlier` are the runs of the same
// plan before it (voxloom run --repeat), whose times are listed.
std::string run_to_json(const Plan& plan, const RunResult& result,
                        const std::vector<RunResult>& earlier = {});
// Every problem of a check, with file, line and column.
std::string problems_to_json(const Plan& plan);
// Everything that a node says of itself.
std::string node_types_to_json(const std::vector<const NodeType*>& types);
// A description of data: dims, spacing, type, levels, ...
std::string desc_to_json(const ValueDesc& desc);

}  // namespace voxloom
