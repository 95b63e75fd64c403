#include "plugins/lod/error_model.h"
#include "plugins/lod/nodes.h"
#include "plugins/lod/priority.h"

namespace voxloom::lod {

namespace {

constexpr const char* kPriorityMethod = R"(
The queue of Guthe et al. holds the bricks that are drawn, first the coarsest ones, ordered by E/z: the L2
error of drawing the brick in place of the original over its distance from the eye. The worst octant of the
first brick gets a brick of its own; the others stay where they are until it is their turn. So detail goes
where there is error that can be seen, until `max_bricks` are drawn or no pixel is expected to be off by
more than `max_error`.

What the paper leaves open: priorities count the octants that a brick still draws, not those that finer
bricks have taken over; bricks replaced in part count against the budget until their last octant is gone;
what lies outside of the view costs nothing; ties are broken by place, so the selection is a function of
its inputs. Around the eye z is 0 and the priority infinite.

The predicted error of a brick is the RMS error of its voxels, as a fraction of the extent of all values,
less where several voxels share a pixel: the error that a pixel covered by it is expected to have with a
linear transfer function. `sum` is the root of the sum of (E/z)² with z in diagonals of the volume; it
falls with every further brick.

The paper's settings are 512 bricks and 1/32, 1024 and 1/64, 2048 and 1/128.

**Use it** for walkthroughs, and wherever time and memory have limits. **Do not use it** for steep transfer
functions, which can turn a small error of values into a large one of colours: `lod.transfer-aware`.

Guthe, Wand, Gonser, Strasser: *Interactive Rendering of Large Volume Data Sets*, 2002, section 4.2.
)";

constexpr const char* kTransferMethod = R"(
As `lod.priority`, with the error after classification in place of the values' own. For a ray of length L
through a brick whose emission and extinction are off by dC and dt at most, no channel of the pixel is off
by more than L (dC + dt). dC and dt follow from the largest error of the brick's values, known without
decoding, and from the transfer function between the smallest and largest value that can be there. Bricks in
which the transfer function is 0 are left out and cost nothing.

It is a bound, so the promise holds for steep transfer functions, at the price of finer bricks than needed
where values are off in places that are not seen.

**Use it** when the transfer function is given, most of all when much is transparent. **Do not use it** while
the transfer function is being edited over slow storage: each change selects anew, and fetches other bricks.
)";

void evaluate(Evaluation& ev, const char* policy, const ErrorModel& errors) {
    const BricksPtr bricks = ev.input<Bricks>("bricks");
    const CameraPtr camera = ev.input<Camera>("camera");
    const glm::ivec2 size = ev.params().size2("size");
    const BricksDesc& desc = bricks->desc();
    auto selection = new_selection(desc, policy, camera, size);
    const Sight sight(*camera, size, desc);
    PriorityLimits limits;
    limits.bricks = ev.params().integer("max_bricks");
    limits.error = ev.params().real("max_error");
    limits.pixels = ev.params().real("pixels");
    const PriorityResult result = select_by_priority(desc, errors, sight, limits, ev.stop());
    list_bricks(result.cut, desc, &sight, *selection);
    if (const std::size_t n = result.cut.bricks(); std::int64_t(n) > limits.bricks)
        ev.warn(fmt::format("{} bricks of the coarsest level are seen, more than max_bricks allows; bricks "
                            "without levels of detail have nothing coarser", n));
    ev.measure("sum", result.sum, "of the peak");
    output_selection(ev, selection);
}

NodeType queue_node() {
    NodeType node;
    node.inputs = {bricks_input(), camera_input(false)};
    node.outputs = {selection_output()};
    node.params = {
        size_param(),
        param::integer("max_bricks", 2048, "Bricks drawn at most.")
            .range(1, 1 << 24).slider(64, 16384, Scale::logarithmic).is_quality(),
        param::real("max_error", 1.0 / 128, "A brick whose pixels are off by no more, as a fraction of the peak, is "
                                            "good enough.")
            .range(0, 1).slider(1e-4, 0.1, Scale::logarithmic).is_quality(),
        param::real("pixels", 1, "A brick whose voxels are no further apart in the picture is fine enough.")
            .range(1.0 / 16, 4096).slider(0.5, 16, Scale::logarithmic).in_unit("pixels").is_quality()};
    return node;
}

}  // namespace

NodeType priority_node() {
    NodeType node = queue_node();
    node.id = "lod.priority";
    node.title = "Detail by error";
    node.doc = "Selects bricks where their error weighs most in the picture, within a budget.";
    node.keywords = {"level of detail", "LOD", "priority queue", "budget", "error", "selection"};
    node.method = kPriorityMethod;
    node.evaluate = [](Evaluation& ev) {
        evaluate(ev, "lod.priority", value_errors(ev.input<Bricks>("bricks")));
    };
    return node;
}

NodeType transfer_aware_node() {
    NodeType node = queue_node();
    node.id = "lod.transfer-aware";
    node.title = "Detail by visible error";
    node.doc = "Selects bricks by a bound on their error in colour and opacity; transparent ones are left out.";
    node.keywords = {"level of detail", "LOD", "priority queue", "classification", "empty space", "selection"};
    node.inputs.push_back({"transfer", PortType::transfer, "Opacity and colour of the values."});
    node.method = kTransferMethod;
    node.evaluate = [](Evaluation& ev) {
        evaluate(ev, "lod.transfer-aware",
                 classified_errors(ev.input<Bricks>("bricks"), ev.input<TransferFunction>("transfer")));
    };
    return node;
}

}  // namespace voxloom::lod
