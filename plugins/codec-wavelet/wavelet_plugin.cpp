// The nodes wavelet.encode, wavelet.write and wavelet.open.
#include <algorithm>

#include "core/plugin/plugin.h"
#include "plugins/codec-wavelet/encoder.h"
#include "plugins/codec-wavelet/file_format.h"
#include "plugins/codec-wavelet/memory_plan.h"

namespace voxloom::wavelet {

namespace {

const std::vector<std::string> kTargets = {"lossless", "threshold", "psnr", "max-error", "bpv", "ratio"};
const std::vector<std::string> kCoders = {"paper", "dense", "fast"};
const std::vector<std::string> kFaces = {"block", "shared"};
constexpr CoderKind kCoderOf[] = {CoderKind::paper, CoderKind::dense, CoderKind::fast};
const std::vector<std::string> kRoundings = {"jpeg2000", "unbiased"};

// Choices stand in the order of the enumerations.
template <class Enum>
Enum chosen(const Params& params, std::string_view key, const std::vector<std::string>& choices) {
    return static_cast<Enum>(std::find(choices.begin(), choices.end(), params.text(key)) - choices.begin());
}

EncodeOptions options_of(const Params& params) {
    EncodeOptions options;
    options.target = chosen<Target>(params, "target", kTargets);
    constexpr std::string_view kAmounts[] = {"", "threshold", "psnr", "max_error", "bpv", "ratio"};
    if (options.target != Target::lossless) options.amount = params.real(kAmounts[int(options.target)]);
    options.coder = kCoderOf[chosen<std::size_t>(params, "coder", kCoders)];
    options.brick = std::stoi(params.text("brick"));
    options.faces = chosen<Faces>(params, "faces", kFaces);
    options.rounding = chosen<Rounding>(params, "rounding", kRoundings);
    options.memory = std::uint64_t(params.real("memory") * 1024 * 1024);
    return options;
}

// The wavelet tree behind an input, which another codec may have made.
std::shared_ptr<const WaveletBricks> tree_of(const BricksPtr& bricks) {
    return std::dynamic_pointer_cast<const WaveletBricks>(bricks);
}

std::vector<ParamSpec> encoding_params() {
    return {
        param::choice("target", kTargets, "lossless", "What the encoder is to reach."),
        param::real("threshold", 4, "Coefficients smaller than this become zero; 0 is lossless.")
            .range(0, 1e300).slider(0, 256).in_unit("value").shown_if("target", {"threshold"}).is_quality(),
        param::real("psnr", 50, "Peak signal-to-noise ratio over the volume's value range.")
            .range(0, 400).slider(20, 90).in_unit("dB").shown_if("target", {"psnr"}).is_quality(),
        param::real("max_error", 1, "No voxel is further off than this.")
            .range(1e-300, 1e300).slider(0.1, 100, Scale::logarithmic).in_unit("value")
            .shown_if("target", {"max-error"}).is_quality(),
        param::real("bpv", 0.5, "Bits a voxel, everything included.")
            .range(1e-6, 256).slider(0.05, 8, Scale::logarithmic).in_unit("bits").shown_if("target", {"bpv"}).is_quality(),
        param::real("ratio", 20, "Bytes of the original over bytes of the result.")
            .range(1, 1e6).slider(2, 200, Scale::logarithmic).shown_if("target", {"ratio"}).is_quality(),
        param::choice("coder", kCoders, "dense", "The entropy coder: the paper's run lengths and fixed code, adaptive contexts, or static tables and 32 lanes."),
        param::choice("brick", {"8", "16", "32"}, "16",
                      "Voxels of a brick along each axis: larger ones compress better, smaller ones are fetched faster.")
            .in_group("Tree"),
        param::choice("faces", kFaces, "block",
                      "Shared: coarse levels meet across the faces of bricks without a step, for a few per cent more bits at high quality.")
            .in_group("Tree"),
        param::choice("rounding", kRoundings, "unbiased", "Rounding of the lifting: unbiased keeps the brightness of coarse levels.")
            .in_group("Tree").for_experts(),
        param::real("memory", 0, "Memory that encoding may take beside the volume's own; what is more waits in temporary files. 0: a quarter of the machine's.")
            .range(0, 1e9).slider(0, 4096).in_unit("MiB").changes(Affects::cost),
    };
}

void evaluate_encode(Evaluation& node) {
    const EncodeOptions options = options_of(node.params());
    VolumePtr volume = node.input<Volume>("volume");
    if (!volume->reads_by_region()) volume = in_memory(volume, node.stop());
    EncodeOptions named = options;
    named.source = volume->desc().name;
    EncodeReport report;
    const auto bricks = encode(*volume, named, report, node.stop(),
                               [&](double fraction) { node.progress(fraction, "encoding"); });
    node.measure("bits per voxel", report.bits_per_voxel, "bits");
    node.measure("ratio", bricks->desc().compressed_bytes
                              ? double(volume->desc().dense_bytes()) / double(bricks->desc().compressed_bytes) : 1);
    node.measure("psnr", report.psnr, "dB");
    node.measure("rmse", report.rmse);
    node.measure("max error", report.max_error);
    node.measure("codec time", report.codec_seconds, "s");
    node.count("families", double(report.families));
    node.count("families not stored", double(report.empty_families));
    node.count("voxels stored exactly", double(report.patches));
    node.count("rounds of the search", report.rounds);
    node.output("bricks", BricksPtr(bricks));
}

NodeType encode_node() {
    NodeType type;
    type.id = "wavelet.encode";
    type.title = "Wavelet encoder";
    type.doc = "Compresses a volume into an octree of bricks, each of which is decoded with its ancestors alone.";
    type.keywords = {"compress", "codec", "wavelet", "octree", "5/3", "lossless", "lossy", "level of detail", "JPEG 2000"};
    type.inputs = {{"volume", PortType::volume, "What is compressed."}};
    type.outputs = {{"bricks", PortType::bricks, "The tree, compressed in memory."}};
    type.params = encoding_params();
    type.describe = [](Description& node) {
        const ValueDesc* input = node.input("volume");
        const VolumeDesc* volume = input ? input->volume() : nullptr;
        if (!volume) return;
        node.output("bricks", plan(*volume, options_of(node.params())).bricks);
        const std::uint64_t memory = options_of(node.params()).memory;
        const auto samples = double(volume->voxels()) * volume->components;
        node.working_memory(std::min<std::uint64_t>(memory ? memory : default_memory(),
                                                    std::uint64_t(samples * 2 * 4 / 7 + double(volume->dense_bytes()))));
    };
    type.evaluate = evaluate_encode;
    type.method = R"(**Method.** Cubes of (2k)^3 voxels are split by the integer 5/3 wavelet (Calderbank et al. 1998) into k^3
samples and 7k^3 details; eight such cubes of samples form the next, up to one root (Guthe et al. 2002). An axis is
halved only where the spacing says so. Families whose details are all zero are not stored, and read as linear interpolation.

Lossy targets quantise with one step for the whole volume, divided by each band's synthesis norm, with a wide dead
zone; a search finds the step. `psnr` is met to 0.1 dB, `bpv` and `ratio` are budgets that hold headers and index,
`max-error` stores what strays further exactly. `threshold` is the paper's rule: small coefficients are
dropped, the others kept whole. Where losing nothing is no dearer, nothing is lost.

With `faces: shared` a family takes in one layer of its upper neighbours, and both filter the face between them by
itself: absent details are then linear interpolation across faces, too, where `block` repeats the last sample.

`dense` codes with mixed adaptive contexts that start from a state learned once for the file; `paper` is the run-length and
fixed Huffman code of the paper, `fast` static contexts and 32 interleaved rANS states, decoded side by side.

The volume is read slab by slab. Coarse levels and compressed bytes that go beyond `memory` wait in temporary files
($TMPDIR) without a name; the result does not depend on it. `codec time` is the processor time that transform, quantiser
and coder took in one pass, without search, reading and the measuring of errors.

Floats pass through a 24-bit map of their range; `lossless` adds the exact distance of every voxel, but where all
values are multiples of one 1/10^n or 1/2^n, which are integers already. A validity mask is kept exactly; what is not
valid is filled from around it and costs next to nothing. NaN and infinities are kept
in every mode; coarse levels show the last value before them.

**When to use.** For volumes that are explored at several resolutions, or larger than memory once decoded.
**When not.** When only whole volumes are ever read and decoding must run at the speed of memory.

**Reference.** Guthe, Wand, Gonser, Straßer, Interactive Rendering of Large Volume Data Sets, IEEE Visualization 2002.)";
    return type;
}

NodeType write_node() {
    NodeType type;
    type.id = "wavelet.write";
    type.title = "Wavelet file writer";
    type.doc = "Writes a wavelet tree to a file.";
    type.keywords = {"save", "file", "wavelet", "compress", "vxw"};
    type.inputs = {{"bricks", PortType::bricks, "A tree from wavelet.encode or wavelet.open."}};
    type.params = {param::path_out("path", "volume.vxw", "The file, by custom with the ending .vxw.")};
    type.writes_files = true;
    type.evaluate = [](Evaluation& node) {
        const auto tree = tree_of(node.input<Bricks>("bricks"));
        if (!tree) fail("only bricks of the wavelet codec can be written; put wavelet.encode before");
        write_file(*tree, node.output_path("path"), node.stop());
        node.measure("bytes", double(tree->desc().compressed_bytes), "bytes");
    };
    type.method = R"(**Method.** The bytes are those of the tree in memory, behind a head with index, statistics and checksums. They go
to a temporary name, which is renamed once everything is written, so an interrupted run leaves the old file.

**When to use.** To keep what wavelet.encode made. **When not.** For other codecs' bricks.

**Reference.** docs/wavelet-format.md.)";
    return type;
}

NodeType open_node() {
    NodeType type;
    type.id = "wavelet.open";
    type.title = "Wavelet file";
    type.doc = "Opens a wavelet file; nothing is decoded until it is asked for.";
    type.keywords = {"read", "file", "wavelet", "decompress", "vxw"};
    type.outputs = {{"bricks", PortType::bricks, "The tree, mapped from the file."}};
    type.params = {param::path_in("path", "A file that wavelet.write made.")};
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
    type.method = R"(**Method.** The file is mapped into memory; its head is read and checked, families are decoded, and their checksums
compared, when a brick of theirs is asked for.

**When to use.** For files of wavelet.write. **When not.** For volumes in other formats: readers.volume.

**Reference.** docs/wavelet-format.md.)";
    return type;
}

void add_nodes(Registry& registry) {
    registry.add(encode_node());
    registry.add(write_node());
    registry.add(open_node());
}

}  // namespace

}  // namespace voxloom::wavelet

VOXLOOM_PLUGIN("codec-wavelet", voxloom::wavelet::add_nodes)
