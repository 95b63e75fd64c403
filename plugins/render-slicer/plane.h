// slicer.plane: a cutting plane through bricks.
#pragma once

#include "core/graph/node.h"

namespace voxloom::slicer {

NodeType plane_node();

}  // namespace voxloom::slicer
