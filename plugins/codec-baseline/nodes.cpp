// For each codec the nodes NAME.encode and NAME.write; and baseline.open for the files of all of them.
#include <algorithm>

#include "core/plugin/plugin.h"
#include "plugins/codec-baseline/encoder.h"

namespace voxloom::baseline {

namespace {

// --- encoding ---

ParamSpec amount_of(Target target) {
    const std::vector<std::string> shown = {std::string(name_of(target))};
    switch (target) {
        case Target::psnr:
            return param::real("psnr", 50, "Peak signal-to-noise ratio over the volume's value range, at the least.")
                .range(0, 400).slider(20, 90).in_unit("dB").shown_if("target", shown).is_quality();
        case Target::max_error:
            return param::real("max_error", 1, "No voxel is further off than this.")
                .range(1e-300, 1e300).slider(0.1, 100, voxloom::Scale::logarithmic).in_unit("value").shown_if("target", shown)
                .is_quality();
        case Target::bpv:
            return param::real("bpv", 2, "Bits a voxel at the most, everything included.")
                .range(1e-6, 256).slider(0.05, 8, voxloom::Scale::logarithmic).in_unit("bits").shown_if("target", shown).is_quality();
        case Target::ratio:
            return param::real("ratio", 8, "Bytes of the original over bytes of the result, at the least.")
                .range(1, 1e6).slider(2, 200, voxloom::Scale::logarithmic).shown_if("target", shown).is_quality();
        case Target::precision:
            return param::real("precision", 12, "Bit planes that are kept of each block.")
                .range(1, 64).in_unit("bits").shown_if("target", shown).is_quality();
        case Target::distance:
            return param::real("distance", 1, "Visual distance; 1 is just not seen, 0 is lossless.")
                .range(0, 25).slider(0, 10).shown_if("target", shown).is_quality();
        case Target::lossless: break;
    }
    fail("a lossless target has no amount");
}

std::vector<ParamSpec> params_of(const Codec& codec) {
    std::vector<ParamSpec> params;
    if (codec.targets.size() > 1) {
        std::vector<std::string> names;
        for (const Target target : codec.targets) names.emplace_back(name_of(target));
        params.push_back(param::choice("target", names, names.front(), "What the encoder is to reach."));
        for (const Target target : codec.targets)
            if (target != Target::lossless) params.push_back(amount_of(target));
    }
    params.insert(params.end(), codec.params.begin(), codec.params.end());
    params.push_back(param::vector("brick", {64, 64, 64}, "Voxels of a brick along x, y and z.")
                         .range(1, 65535).slider(8, 256, voxloom::Scale::logarithmic).whole().in_unit("voxels"));
    return params;
}

EncodeOptions options_of(const Codec& codec, const Params& params) {
    EncodeOptions options;
    options.target = codec.targets.front();
    if (codec.targets.size() > 1) {
        options.target = *std::ranges::find(codec.targets, params.text("target"), name_of);
        if (options.target != Target::lossless) options.amount = params.real(amount_of(options.target).key);
    }
    options.brick = glm::ivec3(params.index3("brick"));
    options.codec = codec.options(params);
    return options;
}

void describe_encode(const Codec& codec, Description& node) {
    const ValueDesc* input = node.input("volume");
    const VolumeDesc* volume = input ? input->volume() : nullptr;
    if (!volume) return;
    try {
        node.output("bricks", plan(*volume, codec, options_of(codec, node.params())));
    } catch (const Error& e) {
        node.problem(e.what());
    }
}

void evaluate_encode(const Codec& codec, Evaluation& node) {
    VolumePtr volume = node.input<Volume>("volume");
    if (!volume->reads_by_region()) volume = in_memory(volume, node.stop());
    EncodeReport report;
    const FlatBricksPtr bricks = encode(*volume, codec, options_of(codec, node.params()), report, node.stop(),
                                        [&](double fraction) { node.progress(fraction, "encoding"); });
    node.measure("bits per voxel", report.bits_per_voxel, "bits");
    node.measure("ratio", double(volume->desc().dense_bytes()) / double(bricks->desc().compressed_bytes));
    node.measure("psnr", report.psnr, "dB");
    node.measure("rmse", report.rmse);
    node.measure("max error", report.max_error);
    node.measure("codec time", report.codec_seconds, "s");
    node.count("bricks", double(bricks->index().bricks.places.size()));
    node.count("bricks kept lossless", double(report.lossless_bricks));
    node.count("bricks kept raw", double(report.raw_bricks));
    node.count("rounds of the search", report.rounds);
    node.output("bricks", BricksPtr(bricks));
}

NodeType encode_node(const Codec& codec) {
    NodeType type;
    type.id = std::string(codec.name) + ".encode";
    type.title = std::string(codec.title) + " encoder";
    type.doc = codec.doc;
    type.keywords = {"compress", "codec", "baseline", std::string(codec.name)};
    type.keywords.insert(type.keywords.end(), codec.keywords.begin(), codec.keywords.end());
    type.inputs = {{"volume", PortType::volume, "What is compressed."}};
    type.outputs = {{"bricks", PortType::bricks, "The bricks, compressed in memory."}};
    type.params = params_of(codec);
    type.describe = [&codec](Description& node) { describe_encode(codec, node); };
    type.evaluate = [&codec](Evaluation& node) { evaluate_encode(codec, node); };
    type.method = "**Method.** " + std::string(codec.method) + R"(

The volume is cut into bricks, each of which is coded and decoded by itself; there is one level, and bricks.pyramid adds coarser
ones. One setting serves all bricks. Every brick is decoded again while it is encoded: one that the setting cannot
keep (NaN, a bound on the error) is kept without loss, and one that the codec cannot make smaller is kept raw; both are counted.
`codec time` is what the codec's own encoding took, once, without search and checks.

**When to use.** As the peer in comparisons of codecs, and where others must read the same coding. **When not.** To
explore a volume at several resolutions: wavelet.encode.)";
    if (!codec.reference.empty()) type.method += "\n\n**Reference.** " + std::string(codec.reference);
    return type;
}

// --- files ---

void evaluate_write(const Codec& codec, Evaluation& node) {
    const auto bricks = std::dynamic_pointer_cast<const FlatBricks>(node.input<Bricks>("bricks"));
    if (!bricks || bricks->index().codec != &codec)
        fail("only bricks of {} can be written; put {}.encode before", codec.title, codec.name);
    write_file(*bricks, node.output_path("path"), node.stop());
    node.measure("bytes", double(bricks->desc().compressed_bytes), "bytes");
}

NodeType write_node(const Codec& codec) {
    NodeType type;
    type.id = std::string(codec.name) + ".write";
    type.title = std::string(codec.title) + " file writer";
    type.doc = "Writes bricks of " + std::string(codec.name) + ".encode to a brick file.";
    type.keywords = {"save", "file", "compress", "vxb", std::string(codec.name)};
    type.inputs = {{"bricks", PortType::bricks, "Bricks of the same codec, encoded or opened."}};
    type.params = {param::path_out("path", "volume.vxb", "The file, by custom with the ending .vxb.")};
    type.writes_files = true;
    type.evaluate = [&codec](Evaluation& node) { evaluate_write(codec, node); };
    type.method = R"(**Method.** The bytes are those of the bricks in memory, behind a head with index, statistics and checksums. They go
to a temporary name, which is renamed once everything is written, so an interrupted run leaves the old file.

**When to use.** To keep what the encoder made; baseline.open reads it. **When not.** For other codecs' bricks.

**Reference.** docs/brick-format.md.)";
    return type;
}

NodeType open_node() {
    NodeType type;
    type.id = "baseline.open";
    type.title = "Brick file";
    type.doc = "Opens a brick file, whichever codec is inside; nothing is decoded until it is asked for.";
    type.keywords = {"read", "file", "decompress", "vxb"};
    for (const Codec* codec : codecs()) type.keywords.emplace_back(codec->name);
    type.outputs = {{"bricks", PortType::bricks, "The bricks, mapped from the file."}};
    type.params = {param::path_in("path", "A file that one of the codecs' writers made.")};
    type.describe = [](Description& node) {
        if (!node.params().was_set("path")) {
            node.problem("no file is given", "path");
            return;
        }
        try {
            node.output("bricks", open_file(node.params().path("path"))->desc());
        } catch (const Error& e) {
            node.problem(e.what(), "path");
        }
    };
    type.evaluate = [](Evaluation& node) { node.output("bricks", BricksPtr(open_file(node.params().path("path")))); };
    type.method = R"(**Method.** The file is mapped into memory; its head is read and checked, bricks are decoded, and their checksums
compared, when they are asked for.

**When to use.** For files of zfp.write, blosc.write, jpeg2000.write, jpegls.write, jpegxl.write and raw.write.
**When not.** For wavelet files: wavelet.open.

**Reference.** docs/brick-format.md.)";
    return type;
}

void add_nodes(Registry& registry) {
    for (const Codec* codec : codecs()) {
        registry.add(encode_node(*codec));
        registry.add(write_node(*codec));
    }
    registry.add(open_node());
}

}  // namespace

}  // namespace voxloom::baseline

VOXLOOM_PLUGIN("codec-baseline", voxloom::baseline::add_nodes)
