// The nodes of the plugin that a test is linked with, without any other.
#pragma once

#include "core/plugin/plugin.h"
#include "core/plugin/registry.h"

extern "C" const voxloom::PluginTable* voxloom_plugin();

namespace voxloom::testing {

inline const Registry& linked_plugin() {
    static const Registry registry = [] {
        Registry r;
        voxloom_plugin()->add_to(r);
        return r;
    }();
    return registry;
}

}  // namespace voxloom::testing
