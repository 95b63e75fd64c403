#include "plugins/lod/balance.h"
#include "plugins/lod/error_model.h"
#include "plugins/lod/nodes.h"
#include "plugins/lod/plane_cut.h"
#include "plugins/lod/priority.h"

namespace voxloom::lod {

namespace {

constexpr const char* kMethod = R"(
Splits bricks until any two that share a face, an edge or a corner differ by one level at most, then
decides how they blend: a corner that touches a coarser brick that is drawn shows that brick's samples, every other corner
its own, and in between they are mixed trilinearly. On a face between levels both sides then show the
coarser samples, and nothing cracks. Octants of bricks that were replaced in part become bricks of their own.

Both are decided over the whole tree that the selection implies. Looking at selected bricks alone leaves
cracks: a brick off the plane or outside of the view can be what makes two others meet.

What is split off is drawn where the selection's camera and plane can see it. If that makes more than
`max_bricks`, families are merged again, those first whose merged brick is least wrong in the picture and
whose neighbours allow it, until the budget holds. Predicted errors are those of the balanced bricks, with what they mix in of
coarser ones; with a transfer function wired they are bounds after classification, as `lod.transfer-aware` gives them.

**Use it** behind any selection that a picture is made of. **Do not use it** where steps between levels are
to be seen, or to compare policies by their bricks alone.

LaMar, Duchaineau, Hamann, Joy: *Multiresolution techniques for interactive texture-based rendering of
arbitrarily oriented cutting planes*, 2000, section 4.3.
)";

void evaluate(Evaluation& ev) {
    const auto given = ev.input<Selection>("selection");
    const BricksPtr bricks = ev.input<Bricks>("bricks");
    const TransferPtr transfer = ev.input<TransferFunction>("transfer");
    const BricksDesc& desc = bricks->desc();
    check_selection(*given, desc);
    auto selection = std::make_shared<Selection>(*given);

    std::optional<Sight> sight;
    if (given->camera) sight.emplace(*given->camera, given->size, desc);
    std::optional<PlaneTest> plane;
    if (given->plane) plane.emplace(desc, *given->plane);
    const ErrorModel errors = transfer ? classified_errors(bricks, transfer) : value_errors(bricks);
    auto seen = [&](BrickId id) {
        return (!sight || sight->sees(region_of(desc.volume, desc.fine_box_of(id)))) &&
               (!plane || plane->meets(id));
    };
    auto price = [&](BrickId id) {
        const std::optional<OctantErrors> squares = errors(id);
        if (!squares) return 0.0;
        double sum = 0;
        for (double s : *squares) sum += s;
        const Box box = desc.fine_box_of(id);
        const double pixels = sight ? sight->pixels(id.level, sight->depth(region_of(desc.volume, box))) : 1.0;
        return pixel_error(sum, double(box.voxels()), pixels);
    };

    CompleteTree tree(desc, *given);
    const std::int64_t before = tree.drawn();
    ev.progress(0.1, "balancing");
    tree.balance(seen, ev.stop());
    ev.measure("bricks before", double(before));
    ev.measure("bricks when balanced", double(tree.drawn()));
    if (const std::int64_t most = ev.params().integer("max_bricks"); most > 0) {
        ev.progress(0.5, "merging");
        if (!tree.merge_down_to(most, price, ev.stop()))
            ev.warn(fmt::format("no balanced selection of {} bricks was found; {} are left", most, tree.drawn()));
    }
    predict_errors(tree.cut(), desc, errors, sight ? &*sight : nullptr);
    tree.set_corner_blends();
    add_blend_errors(tree.cut(), desc, errors, sight ? &*sight : nullptr);
    list_bricks(tree.cut(), desc, sight ? &*sight : nullptr, *selection);
    output_selection(ev, selection);
}

}  // namespace

NodeType balance_node() {
    NodeType node;
    node.id = "lod.balance";
    node.title = "Balance";
    node.doc = "Makes neighbouring bricks of a selection differ by one level at most, and blend into each other.";
    node.keywords = {"level of detail", "LOD", "cracks", "blending", "octree", "neighbours", "selection"};
    node.inputs = {{"selection", PortType::selection, "The bricks that are drawn."},
                   bricks_input(),
                   {"transfer", PortType::transfer, "Makes predicted errors those after classification.", true}};
    node.outputs = {selection_output()};
    node.params = {param::integer("max_bricks", 2048, "Bricks drawn at most, balanced; 0: as many as it takes.")
                       .range(0, 1 << 24).slider(64, 16384, Scale::logarithmic).is_quality()};
    node.method = kMethod;
    node.evaluate = evaluate;
    return node;
}

}  // namespace voxloom::lod
