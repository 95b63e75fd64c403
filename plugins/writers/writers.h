// The nodes of this plugin.
#pragma once

#include "core/plugin/registry.h"

namespace voxloom {

void add_volume_writer(Registry& registry);
void add_image_writer(Registry& registry);
void add_table_writer(Registry& registry);

}  // namespace voxloom
