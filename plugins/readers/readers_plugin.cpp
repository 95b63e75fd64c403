// The readers: files and analytic phantoms to Volume and Series.
#include "core/plugin/plugin.h"

namespace voxloom {

namespace {

void add_nodes(Registry& /*registry*/) {}

}  // namespace

}  // namespace voxloom

VOXLOOM_PLUGIN("readers", voxloom::add_nodes)
