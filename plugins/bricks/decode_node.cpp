#include <fmt/format.h>

#include <algorithm>

#include "core/data/brick_cache.h"
#include "plugins/bricks/nodes.h"

namespace voxloom::bricks {

namespace {

constexpr const char* kMethod = R"(
Reads one level of any Bricks, whole or a box of it, as a Volume that keeps its place in the world.
Values are rounded half to even and clamped to the volume's own type.

`access: dense` decodes everything at once, in parallel, into memory. `access: stream` decodes
nothing until somebody reads, and then only the families of bricks that the region touches, through
the cache of bricks: for writers and metrics that walk over volumes larger than memory.

**Use it** to look at what a codec made of a volume, to measure its error, to write a level to a file,
or to feed renderers that take Volumes. **Do not use it** in front of a renderer that takes Bricks:
that one decodes just what it draws.
)";

Box region_of(const Params& params, Index3 dims) {
    const std::vector<double>& r = params.numbers("region");
    if (std::ranges::all_of(r, [](double v) { return v == 0; })) return Box::of(dims);
    return {Index3(r[0], r[1], r[2]), Index3(r[3], r[4], r[5])};
}

VolumeDesc region_desc(const BricksDesc& bricks, int level, const Box& box) {
    VolumeDesc desc = level_volume_desc(bricks, level);
    if (box == Box::of(desc.dims)) return desc;
    desc.index_to_world[3] = desc.index_to_world * glm::dvec4(glm::dvec3(box.lo), 1.0);
    desc.dims = box.dims();
    desc.range.reset();
    return desc;
}

// A box of another volume.
class Region final : public Volume {
  public:
    Region(VolumeDesc desc, VolumePtr whole, Index3 lo)
        : Volume(std::move(desc)), whole_(std::move(whole)), lo_(lo) {}
    void read(const Box& box, std::span<std::byte> out, const std::stop_token& stop) const override {
        whole_->read({box.lo + lo_, box.hi + lo_}, out, stop);
    }
    void read_mask(const Box& box, std::span<std::uint8_t> out) const override {
        whole_->read_mask({box.lo + lo_, box.hi + lo_}, out);
    }
    std::uint64_t resident_bytes() const override { return whole_->resident_bytes(); }

  private:
    VolumePtr whole_;
    Index3 lo_;
};

void describe_decode(Description& d) {
    d.output("volume", PortType::volume);
    const ValueDesc* input = d.input("bricks");
    const auto* bricks = input ? std::get_if<BricksDesc>(&input->detail) : nullptr;
    if (!bricks) return;
    const int level = int(d.params().integer("level")), levels = int(bricks->levels.size());
    if (level >= levels) {
        d.problem(levels == 1 ? fmt::format("there is no level {}: these bricks have only level 0", level)
                              : fmt::format("there is no level {}: these bricks have levels 0 to {}", level,
                                            levels - 1),
                  "level");
        return;
    }
    const Index3 dims = bricks->levels[std::size_t(level)].dims;
    const Box box = region_of(d.params(), dims);
    if (!Box::of(dims).contains(box) || (box.empty() && box != Box::of(dims))) {
        d.problem(fmt::format("a region of this level goes from [0, 0, 0] up to at most [{}, {}, {}], and "
                              "its ends must exceed its beginnings",
                              dims.x, dims.y, dims.z),
                  "region");
        return;
    }
    ValueDesc volume(region_desc(*bricks, level, box));
    volume.by_region = d.params().text("access") == "stream";
    d.output("volume", std::move(volume));
}

void evaluate_decode(Evaluation& e) {
    const BricksPtr bricks = e.input<Bricks>("bricks");
    const int level = int(e.params().integer("level"));
    const Box box = region_of(e.params(), bricks->desc().levels[std::size_t(level)].dims);
    VolumePtr volume = level_as_volume(bricks, level, BrickCache::global());
    if (box != Box::of(volume->desc().dims))
        volume = std::make_shared<Region>(region_desc(bricks->desc(), level, box), volume, box.lo);
    if (e.params().text("access") == "dense")
        volume = in_memory(volume, e.stop(), [&](double fraction) { e.progress(fraction, "decoding"); });
    e.output("volume", volume);
}

}  // namespace

NodeType decode_node() {
    NodeType node;
    node.id = "bricks.decode";
    node.title = "Decode";
    node.doc = "Turns a level of bricks, or a box of it, back into a volume.";
    node.keywords = {"decompress", "level", "region", "crop", "extract", "random access"};
    node.inputs = {{"bricks", PortType::bricks, "Bricks of any codec."}};
    node.outputs = {{"volume", PortType::volume, "The decoded voxels, in their place in the world."}};
    node.params = {
        param::integer("level", 0, "Level to decode; 0 is the finest, each further one has half the samples "
                                   "along the axes that were halved.")
            .range(0, 40).slider(0, 8).is_quality(),
        param::vector("region", {0, 0, 0, 0, 0, 0},
                      "First voxel and the one after the last, [x, y, z, x, y, z], in voxels of the level; "
                      "all zero takes everything.")
            .range(0, 1e12).whole().in_unit("voxels"),
        param::choice("access", {"dense", "stream"}, "dense",
                      "Decode everything now, into memory, or regions when they are read.")
            .changes(Affects::cost),
    };
    node.method = kMethod;
    node.describe = describe_decode;
    node.evaluate = evaluate_decode;
    return node;
}

}  // namespace voxloom::bricks
