// The writers: Volume, Image and Table to files.
#include "plugins/writers/writers.h"

#include "core/plugin/plugin.h"

namespace voxloom {

namespace {

void add_nodes(Registry& registry) {
    add_volume_writer(registry);
    add_image_writer(registry);
    add_table_writer(registry);
}

}  // namespace

}  // namespace voxloom

VOXLOOM_PLUGIN("writers", voxloom::add_nodes)
