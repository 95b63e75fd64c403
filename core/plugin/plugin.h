// The interface between voxloom and a plugin.
//
// A plugin is a shared library with one exported C function, voxloom_plugin(), that returns its
// table. The table's first members are plain C and never move: the loader reads the revision and the
// toolchain's fingerprint before it touches anything else. Beyond that the interface is C++20, built
// with the same toolchain, so what differs is refused with both sides named.
#pragma once

#include <cstdint>

#include "core/plugin/registry.h"

namespace voxloom {

// Raised whenever a header that plugins see changes in a way that breaks them.
inline constexpr std::uint32_t kInterfaceRevision = 1;

#define VOXLOOM_STRING_(x) #x
#define VOXLOOM_STRING(x) VOXLOOM_STRING_(x)
#if defined(__SANITIZE_ADDRESS__)
#define VOXLOOM_SANITIZER "address"
#elif defined(__SANITIZE_THREAD__)
#define VOXLOOM_SANITIZER "thread"
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define VOXLOOM_SANITIZER "address"
#elif __has_feature(thread_sanitizer)
#define VOXLOOM_SANITIZER "thread"
#endif
#endif
#ifndef VOXLOOM_SANITIZER
#define VOXLOOM_SANITIZER "none"
#endif
// Compiler, standard library, string layout, sanitizer: what must agree for C++ to cross.
#define VOXLOOM_FINGERPRINT                                                            \
    "compiler " __VERSION__ ", libstdc++ " VOXLOOM_STRING(__GLIBCXX__) ", cxx11 abi " \
    VOXLOOM_STRING(_GLIBCXX_USE_CXX11_ABI) ", sanitizer " VOXLOOM_SANITIZER

struct PluginTable {
    std::uint32_t interface_revision;  // offset 0, for ever
    const char* fingerprint;           // offset 8, for ever; static storage
    const char* name;                  // static storage
    // Adds the plugin's nodes. Called once, on the loading thread. May throw Error.
    void (*add_to)(Registry& registry);
};

}  // namespace voxloom

// The one definition a plugin needs: VOXLOOM_PLUGIN("readers", add_nodes)
#define VOXLOOM_PLUGIN(name, add)                                                         \
    extern "C" __attribute__((visibility("default"))) const voxloom::PluginTable*         \
    voxloom_plugin() {                                                                    \
        static constexpr voxloom::PluginTable table = {voxloom::kInterfaceRevision,       \
                                                       VOXLOOM_FINGERPRINT, name, &(add)}; \
        return &table;                                                                    \
    }
