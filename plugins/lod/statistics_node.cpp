#include <algorithm>
#include <set>
#include <tuple>

#include "plugins/lod/nodes.h"

namespace voxloom::lod {

namespace {

constexpr const char* kMethod = R"(
One row for each level that the selection draws from, and one for all of them: bricks, those of them that
are drawn in part, their voxels and bytes once decoded, without the layers they share with neighbours, and
the largest predicted error. `share` is the part of the volume that the level stands for.

**Use it** to see where a budget goes, and to compare policies. **Do not use it** for what a picture really
cost: the report of the renderer counts what was decoded and uploaded.
)";

struct LevelSums {
    std::set<std::tuple<int, int, int>> bricks, partial;
    double voxels = 0, bytes = 0, covered = 0, error = 0;
};

std::vector<LevelSums> sums_of(const Selection& selection) {
    const BricksDesc& desc = *selection.of;
    std::vector<LevelSums> sums(desc.levels.size());
    for (const SelectedBrick& b : selection.bricks) {
        LevelSums& s = sums[std::size_t(b.id.level)];
        const std::tuple at(b.id.index.x, b.id.index.y, b.id.index.z);
        if (s.bricks.insert(at).second) {
            s.voxels += double(desc.box_of(b.id).voxels());
            s.bytes += double(desc.box_of(b.id).voxels() * desc.tree_voxel_bytes());
        }
        const bool whole = b.octants == 0xff || b.id.level == 0;
        if (!whole) s.partial.insert(at);
        if (whole) s.covered += double(desc.fine_box_of(b.id).voxels());
        for (int o = 0; o < 8 && !whole; ++o)
            if (b.octants >> o & 1) s.covered += double(fine_box_of_octant(desc, b.id, o).voxels());
        s.error = std::max(s.error, b.predicted_error);
    }
    return sums;
}

void evaluate(Evaluation& ev) {
    const auto selection = ev.input<Selection>("selection");
    const BricksDesc& desc = *selection->of;
    const double all_voxels = std::max(double(desc.volume.voxels()), 1.0);
    Table table;
    table.columns = {{"level", ""}, {"bricks", ""}, {"in part", ""}, {"voxels", ""}, {"bytes", "bytes"},
                     {"share", ""}, {"predicted error", "of the peak"}};
    LevelSums total;
    std::int64_t bricks = 0, partial = 0;
    auto row = [&](const std::string& name, std::int64_t n, std::int64_t part, const LevelSums& s) {
        table.rows.push_back({name, n, part, std::int64_t(s.voxels), std::int64_t(s.bytes),
                              s.covered / all_voxels, s.error});
    };
    const std::vector<LevelSums> sums = sums_of(*selection);
    for (std::size_t l = 0; l < sums.size(); ++l) {
        const LevelSums& s = sums[l];
        if (s.bricks.empty()) continue;
        row(std::to_string(l), std::int64_t(s.bricks.size()), std::int64_t(s.partial.size()), s);
        bricks += std::int64_t(s.bricks.size());
        partial += std::int64_t(s.partial.size());
        total.voxels += s.voxels;
        total.bytes += s.bytes;
        total.covered += s.covered;
        total.error = std::max(total.error, s.error);
    }
    row("all", bricks, partial, total);
    ev.measure("bricks", double(bricks));
    ev.measure("voxels", total.voxels);
    ev.measure("bytes", total.bytes, "bytes");
    ev.measure("predicted pixel error", total.error, "of the peak");
    ev.output("table", std::make_shared<Table>(std::move(table)));
}

}  // namespace

NodeType statistics_node() {
    NodeType node;
    node.id = "lod.statistics";
    node.title = "Selection statistics";
    node.doc = "Counts bricks, voxels and bytes of a selection, level by level.";
    node.keywords = {"level of detail", "LOD", "budget", "table", "selection"};
    node.inputs = {{"selection", PortType::selection, "The bricks that are counted."}};
    node.outputs = {{"table", PortType::table, "A row a level, then one for all."}};
    node.method = kMethod;
    node.evaluate = evaluate;
    return node;
}

}  // namespace voxloom::lod
