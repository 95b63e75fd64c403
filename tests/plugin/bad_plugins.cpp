// One source, several libraries that the loader must refuse: WRONG says how.

#include "core/plugin/plugin.h"

using namespace voxloom;

namespace {
[[maybe_unused]] void add_nothing(Registry&) {}

[[maybe_unused]] void add_same(Registry& registry) {
    NodeType type;
    type.id = "test.same";
    type.title = type.doc = "Offered by two plugins.";
    type.evaluate = [](Evaluation&) {};
    registry.add(std::move(type));
}

[[maybe_unused]] void add_bad_default(Registry& registry) {
    NodeType type;
    type.id = "test.bad-default";
    type.title = type.doc = "Its default is out of range.";
    type.params = {param::real("share", 2, "A share.").range(0, 1)};
    type.evaluate = [](Evaluation&) {};
    registry.add(std::move(type));
}
}  // namespace

#define REVISION 1
#define FINGERPRINT 2
#define NO_ENTRY 3
#define SAME_ID 4
#define BAD_DEFAULT 5

#if WRONG == REVISION
extern "C" __attribute__((visibility("default"))) const PluginTable* voxloom_plugin() {
    static constexpr PluginTable table{kInterfaceRevision + 41, VOXLOOM_FINGERPRINT, "old", add_nothing};
    return &table;
}
#elif WRONG == FINGERPRINT
extern "C" __attribute__((visibility("default"))) const PluginTable* voxloom_plugin() {
    static constexpr PluginTable table{kInterfaceRevision, "compiler of another age", "alien", add_nothing};
    return &table;
}
#elif WRONG == SAME_ID
VOXLOOM_PLUGIN("same", add_same)
#elif WRONG == BAD_DEFAULT
VOXLOOM_PLUGIN("bad-default", add_bad_default)
#endif
