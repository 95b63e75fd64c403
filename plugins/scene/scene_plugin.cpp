#include "core/plugin/plugin.h"
#include "plugins/scene/nodes.h"

namespace voxloom::scene {

static void add_nodes(Registry& registry) {
    registry.add(camera_node());
    registry.add(path_node());
    registry.add(transfer_node());
    registry.add(lights_node());
}

}  // namespace voxloom::scene

VOXLOOM_PLUGIN("scene", voxloom::scene::add_nodes)
