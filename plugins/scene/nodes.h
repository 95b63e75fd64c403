// The nodes of this plugin.
#pragma once

#include "core/graph/node.h"

namespace voxloom::scene {

NodeType camera_node();
NodeType path_node();
NodeType transfer_node();
NodeType lights_node();

}  // namespace voxloom::scene
