#include "app/cli/run_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "core/base/text.h"

namespace voxloom::cli {

namespace {

// What is written for a wanted output of this type, or null when the type is not a file's.
struct FileKind {
    const char* writer;
    const char* port;
    const char* extension;
};
const FileKind* file_kind(PortType type) {
    static constexpr FileKind image{"writers.image", "image", "png"};
    static constexpr FileKind table{"writers.table", "table", "csv"};
    static constexpr FileKind volume{"writers.volume", "volume", "nrrd"};
    switch (type) {
        case PortType::image: return &image;
        case PortType::table: return &table;
        case PortType::volume: return &volume;
        default: return nullptr;
    }
}

PortType output_type(const Plan& plan, const Plan::Source& source) {
    const PortSpec& port =
        plan.nodes[std::size_t(source.node)].type->outputs[std::size_t(source.output)];
    int type = 0;
    while (!port.types.has(PortType(type))) ++type;
    return PortType(type);
}

}  // namespace

std::vector<Saver> add_savers(Plan& plan, const Registry& registry, const std::string& suffix) {
    std::vector<Saver> savers;
    const std::vector<Plan::Source> wanted = plan.wanted;
    for (const Plan::Source& source : wanted) {
        if (source.output < 0) continue;
        const Plan::Node& from = plan.nodes[std::size_t(source.node)];
        if (!from.ok) continue;
        const FileKind* kind = file_kind(output_type(plan, source));
        const NodeType* writer = kind ? registry.find(kind->writer) : nullptr;
        if (!writer) continue;
        Plan::Node node;
        const std::string name =
            from.id + "." + from.type->outputs[std::size_t(source.output)].key;
        node.id = "write " + name;
        node.type = writer;
        node.params = Params(writer->params, plan.folder);
        const std::string file = name + suffix + "." + kind->extension;
        node.params.set("path", file);
        node.inputs.resize(writer->inputs.size());
        node.inputs[std::size_t(writer->find_input(kind->port) - writer->inputs.data())] = {source};
        node.outputs.resize(writer->outputs.size());
        node.ok = true;
        savers.push_back({int(plan.nodes.size()), file});
        plan.wanted.push_back({int(plan.nodes.size()), -1});
        plan.nodes.push_back(std::move(node));
    }
    return savers;
}

int node_named(const Plan& plan, std::string_view id, std::string_view option) {
    const int node = plan.find(id);
    if (node >= 0) return node;
    std::vector<std::string> ids;
    for (const Plan::Node& n : plan.nodes) ids.push_back(n.id);
    fail("{}: the graph has no node '{}'{}", option, id, did_you_mean(id, ids));
}

void select_outputs(Plan& plan, const std::vector<std::string>& outputs) {
    if (outputs.empty()) return;
    plan.wanted.clear();
    for (const std::string& name : outputs) {
        const std::size_t dot = name.find('.');
        const int node = node_named(plan, std::string_view(name).substr(0, dot), "--output " + name);
        int output = -1;
        if (const NodeType* type = plan.nodes[std::size_t(node)].type;
            type && dot != std::string::npos) {
            std::vector<std::string> ports;
            for (const PortSpec& port : type->outputs) ports.push_back(port.key);
            auto it = std::find(ports.begin(), ports.end(), name.substr(dot + 1));
            if (it == ports.end())
                fail("--output {}: node '{}' ({}) has no output '{}'; it has {}", name,
                     plan.nodes[std::size_t(node)].id, type->id, name.substr(dot + 1),
                     join(ports, ", "));
            output = int(it - ports.begin());
        }
        plan.wanted.push_back({node, output});
    }
}

void print_messages(const Plan& plan, const RunResult& result) {
    for (std::size_t i = 0; i < result.nodes.size(); ++i) {
        const NodeReport& r = result.nodes[i];
        auto say = [&](const std::string& sentence) {
            fmt::print(stderr, "{}\n", Problem{plan.nodes[i].mark, r.id, "", sentence}.text(plan.file));
        };
        for (const std::string& warning : r.warnings) say("warning: " + warning);
        if (r.state == NodeState::failed) say(r.error);
        // What the check found was said before; the writers behind outputs are nobody's nodes.
        const bool said = !plan.nodes[i].ok && plan.nodes[i].off.empty();
        if (r.state == NodeState::not_run && !said && plan.nodes[i].mark.line > 0)
            say("not run: " + r.error);
    }
}

}  // namespace voxloom::cli
