// The nodes vq.encode, vq.write and vq.open.
#include "core/plugin/plugin.h"
#include "plugins/codec-vq/encoder.h"

namespace voxloom::vq {

namespace {

std::vector<ParamSpec> encoding_params() {
    return {
        param::integer("codewords", 256, "Codewords of each codebook, at most.").range(2, 256).slider(16, 256).is_quality(),
        param::choice("loop", {"closed", "open"}, "closed",
                      "Closed: the second codebook mends what the first one misses. Open: as published, errors add."),
        param::vector("macroblocks", {1, 1, 1}, "Parts along x, y and z, each with codebooks of its own; at most one a brick.")
            .range(1, 64).slider(1, 8).whole().is_quality(),
        param::choice("brick", {"8", "16", "32", "64", "128"}, "32", "Voxels of a brick along each axis."),
        param::integer("sample", 1 << 16, "Blocks of each macroblock that its codebooks are trained with, at most.")
            .range(1, 1 << 18).slider(1 << 10, 1 << 18, Scale::logarithmic).in_unit("blocks").in_group("Training").is_quality(),
        param::integer("sweeps", 20, "Refinements of each codebook, at most; they end when they gain less than a thousandth.")
            .range(0, 100).slider(0, 20).in_group("Training").is_quality(),
        param::integer("seed", 1, "Of the choice of blocks.").range(0, 1e9).in_group("Training").for_experts(),
    };
}

EncodeOptions options_of(const Params& params) {
    EncodeOptions options;
    options.codewords = int(params.integer("codewords"));
    options.loop = params.text("loop") == "closed" ? Loop::closed : Loop::open;
    options.macroblocks = glm::ivec3(params.index3("macroblocks"));
    options.brick = std::stoi(params.text("brick"));
    options.sample = std::uint32_t(params.integer("sample"));
    options.sweeps = int(params.integer("sweeps"));
    options.seed = std::uint64_t(params.integer("seed"));
    return options;
}

void describe_encode(Description& node) {
    const ValueDesc* input = node.input("volume");
    const VolumeDesc* volume = input ? input->volume() : nullptr;
    if (!volume) return;
    const EncodeOptions options = options_of(node.params());
    try {
        node.output("bricks", plan(*volume, options));
    } catch (const Error& e) {
        node.problem(e.what());
    }
    constexpr std::uint64_t sampled_block = 600;  // its numbers, its octants, and the search for equal ones
    const glm::dvec3 m(options.macroblocks);
    const double codebooks = 4.0 * 72 * options.codewords * m.x * m.y * m.z * volume->components;
    node.working_memory(sampled_block * std::min<std::uint64_t>(options.sample, volume->voxels() / 64 + 1) + std::uint64_t(std::min(codebooks, 1e15)));
}

void evaluate_encode(Evaluation& node) {
    VolumePtr volume = node.input<Volume>("volume");
    if (!volume->reads_by_region()) volume = in_memory(volume, node.stop());
    EncodeReport report;
    const VqBricksPtr bricks = encode(*volume, options_of(node.params()), report, node.stop(),
                                      [&](double fraction) { node.progress(fraction, "encoding"); });
    node.measure("bits per voxel", report.bits_per_voxel, "bits");
    node.measure("ratio", double(volume->desc().dense_bytes()) / double(bricks->desc().compressed_bytes));
    node.measure("psnr", report.psnr, "dB");
    node.measure("rmse", report.rmse);
    node.measure("max error", report.max_error);
    node.measure("training distortion", report.distortion);
    node.measure("training time", report.training_seconds, "s");
    node.measure("codec time", report.codec_seconds, "s");
    node.count("bricks", double(bricks->index().bricks.places.size()));
    node.count("codebooks", double(2 * bricks->index().books.size()));
    node.count("blocks sampled", double(report.sampled));
    node.count("sweeps", report.sweeps);
    node.count("constant blocks", double(report.constant_blocks));
    node.count("blocks kept raw", double(report.raw_blocks));
    node.output("bricks", BricksPtr(bricks));
}

NodeType encode_node() {
    NodeType type;
    type.id = "vq.encode";
    type.title = "Vector quantiser";
    type.doc = "Compresses a volume at a fixed rate: a mean and two codewords for every 4^3 voxels.";
    type.keywords = {"compress", "codec", "vq", "vector quantisation", "codebook", "lossy", "hierarchical"};
    type.inputs = {{"volume", PortType::volume, "What is compressed."}};
    type.outputs = {{"bricks", PortType::bricks, "The bricks, compressed in memory."}};
    type.params = encoding_params();
    type.describe = describe_encode;
    type.evaluate = evaluate_encode;
    type.method = R"(**Method.** A block of 4^3 voxels is its mean, the differences of its eight octants' means, and the differences of its voxels to
those. Each kind of difference is one codeword of a codebook of up to 256: with a mean of b bits (those of the scalar type) a block
takes b + 16 bits, and a voxel (b + 16) / 64, whatever is in it. Codebooks come on top: 72 numbers for each pair of codewords, of 16 bits
for 8-bit volumes and of 32 for others, for each macroblock and component; and an index, 23 to 39 bytes a brick.

A codebook starts as one cell; the cell with the largest distortion is split across its principal axis until there are enough; sweeps
move codewords to the centroids of their vectors. The first codeword is always zero, so that constant blocks are exact. Training sees
a sample of the blocks, every block looks at all codewords. In closed loop the second codebook is trained on and matched with what the
mean and the first codeword leave; in open loop, as published, with what the exact means leave.

Decoded values stay within the brick's range. Blocks with something that is not finite, or with
differences a million million times those of the others, are kept as they are. There is one level;
bricks.pyramid adds coarser ones. `training distortion` is the RMS error of the sample; `training time` is by the clock,
`codec time` the processor time of quantising all blocks once.

**When to use.** Where decoding must be three reads and two additions a voxel, in any order; at rates around half a bit. **When not.**
For errors with a bound, or the best quality for the bits: wavelet.encode.

**Reference.** Schneider, Westermann, Compression Domain Volume Rendering, IEEE Visualization 2003; macroblocks as in Fout, Akiba, Ma,
Lefohn, Kniss, High-Quality Rendering of Compressed Volume Data Formats, EuroVis 2005.)";
    return type;
}

NodeType write_node() {
    NodeType type;
    type.id = "vq.write";
    type.title = "Vector-quantised file writer";
    type.doc = "Writes bricks of vq.encode to a file.";
    type.keywords = {"save", "file", "compress", "vq", "vxq"};
    type.inputs = {{"bricks", PortType::bricks, "Bricks from vq.encode or vq.open."}};
    type.params = {param::path_out("path", "volume.vxq", "The file, by custom with the ending .vxq.")};
    type.writes_files = true;
    type.evaluate = [](Evaluation& node) {
        const auto bricks = std::dynamic_pointer_cast<const VqBricks>(node.input<Bricks>("bricks"));
        if (!bricks) fail("only vector-quantised bricks can be written; put vq.encode before");
        write_file(*bricks, node.output_path("path"), node.stop());
        node.measure("bytes", double(bricks->desc().compressed_bytes), "bytes");
    };
    type.method = R"(**Method.** The bytes are those of the bricks in memory, behind a head with codebooks, index, statistics and checksums. They go
to a temporary name, which is renamed once everything is written, so an interrupted run leaves the old file.

**When to use.** To keep what vq.encode made; vq.open reads it. **When not.** For other codecs' bricks.

**Reference.** docs/brick-format.md.)";
    return type;
}

NodeType open_node() {
    NodeType type;
    type.id = "vq.open";
    type.title = "Vector-quantised file";
    type.doc = "Opens a vector-quantised file; nothing is decoded until it is asked for.";
    type.keywords = {"read", "file", "decompress", "vq", "vxq"};
    type.outputs = {{"bricks", PortType::bricks, "The bricks, mapped from the file."}};
    type.params = {param::path_in("path", "A file that vq.write made.")};
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

**When to use.** For files of vq.write. **When not.** For brick files of other codecs: baseline.open, wavelet.open.

**Reference.** docs/brick-format.md.)";
    return type;
}

void add_nodes(Registry& registry) {
    registry.add(encode_node());
    registry.add(write_node());
    registry.add(open_node());
}

}  // namespace

}  // namespace voxloom::vq

VOXLOOM_PLUGIN("codec-vq", voxloom::vq::add_nodes)
