#include "core/plugin/plugin.h"
#include "plugins/metrics/nodes.h"

namespace voxloom::metrics {

static void add_nodes(Registry& registry) {
    registry.add(volume_node());
    registry.add(image_node());
    registry.add(compare_node());
}

}  // namespace voxloom::metrics

VOXLOOM_PLUGIN("metrics", voxloom::metrics::add_nodes)
