// The nodes of this plugin.
#pragma once

#include "core/graph/node.h"

namespace voxloom::bricks {

NodeType pyramid_node();
NodeType decode_node();

}  // namespace voxloom::bricks
