#include <fmt/format.h>

#include <cmath>

#include "plugins/bricks/coarse_levels.h"
#include "plugins/bricks/nodes.h"

namespace voxloom::bricks {

namespace {

constexpr const char* kMethod = R"(
Each level keeps every second sample of the one below it, on the axes that are still longer than a
brick and whose spacing is at most √2 times the smallest of those: slices that lie far apart are first
halved in plane. Sample n of level l stays where it was, at fine index n·2^l, so a linear ramp is the
same ramp at every level.

- **average** takes (1 2 1)/4 around the kept sample: smooth, never beyond the values it saw.
- **lifting53**, the lowpass (−1 2 6 2 −1)/8 of the 5/3 wavelet, keeps edges sharper and overshoots
  at steps; its levels are comparable with those of a wavelet codec.
- **subsample** keeps the samples as they are, as LaMar et al. do for cutting planes. Levels agree
  exactly where they share samples, but fine detail aliases.

Filters work axis by axis in double, with one rounding that neither brightens nor darkens. NaN,
infinities and masked voxels take no part: the remaining weights are renormalised.

Every brick knows its range of values, and the exact L2 and maximum error of drawing it, interpolated
linearly, in place of the volume, for each octant too. That takes a second walk over the volume.

Given bricks of a codec, level 0 stays compressed and is decoded when it is asked for; only the coarser levels, made of
what it decodes to, are in memory. Errors count what the codec lost: those of level 0 are the codec's own, and the
coarser ones' are joined with them as if both were independent.

**Use it** to draw volumes by level of detail that no codec gives, and as the uncompressed peer in
comparisons of codecs. The volume itself stays where it is: of a file that reads by region only the
coarse levels, about a seventh, are held in memory. **Do not use it** for a whole volume where memory is short: nothing is
compressed. Small bricks follow the view and the transfer function more closely, large ones cost less
to manage and to draw.

LaMar, Duchaineau, Hamann, Joy: *Multiresolution techniques for interactive texture-based rendering of
arbitrarily oriented cutting planes*, 2000. Le Gall, Tabatabai: *Sub-band coding of digital images using
symmetric short kernel filters*, 1988.
)";

PyramidFilter filter_of(const Params& params) {
    const std::string& name = params.text("filter");
    if (name == "subsample") return PyramidFilter::subsample;
    return name == "average" ? PyramidFilter::average : PyramidFilter::lifting53;
}

void describe_pyramid(Description& d) {
    const ValueDesc* input = d.input("volume");
    d.output("bricks", PortType::bricks);
    if (!input || !input->volume()) return;
    if (const auto* bricks = std::get_if<BricksDesc>(&input->detail)) {
        d.output("bricks", coarse_levels_desc(*bricks, filter_of(d.params())));
        return;
    }
    try {
        d.output("bricks", dense_pyramid_desc(*input->volume(), glm::ivec3(d.params().index3("brick")),
                                              filter_of(d.params())));
    } catch (const Error& error) {
        d.problem(error.what(), "brick");
    }
}

void evaluate_pyramid(Evaluation& e) {
    const PyramidFilter filter = filter_of(e.params());
    const auto tell = [&](double fraction) { e.progress(fraction, "building levels"); };
    const BricksPtr source = e.input<Bricks>("volume");
    const BricksPtr bricks =
        source ? with_coarse_levels(source, filter, e.stop(), tell)
               : make_dense_pyramid(e.input<Volume>("volume"), glm::ivec3(e.params().index3("brick")), filter, e.stop(), tell);
    const BricksDesc& desc = bricks->desc();
    const double values = double(desc.volume.voxels()) * desc.volume.components;
    double count = 0;
    for (int l = 0; l < int(desc.levels.size()); ++l) {
        const glm::ivec3 grid = desc.levels[std::size_t(l)].bricks;
        double squares = 0;
        for (int z = 0; z < grid.z; ++z)
            for (int y = 0; y < grid.y; ++y)
                for (int x = 0; x < grid.x; ++x) {
                    const double l2 = bricks->info({l, {x, y, z}}).l2;
                    squares += l2 * l2;
                    ++count;
                }
        if (l > 0) e.measure(fmt::format("rmse of level {}", l), std::sqrt(squares / values));
    }
    e.measure("levels", double(desc.levels.size()));
    e.measure("bricks", count);
    e.measure("size", double(desc.compressed_bytes), "bytes");
    e.output("bricks", bricks);
}

}  // namespace

NodeType pyramid_node() {
    NodeType node;
    node.id = "bricks.pyramid";
    node.title = "Pyramid";
    node.doc = "Builds the levels of detail of a volume, or of bricks of any codec, with the error of every brick.";
    node.keywords = {"level of detail", "LOD", "multiresolution", "mipmap", "octree", "downsample", "average"};
    node.inputs = {{"volume", {PortType::volume, PortType::bricks},
                    "The finest level; of bricks that have levels themselves, level 0."}};
    node.outputs = {{"bricks", PortType::bricks, "The finest level and all coarser ones."}};
    node.params = {
        param::choice("filter", {"average", "lifting53", "subsample"}, "average",
                      "What a coarse sample is made of: (1 2 1)/4, the lowpass of the 5/3 wavelet, or the "
                      "fine sample as it is.")
            .is_quality(),
        param::vector("brick", {32, 32, 32}, "Voxels of a brick along x, y and z; of Bricks, theirs are kept.")
            .range(1, 4096).slider(8, 128, Scale::logarithmic).whole().in_unit("voxels"),
    };
    node.method = kMethod;
    node.describe = describe_pyramid;
    node.evaluate = evaluate_pyramid;
    return node;
}

}  // namespace voxloom::bricks
