#include "core/plugin/plugin.h"
#include "plugins/bricks/nodes.h"

namespace voxloom::bricks {

static void add_nodes(Registry& registry) {
    registry.add(pyramid_node());
    registry.add(decode_node());
}

}  // namespace voxloom::bricks

VOXLOOM_PLUGIN("bricks", voxloom::bricks::add_nodes)
