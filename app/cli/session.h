// What every command begins with: the plugins.
#pragma once

#include "core/plugin/loader.h"
#include "core/plugin/registry.h"

namespace voxloom::cli {

// Loads all plugins, once; what is refused is said on standard error, and the rest works.
// Throws Error when there is not a single node.
const Registry& load_registry();

}  // namespace voxloom::cli
