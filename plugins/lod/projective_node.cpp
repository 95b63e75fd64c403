#include "plugins/lod/error_model.h"
#include "plugins/lod/nodes.h"
#include "plugins/lod/priority.h"

namespace voxloom::lod {

namespace {

constexpr const char* kMethod = R"(
From the coarsest level on, a brick is drawn where its voxels are no further apart in the picture than
`pixels`, and replaced by its finer bricks where they are; what lies outside of the view is left out.
The distance counts at the brick's nearest point along the view axis, on the axis where voxels are
furthest apart; around the eye it is 0, so there the finest bricks are drawn.

What it selects grows with the logarithm of the volume's size (Guthe et al., appendix), but the constant
is large: about 7300 bricks of 16³ an octave for a picture of 256² with a view of 90 degrees.

**Use it** for the finest picture that the screen can show, and as the reference of other policies.
**Do not use it** where time or memory are limited: `lod.priority` has a budget. It looks at no voxel's
value: an empty corner is as fine as a full one.

Guthe, Wand, Gonser, Strasser: *Interactive Rendering of Large Volume Data Sets*, 2002, section 4.1, after
Chamberlain et al., 1996.
)";

class Projection {
  public:
    Projection(const BricksDesc& bricks, const Sight& sight, double pixels, const std::stop_token& stop)
        : bricks_(bricks), sight_(sight), pixels_(pixels), stop_(stop), cut_(coarsest_cut(bricks)) {}

    Cut run() {
        for (std::int32_t root : cut_.roots) refine(root);
        return std::move(cut_);
    }

  private:
    void refine(std::int32_t index) {
        if (++visited_ % 1024 == 0) check_stop(stop_);
        const BrickId id = cut_.nodes[std::size_t(index)].id;
        const Region region = region_of(bricks_.volume, bricks_.fine_box_of(id));
        if (!sight_.sees(region)) {
            cut_.nodes[std::size_t(index)].drawn = false;
            return;
        }
        if (id.level == 0 || sight_.pixels(id.level, sight_.depth(region)) <= pixels_) return;
        for (const BrickId& finer : bricks_.finer(id)) {
            const auto child = std::int32_t(cut_.nodes.size());
            cut_.nodes.push_back(whole_node(bricks_, finer));
            cut_.nodes[std::size_t(index)].child[std::size_t(bricks_.octant_of(finer))] = child;
            refine(child);
        }
    }

    const BricksDesc& bricks_;
    const Sight& sight_;
    double pixels_;
    const std::stop_token& stop_;
    Cut cut_;
    std::size_t visited_ = 0;
};

void evaluate(Evaluation& ev) {
    const BricksPtr bricks = ev.input<Bricks>("bricks");
    const CameraPtr camera = ev.input<Camera>("camera");
    const glm::ivec2 size = ev.params().size2("size");
    auto selection = new_selection(bricks->desc(), "lod.projective", camera, size);
    const Sight sight(*camera, size, bricks->desc());
    Cut cut = Projection(bricks->desc(), sight, ev.params().real("pixels"), ev.stop()).run();
    predict_errors(cut, bricks->desc(), value_errors(bricks), &sight);
    list_bricks(cut, bricks->desc(), &sight, *selection);
    output_selection(ev, selection);
}

}  // namespace

NodeType projective_node() {
    NodeType node;
    node.id = "lod.projective";
    node.title = "Detail by distance";
    node.doc = "Selects the bricks whose voxels are as far apart as the picture's pixels.";
    node.keywords = {"level of detail", "LOD", "screen space", "view frustum", "selection"};
    node.inputs = {bricks_input(), camera_input(false)};
    node.outputs = {selection_output()};
    node.params = {size_param(),
                   param::real("pixels", 1, "Largest distance of two voxels in the picture.")
                       .range(1.0 / 16, 4096).slider(0.5, 16, Scale::logarithmic).in_unit("pixels").is_quality()};
    node.method = kMethod;
    node.evaluate = evaluate;
    return node;
}

}  // namespace voxloom::lod
