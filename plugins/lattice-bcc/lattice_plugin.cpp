#include "core/plugin/plugin.h"
#include "plugins/lattice-bcc/nodes.h"

namespace voxloom::bcc {

static void add_nodes(Registry& registry) {
    registry.add(resample_node());
    registry.add(reconstruct_node());
}

}  // namespace voxloom::bcc

VOXLOOM_PLUGIN("lattice-bcc", voxloom::bcc::add_nodes)
