#include "app/editor/model/param_values.h"

#include <algorithm>
#include <cmath>

namespace voxloom::editor {

const GraphParam* find_param(const GraphNode& node, std::string_view key) {
    const auto found = std::ranges::find(node.params, key, &GraphParam::key);
    return found == node.params.end() ? nullptr : &*found;
}

ParamValue value_of(const GraphNode& node, const ParamSpec& spec) {
    std::string reason;
    const GraphParam* param = find_param(node, spec.key);
    std::optional<ParamValue> value = param ? parse_param(spec, param->yaml, reason) : std::nullopt;
    if (!value) return spec.initial;
    problem_with(spec, *value);  // a whole number that stands for a real becomes one
    return *value;
}

bool is_in_use(const GraphNode& node, const NodeType& type, const ParamSpec& spec) {
    const ParamSpec* other = spec.shown_if_key.empty() ? nullptr : type.find_param(spec.shown_if_key);
    if (!other) return true;
    const ParamValue value = value_of(node, *other);
    const auto* text = std::get_if<std::string>(&value);
    const std::string now = text ? *text : to_yaml(value);
    return std::ranges::find(spec.shown_if_values, now) != spec.shown_if_values.end();
}

double short_number(double v) {
    if (v == 0 || !std::isfinite(v)) return v;
    const double unit = std::pow(10, std::floor(std::log10(std::abs(v))) - 5);
    // Dividing by a whole number where there is one gives the nearest double to the decimal.
    return unit < 1 ? std::round(v / unit) / std::round(1 / unit) : std::round(v / unit) * unit;
}

}  // namespace voxloom::editor
