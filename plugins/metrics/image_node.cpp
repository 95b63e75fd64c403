#include <fmt/format.h>

#include "core/measure/image_error.h"
#include "plugins/metrics/nodes.h"
#include "plugins/metrics/row.h"

namespace voxloom::metrics {

namespace {

constexpr const char* kMethod = R"(
Compares two pictures of one size as they are stored, premultiplied RGBA in linear numbers:

* `rmse` and `max_error` over all four channels, `psnr` with the peak 1,
* `ssim`, the structural similarity of the luma (Gaussian window 11 x 11, sigma 1.5, K1 = 0.01,
  K2 = 0.03): nearer to what people see, 1 for equal pictures,
* `share_off`, the share of pixels with a channel off by more than 1/255: what an 8-bit screen shows.

`difference` is |image - reference| times `scale`. State errors against `reference.raycast`: two
renderers that agree may be wrong together.

Reference: Z. Wang, A. Bovik, H. Sheikh, E. Simoncelli, Image quality assessment: from error visibility to
structural similarity, IEEE TIP 2004.
)";

const ImageDesc* image_desc(const ValueDesc* desc) {
    return desc ? std::get_if<ImageDesc>(&desc->detail) : nullptr;
}

void describe_node(Description& d) {
    const ImageDesc *image = image_desc(d.input("image")), *reference = image_desc(d.input("reference"));
    if (reference) d.output("difference", *reference);
    if (!image || !reference) return;
    if (std::string problem = problem_with_comparison(image->size, reference->size); !problem.empty())
        d.problem(problem, "image");
}

void evaluate_node(Evaluation& ev) {
    const ImagePtr image = ev.input<Image>("image"), reference = ev.input<Image>("reference");
    const ImageError e = compare_images(*image, *reference, ev.stop());
    Row row(ev, ev.params().text("label"));
    row.add("rmse", e.rmse).add("psnr", e.psnr, "dB").add("ssim", e.ssim);
    row.add("max_error", e.max_error);
    row.text("max_error_at", fmt::format("{} {}", e.max_error_at.x, e.max_error_at.y));
    row.add("share_off", e.share_off);
    row.count("pixels", e.pixels).count("mismatched", e.mismatched);
    ev.output("table", row.table());
    ev.output("difference", difference_image(*image, *reference, ev.params().real("scale"), ev.stop()));
}

}  // namespace

NodeType image_node() {
    NodeType node;
    node.id = "metrics.image";
    node.title = "Image error";
    node.doc = "Measures how far a picture is from its reference, and draws the difference.";
    node.keywords = {"RMSE", "PSNR", "SSIM", "compare", "quality", "difference"};
    node.inputs = {{"image", PortType::image, "The picture that is judged."},
                   {"reference", PortType::image, "What it should be."}};
    node.outputs = {{"table", PortType::table, "One row of measurements."},
                    {"difference", PortType::image, "The difference, made visible."}};
    node.params = {param::text("label", "", "Name of the row."),
                   param::real("scale", 10, "Multiplies the difference that is drawn.")
                       .range(0, 1e6).slider(1, 1000, Scale::logarithmic)};
    node.method = kMethod;
    node.describe = describe_node;
    node.evaluate = evaluate_node;
    return node;
}

}  // namespace voxloom::metrics
