// compress and decompress: graphs of three nodes, written for the user and run like any other.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "app/cli/commands.h"
#include "app/cli/files.h"
#include "app/cli/session.h"
#include "core/base/text.h"
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
        if (reason.empty() || names_ending(*type, file)) reason = plan.problems.front().message;
    }
    if (reason.empty()) fail("{}: there is no plugin that opens compressed files", file.string());
    fail("{}", reason);
}

// --- options of `compress` that become parameters of a codec's encoder ---

// "--lossless, --psnr": what the codec can be aimed at, as options of this command.
std::string targets_of(const ParamSpec& target) {
    std::vector<std::string> options;
    for (const std::string& choice : target.choices) options.push_back("--" + choice);
    return join(options, ", ");
}

std::string target_of(const CompressArguments& arguments, const NodeType& encoder) {
    const ParamSpec* target = encoder.find_param("target");
    if (!target) {  // a codec with one choice
        if (arguments.target != "lossless") fail("codec '{}' loses nothing, so it takes no --{}", arguments.codec, arguments.target);
        return "";
    }
    if (std::ranges::find(target->choices, arguments.target) == target->choices.end())
        fail("codec '{}' has no --{}; it has {}", arguments.codec, arguments.target, targets_of(*target));
    std::string set = "target: " + arguments.target;
    if (!arguments.amount_key.empty()) set += fmt::format(", {}: {}", arguments.amount_key, to_yaml(arguments.amount));
    return set;
}

const ParamSpec& param_of(const CompressArguments& arguments, const NodeType& encoder, const std::string& key,
                          const std::string& option) {
    if (const ParamSpec* spec = encoder.find_param(key)) return *spec;
    std::vector<std::string> keys;
    for (const ParamSpec& spec : encoder.params) keys.push_back(spec.key);
    fail("codec '{}' has no {}{} (`voxloom nodes {}` tells what it takes)", arguments.codec, option, did_you_mean(key, keys),
         encoder.id);
}

// The encoder's parameters in YAML.
std::string settings_of(const CompressArguments& arguments, const NodeType& encoder) {
    std::vector<std::string> set;
    if (std::string target = target_of(arguments, encoder); !target.empty()) set.push_back(std::move(target));
    const auto add_text = [&](const std::string& key, const std::string& value) {
        if (value.empty()) return;
        param_of(arguments, encoder, key, "--" + key);
        set.push_back(key + ": " + to_yaml(value));
    };
    add_text("coder", arguments.coder);
    add_text("faces", arguments.faces);
    if (arguments.brick > 0) {
        const ParamSpec& brick = param_of(arguments, encoder, "brick", "--brick");
        const double n = arguments.brick;
        set.push_back("brick: " + (brick.kind == ParamKind::vector ? to_yaml(std::vector<double>(brick.length, n))
                                                                   : to_yaml(std::to_string(arguments.brick))));
    }
    if (arguments.memory > 0) {
        param_of(arguments, encoder, "memory", "--memory");
        set.push_back("memory: " + to_yaml(double(arguments.memory) / (1 << 20)));
    }
    for (const std::string& assignment : arguments.overrides) {
        const std::size_t equals = assignment.find('=');
        if (equals == std::string::npos) fail("--set {}: write PARAM=VALUE", assignment);
        const std::string key = assignment.substr(0, equals);
        param_of(arguments, encoder, key, "parameter '" + key + "'");
        set.push_back(key + ": " + assignment.substr(equals + 1));
    }
    return join(set, ", ");
}

}  // namespace

int compress(const CompressArguments& arguments, std::stop_token stop) {
    const Registry& registry = load_registry();
    const NodeType* encoder = registry.find(arguments.codec + ".encode");
    const NodeType* writer = registry.find(arguments.codec + ".write");
    if (!encoder || !writer)
        fail("there is no codec '{}' that writes files; `voxloom nodes` lists the nodes NAME.encode and NAME.write",
             arguments.codec);
    return run_text(fmt::format("voxloom: 1\n"
                                "nodes:\n"
                                "  - {{ id: read, type: readers.volume, set: {{ path: {} }} }}\n"
                                "  - {{ id: encode, type: {}, in: {{ volume: read.volume }}, set: {{ {} }} }}\n"
                                "  - {{ id: write, type: {}, in: {{ bricks: encode.bricks }}, set: {{ path: {} }} }}\n",
                                quoted(arguments.in), encoder->id, settings_of(arguments, *encoder), writer->id,
                                quoted(arguments.out)),
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
