#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/data/brick_cache.h"
#include "core/measure/volume_error.h"
#include "plugins/metrics/nodes.h"
#include "plugins/metrics/row.h"

namespace voxloom::metrics {

namespace {

constexpr const char* kMethod = R"(
Compares a volume with its reference, sample by sample (voxels times components):

* `rmse`, `mean_error` (a bias), `max_error` and where it is,
* `psnr` = 20 log10(peak/rmse), the peak being the reference's largest minus its smallest value;
  for integers also `psnr_nominal` with the peak 2^b - 1 of the b bits in use,
* `correlation` (Pearson),
* for Bricks `compressed_bytes` and `bits_per_voxel`, headers and index included.

A PSNR alone hides outliers: read `max_error` beside it. Samples that are not finite or masked on both
sides are `skipped`; on one side alone they are `mismatched`, and enter no sum. Both sides are read tile
by tile, so neither needs to fit in memory; sums are compensated and do not depend on threads.

Not a measure of what is seen: a small error in a value that the transfer function makes visible counts
like one that it hides. Compare pictures with `metrics.image` for that.
)";

VolumePtr as_volume(const Value& value) {
    if (auto* volume = std::get_if<VolumePtr>(&value)) return *volume;
    return level_as_volume(std::get<BricksPtr>(value), 0, BrickCache::global());
}

Index3 tile_for(const Value& value) {
    auto* bricks = std::get_if<BricksPtr>(&value);
    return bricks ? tile_of_bricks((*bricks)->desc().brick) : Index3(0);
}

bool same_place(const VolumeDesc& a, const VolumeDesc& b) {
    double size = 0, apart = 0;
    for (int c = 0; c < 4; ++c)
        for (int r = 0; r < 3; ++r) {
            size = std::max(size, std::abs(b.index_to_world[c][r]));
            apart = std::max(apart, std::abs(a.index_to_world[c][r] - b.index_to_world[c][r]));
        }
    return apart <= 1e-6 * size;
}

void describe_node(Description& d) {
    const ValueDesc *volume = d.input("volume"), *reference = d.input("reference");
    if (!volume || !reference || !volume->volume() || !reference->volume()) return;
    if (std::string problem = problem_with_comparison(*volume->volume(), *reference->volume());
        !problem.empty())
        d.problem(problem, "volume");
}

void evaluate_node(Evaluation& ev) {
    const VolumePtr volume = as_volume(ev.value("volume"));
    const VolumePtr reference = as_volume(ev.value("reference"));
    if (!same_place(volume->desc(), reference->desc()))
        ev.warn("the volume and its reference lie at different places in the world; voxels are "
                "compared by their index");

    CompareOptions options;
    options.stop = ev.stop();
    options.progress = [&](double done) { ev.progress(done, "comparing"); };
    const Index3 mine = tile_for(ev.value("volume"));
    options.tile = mine.x > 0 ? mine : tile_for(ev.value("reference"));
    const VolumeError e = compare_volumes(volume, reference, options);

    const std::string& label = ev.params().text("label");
    Row row(ev, !label.empty() ? label : volume->desc().name);
    row.add("rmse", e.rmse).add("psnr", e.psnr_range, "dB");
    row.add("psnr_peak", e.reference_range.extent());
    if (e.psnr_nominal)
        row.add("psnr_nominal", *e.psnr_nominal, "dB").add("nominal_peak", *e.nominal_peak);
    row.add("max_error", e.max_error);
    row.text("max_error_at", fmt::format("{} {} {}", e.max_error_at.x, e.max_error_at.y,
                                         e.max_error_at.z));
    row.add("mean_error", e.mean_error).add("correlation", e.correlation);
    row.count("different", e.different).count("compared", e.compared);
    row.count("skipped", e.skipped).count("mismatched", e.mismatched);
    if (auto* bricks = std::get_if<BricksPtr>(&ev.value("volume"))) {
        const std::uint64_t bytes = (*bricks)->desc().compressed_bytes;
        const std::uint64_t voxels = reference->desc().voxels();
        row.count("compressed_bytes", bytes, "B");
        if (voxels > 0) row.add("bits_per_voxel", 8 * double(bytes) / double(voxels));
    }
    ev.output("table", row.table());
}

}  // namespace

NodeType volume_node() {
    NodeType node;
    node.id = "metrics.volume";
    node.title = "Volume error";
    node.doc = "Measures how far a volume is from its reference.";
    node.keywords = {"RMSE", "PSNR", "maximum error", "compare", "quality", "difference", "lossless"};
    node.inputs = {{"volume", {PortType::volume, PortType::bricks}, "What is judged."},
                   {"reference", {PortType::volume, PortType::bricks}, "What it should be."}};
    node.outputs = {{"table", PortType::table, "One row of measurements."}};
    node.params = {param::text("label", "", "Name of the row; empty: the name of the volume.")};
    node.method = kMethod;
    node.describe = describe_node;
    node.evaluate = evaluate_node;
    return node;
}

}  // namespace voxloom::metrics
