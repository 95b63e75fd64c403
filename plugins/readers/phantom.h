// The nodes readers.phantom and readers.phantom-series: analytic volumes of any size and type.
#pragma once

#include "core/plugin/registry.h"

namespace voxloom {

void add_phantoms(Registry& registry);

}  // namespace voxloom
