// The content hash of a node's result.
#pragma once

#include <vector>

#include "core/base/hash.h"
#include "core/graph/check.h"

namespace voxloom {

// One key per node of the plan: the node's type and version, the parameters that affect its output,
// the keys of its inputs, and the fingerprints (path, size, time) of the files it reads. Nodes that
// are not ok get a key that nothing else has.
std::vector<Hash> result_keys(const Plan& plan);

}  // namespace voxloom
