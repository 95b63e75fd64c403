#include "app/cli/node_page.h"

#include <fmt/format.h>

#include <cmath>

#include "core/base/text.h"

namespace voxloom::cli {

namespace {

// "|" would end a table's cell.
std::string cell(const std::string& text) {
    std::string out;
    for (char c : text) out += c == '|' ? std::string("\\|") : c == '\n' ? " " : std::string(1, c);
    return out;
}

std::string allowed(const ParamSpec& spec) {
    std::string text(name_of(spec.kind));
    if (!spec.choices.empty()) text = join(spec.choices, ", ");
    if (spec.length && spec.kind != ParamKind::color) text += fmt::format(" of {}", spec.length);
    if (std::isfinite(spec.min) && std::isfinite(spec.max))
        text += fmt::format(", {} to {}", shortest(spec.min), shortest(spec.max));
    else if (std::isfinite(spec.min))
        text += fmt::format(", at least {}", shortest(spec.min));
    else if (std::isfinite(spec.max))
        text += fmt::format(", at most {}", shortest(spec.max));
    if (!spec.unit.empty()) text += ", in " + spec.unit;
    return text;
}

std::string notes(const ParamSpec& spec) {
    std::string text;
    if (spec.quality) text += " *Trades speed for error.*";
    if (spec.affects == Affects::cost) text += " *Changes the cost only, not the result.*";
    if (spec.affects == Affects::display) text += " *Changes the display only.*";
    if (!spec.shown_if_key.empty())
        text += fmt::format(" *Used when `{}` is {}.*", spec.shown_if_key,
                            join(spec.shown_if_values, " or "));
    return text;
}

std::string example(const NodeType& type) {
    std::string text = "```yaml\n- id: " + type.id.substr(type.id.find('.') + 1) +
                       "\n  type: " + type.id + "\n";
    std::string in;
    for (const PortSpec& port : type.inputs)
        if (!port.optional)
            in += fmt::format("{}{}: {}", in.empty() ? "" : ", ", port.key,
                              port.many ? "[NODE.PORT, NODE.PORT]" : "NODE.PORT");
    if (!in.empty()) text += "  in:  { " + in + " }\n";
    std::string set;
    for (const ParamSpec& spec : type.params) {
        if (spec.expert || set.size() > 60) continue;
        const std::string value =
            spec.kind == ParamKind::path_in ? std::string("FILE") : to_yaml(spec.initial);
        if (value.size() < 30) set += (set.empty() ? "" : ", ") + spec.key + ": " + value;
    }
    if (!set.empty()) text += "  set: { " + set + " }\n";
    return text + "```\n";
}

}  // namespace

std::string node_page(const NodeType& type) {
    std::string page = fmt::format("# {}\n\n{}: {}\n\n", type.id, type.title, type.doc);
    page += example(type);
    if (!type.inputs.empty()) {
        page += "\n## Inputs\n\n| port | takes | |\n|---|---|---|\n";
        for (const PortSpec& port : type.inputs)
            page += fmt::format("| `{}` | {}{}{} | {} |\n", port.key, port.types.text(),
                                port.many ? ", any number" : "", port.optional ? ", optional" : "",
                                cell(port.doc));
    }
    if (!type.outputs.empty()) {
        page += "\n## Outputs\n\n| port | gives | |\n|---|---|---|\n";
        for (const PortSpec& port : type.outputs)
            page += fmt::format("| `{}` | {} | {} |\n", port.key, port.types.text(), cell(port.doc));
    }
    if (!type.params.empty()) {
        page += "\n## Parameters\n\n| parameter | value | default | |\n|---|---|---|---|\n";
        for (const ParamSpec& spec : type.params)
            page += fmt::format("| `{}` | {} | `{}` | {} |\n", spec.key, cell(allowed(spec)),
                                cell(to_yaml(spec.initial)), cell(spec.doc + notes(spec)));
    }
    if (!type.method.empty()) page += "\n" + type.method + "\n";
    return page;
}

std::string node_index(const Registry& registry) {
    std::string page =
        "# Nodes\n\nEvery node that voxloom brings. Each page is made from the node's own "
        "description by\n`voxloom nodes --markdown docs/nodes`.\n\n| node | what it does |\n|---|---|\n";
    for (const NodeType* type : registry.all())
        page += fmt::format("| [{}]({}.md) | {} |\n", type->id, type->id, cell(type->doc));
    return page;
}

}  // namespace voxloom::cli
