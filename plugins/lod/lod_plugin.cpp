#include <set>
#include <tuple>

#include "core/plugin/plugin.h"
#include "plugins/lod/nodes.h"

namespace voxloom::lod {

PortSpec bricks_input() {
    return {"bricks", PortType::bricks, "What is drawn; its voxels are not read, only what is known of them."};
}

PortSpec camera_input(bool optional) {
    return {"camera", PortType::camera,
            optional ? "Leaves out what it does not see; without one nothing is left out for the view."
                     : "Where the bricks are seen from.",
            optional};
}

PortSpec selection_output() {
    return {"selection", PortType::selection, "The bricks to draw, back to front, with their predicted errors."};
}

ParamSpec size_param() {
    ParamSpec size = param::vector("size", {512, 512}, "Width and height of the picture that they are selected for.");
    size.length = 2;
    return size.range(1, 8192).slider(64, 2048).whole().in_unit("pixels");
}

void output_selection(Evaluation& ev, std::shared_ptr<const Selection> selection) {
    const BricksDesc& bricks = *selection->of;
    std::set<std::tuple<int, int, int, int>> distinct;
    double voxels = 0;
    for (const SelectedBrick& b : selection->bricks)
        if (distinct.emplace(b.id.level, b.id.index.x, b.id.index.y, b.id.index.z).second)
            voxels += double(bricks.box_of(b.id).voxels());
    ev.measure("bricks", double(distinct.size()));
    ev.measure("voxels", voxels);
    ev.measure("predicted pixel error", selection->predicted_error, "of the peak");
    ev.output("selection", std::move(selection));
}

static void add_nodes(Registry& registry) {
    registry.add(projective_node());
    registry.add(priority_node());
    registry.add(transfer_aware_node());
    registry.add(plane_node());
    registry.add(balance_node());
    registry.add(statistics_node());
}

}  // namespace voxloom::lod

VOXLOOM_PLUGIN("lod", voxloom::lod::add_nodes)
