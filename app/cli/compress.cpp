// compress and decompress: graphs of three nodes, written for the user and run like any other.
#include <fmt/format.h>

#include <cstdio>

#include "app/cli/commands.h"
#include "app/cli/session.h"
#include "core/graph/check.h"

namespace voxloom::cli {

namespace {

std::string quoted(const std::filesystem::path& path) { return to_yaml(std::filesystem::absolute(path).string()); }

int run_text(const std::string& graph, bool quiet, bool json, std::stop_token stop) {
    RunArguments arguments;
    arguments.quiet = quiet;
    arguments.json = json;
    arguments.out = ".";
    return run(Document::parse(graph), arguments, stop);
}

// A node that opens `file` as Bricks, of whatever codec.
const NodeType& opener_of(const std::filesystem::path& file, const Registry& registry) {
    std::string reason;
    for (const NodeType* type : registry.all()) {
        const ParamSpec* path = type->find_param("path");
        if (!path || path->kind != ParamKind::path_in || !type->inputs.empty() || type->outputs.size() != 1 ||
            !type->outputs[0].types.has(PortType::bricks))
            continue;
        const Document graph = Document::parse("voxloom: 1\nnodes:\n  - { id: file, type: " + type->id +
                                               ", set: { path: " + quoted(file) + " } }\n");
        const Plan plan = voxloom::check(graph.graph(), registry);
        if (plan.problems.empty()) return *type;
        reason = plan.problems.front().message;
    }
    if (reason.empty()) fail("{}: there is no plugin that opens compressed files", file.string());
    fail("{}: {}", file.string(), reason);
}

}  // namespace

int compress(const CompressArguments& arguments, std::stop_token stop) {
    const Registry& registry = load_registry();
    const std::string encode = arguments.codec + ".encode", write = arguments.codec + ".write";
    if (!registry.find(encode) || !registry.find(write))
        fail("there is no codec '{}' that writes files; `voxloom nodes` lists the nodes NAME.encode and NAME.write",
             arguments.codec);
    std::string set = "target: " + arguments.target;
    if (!arguments.amount_key.empty()) set += fmt::format(", {}: {}", arguments.amount_key, to_yaml(arguments.amount));
    if (!arguments.coder.empty()) set += ", coder: " + to_yaml(arguments.coder);
    if (!arguments.faces.empty()) set += ", faces: " + to_yaml(arguments.faces);
    if (arguments.brick > 0) set += fmt::format(", brick: {}", to_yaml(std::to_string(arguments.brick)));
    if (arguments.memory > 0) set += fmt::format(", memory: {}", to_yaml(double(arguments.memory) / (1 << 20)));
    return run_text(fmt::format("voxloom: 1\n"
                                "nodes:\n"
                                "  - {{ id: read, type: readers.volume, set: {{ path: {} }} }}\n"
                                "  - {{ id: encode, type: {}, in: {{ volume: read.volume }}, set: {{ {} }} }}\n"
                                "  - {{ id: write, type: {}, in: {{ bricks: encode.bricks }}, set: {{ path: {} }} }}\n",
                                quoted(arguments.in), encode, set, write, quoted(arguments.out)),
                    arguments.quiet, arguments.json, stop);
}

int decompress(const DecompressArguments& arguments, std::stop_token stop) {
    const NodeType& opener = opener_of(arguments.in, load_registry());
    return run_text(fmt::format("voxloom: 1\n"
                                "nodes:\n"
                                "  - {{ id: open, type: {}, set: {{ path: {} }} }}\n"
                                "  - {{ id: decode, type: bricks.decode, in: {{ bricks: open.bricks }}, set: {{ level: {} }} }}\n"
                                "  - {{ id: write, type: writers.volume, in: {{ volume: decode.volume }}, set: {{ path: {} }} }}\n",
                                opener.id, quoted(arguments.in), arguments.level, quoted(arguments.out)),
                    arguments.quiet, arguments.json, stop);
}

}  // namespace voxloom::cli
