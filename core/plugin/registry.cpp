#include "core/plugin/registry.h"

#include <algorithm>
#include <set>

namespace voxloom {

const PortSpec* NodeType::find_input(std::string_view key) const {
    for (const PortSpec& port : inputs)
        if (port.key == key) return &port;
    return nullptr;
}

const PortSpec* NodeType::find_output(std::string_view key) const {
    for (const PortSpec& port : outputs)
        if (port.key == key) return &port;
    return nullptr;
}

const ParamSpec* NodeType::find_param(std::string_view key) const {
    for (const ParamSpec& spec : params)
        if (spec.key == key) return &spec;
    return nullptr;
}

namespace {

bool is_name(std::string_view s, bool dots) {
    if (s.empty()) return false;
    for (char c : s)
        if (!((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
              (dots && c == '.')))
            return false;
    return true;
}

std::string problem_with_spec(const NodeType& type, const ParamSpec& spec) {
    if (!is_name(spec.key, false)) return "parameter '" + spec.key + "' is not a lower-case name";
    if (spec.doc.empty()) return "parameter '" + spec.key + "' has no sentence";
    ParamValue initial = spec.initial;
    // A path has no default that exists everywhere; the empty one stands for "not given".
    if (std::string problem = problem_with(spec, initial); !problem.empty())
        return "parameter '" + spec.key + "': its default " + problem;
    if (initial.index() != spec.initial.index())
        return "parameter '" + spec.key + "': its default has another type than the parameter";
    if (!spec.shown_if_key.empty() && !type.find_param(spec.shown_if_key))
        return "parameter '" + spec.key + "' is shown by '" + spec.shown_if_key +
               "', which is not there";
    if (spec.scale == Scale::logarithmic && spec.slider_min <= 0)
        return "parameter '" + spec.key + "': a logarithmic slider must begin above 0";
    return {};
}

}  // namespace

std::string problem_with(const NodeType& type) {
    if (!is_name(type.id, true) || type.id.find('.') == std::string::npos)
        return "its id is not of the form plugin.verb in lower case";
    if (type.title.empty() || type.doc.empty()) return "it has no title or no sentence";
    if (!type.evaluate) return "it has nothing to evaluate";
    std::set<std::string> keys;
    for (const PortSpec& port : type.inputs) {
        if (!is_name(port.key, false) || !keys.insert(port.key).second)
            return "input '" + port.key + "' is not a name or stands twice";
        if (port.types == PortTypes()) return "input '" + port.key + "' accepts nothing";
    }
    keys.clear();
    for (const PortSpec& port : type.outputs) {
        if (!is_name(port.key, false) || !keys.insert(port.key).second)
            return "output '" + port.key + "' is not a name or stands twice";
        int types = 0;
        for (int i = 0; i < kPortTypes; ++i) types += port.types.has(PortType(i));
        if (types != 1) return "output '" + port.key + "' must have exactly one type";
    }
    keys.clear();
    for (const ParamSpec& spec : type.params) {
        if (!keys.insert(spec.key).second) return "parameter '" + spec.key + "' stands twice";
        if (std::string problem = problem_with_spec(type, spec); !problem.empty()) return problem;
    }
    return {};
}

void Registry::add(NodeType type) {
    if (std::string problem = problem_with(type); !problem.empty())
        fail("{}: node type '{}' is described wrongly: {}", origin_, type.id, problem);
    if (auto it = types_.find(type.id); it != types_.end())
        fail("node type '{}' is offered twice, by {} and by {}; remove one of the two plugins",
             type.id, it->second.origin, origin_);
    ids_.insert(std::lower_bound(ids_.begin(), ids_.end(), type.id), type.id);
    std::string id = type.id;
    types_.emplace(std::move(id), Entry{std::move(type), origin_});
}

const NodeType* Registry::find(std::string_view id) const {
    auto it = types_.find(id);
    return it == types_.end() ? nullptr : &it->second.type;
}

std::vector<const NodeType*> Registry::all() const {
    std::vector<const NodeType*> types;
    for (const auto& [id, entry] : types_) types.push_back(&entry.type);
    return types;
}

const std::string& Registry::origin(std::string_view id) const {
    return types_.find(id)->second.origin;
}

}  // namespace voxloom
