// The readers: files and analytic phantoms to Volume and Series.
#include "core/plugin/plugin.h"
#include "plugins/readers/phantom.h"
#include "plugins/readers/volume_nodes.h"

namespace voxloom {

namespace {

void add_nodes(Registry& registry) {
    add_phantoms(registry);
    add_volume_readers(registry);
}

}  // namespace

}  // namespace voxloom

VOXLOOM_PLUGIN("readers", voxloom::add_nodes)
