// The nodes of this plugin, and what they share.
#pragma once

#include "core/graph/node.h"
#include "plugins/lod/cut.h"

namespace voxloom::lod {

NodeType projective_node();
NodeType priority_node();
NodeType transfer_aware_node();
NodeType plane_node();
NodeType balance_node();
NodeType statistics_node();

// Ports and parameters that mean the same in every node.
PortSpec bricks_input();
PortSpec camera_input(bool optional);
PortSpec selection_output();
ParamSpec size_param();

// Gives the selection out, with its sizes and errors measured.
void output_selection(Evaluation& ev, std::shared_ptr<const Selection> selection);

}  // namespace voxloom::lod
