// The readers: files and analytic phantoms to Volume and Series.
#include "core/plugin/plugin.h"
#include "plugins/readers/phantom.h"

namespace voxloom {

namespace {

void add_nodes(Registry& registry) { add_phantoms(registry); }

}  // namespace

}  // namespace voxloom

VOXLOOM_PLUGIN("readers", voxloom::add_nodes)
