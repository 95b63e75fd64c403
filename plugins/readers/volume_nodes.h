// The nodes that read files: readers.volume, readers.series, and series.step.
#pragma once

#include "core/plugin/registry.h"

namespace voxloom {

void add_volume_readers(Registry& registry);

}  // namespace voxloom
