// The nodes of this plugin.
#pragma once

#include "core/graph/node.h"

namespace voxloom::metrics {

NodeType volume_node();
NodeType image_node();
NodeType compare_node();

}  // namespace voxloom::metrics
