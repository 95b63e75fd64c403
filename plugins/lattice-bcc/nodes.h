// The nodes of this plugin.
#pragma once

#include "core/graph/node.h"

namespace voxloom::bcc {

NodeType resample_node();
NodeType reconstruct_node();

}  // namespace voxloom::bcc
