#include "core/graph/params.h"

#include <fmt/format.h>

#include <cassert>
#include <cmath>

#include "core/base/text.h"

namespace voxloom {

namespace param {
namespace {
ParamSpec make(ParamKind kind, std::string key, ParamValue initial, std::string doc) {
    ParamSpec spec;
    spec.kind = kind;
    spec.key = std::move(key);
    spec.initial = std::move(initial);
    spec.doc = std::move(doc);
    return spec;
}
}  // namespace

ParamSpec boolean(std::string key, bool initial, std::string doc) {
    return make(ParamKind::boolean, std::move(key), initial, std::move(doc));
}
ParamSpec integer(std::string key, std::int64_t initial, std::string doc) {
    return make(ParamKind::integer, std::move(key), initial, std::move(doc));
}
ParamSpec real(std::string key, double initial, std::string doc) {
    return make(ParamKind::real, std::move(key), initial, std::move(doc));
}
ParamSpec text(std::string key, std::string initial, std::string doc) {
    return make(ParamKind::text, std::move(key), std::move(initial), std::move(doc));
}
ParamSpec choice(std::string key, std::vector<std::string> choices, std::string initial,
                 std::string doc) {
    ParamSpec spec = make(ParamKind::choice, std::move(key), std::move(initial), std::move(doc));
    spec.choices = std::move(choices);
    return spec;
}
ParamSpec path_in(std::string key, std::string doc) {
    return make(ParamKind::path_in, std::move(key), std::string(), std::move(doc));
}
ParamSpec path_out(std::string key, std::string initial, std::string doc) {
    return make(ParamKind::path_out, std::move(key), std::move(initial), std::move(doc));
}
ParamSpec vector(std::string key, std::vector<double> initial, std::string doc) {
    std::size_t n = initial.size();
    ParamSpec spec = make(ParamKind::vector, std::move(key), std::move(initial), std::move(doc));
    spec.length = n;
    return spec;
}
ParamSpec color(std::string key, std::vector<double> initial, std::string doc) {
    ParamSpec spec = make(ParamKind::color, std::move(key), std::move(initial), std::move(doc));
    spec.length = 3;
    return spec.range(0, 1);
}
ParamSpec list(std::string key, std::vector<double> initial, std::string doc) {
    return make(ParamKind::list, std::move(key), std::move(initial), std::move(doc));
}
ParamSpec rows(std::string key, std::size_t length, Rows initial, std::string doc) {
    ParamSpec spec = make(ParamKind::rows, std::move(key), std::move(initial), std::move(doc));
    spec.length = length;
    return spec;
}
ParamSpec texts(std::string key, std::vector<std::string> initial, std::string doc) {
    return make(ParamKind::texts, std::move(key), std::move(initial), std::move(doc));
}
}  // namespace param

std::string_view name_of(ParamKind kind) {
    constexpr std::string_view names[] = {"boolean",  "integer",  "real",   "text",
                                          "choice",   "path_in",  "path_out", "vector",
                                          "color",    "list",     "rows",   "texts"};
    return names[std::size_t(kind)];
}

namespace {

std::string problem_with_number(const ParamSpec& spec, double v) {
    if (std::isnan(v)) return "must be a number, not .nan";
    if (v < spec.min || v > spec.max) {
        if (std::isinf(spec.max)) return fmt::format("must be at least {}, not {}", shortest(spec.min), shortest(v));
        if (std::isinf(spec.min)) return fmt::format("must be at most {}, not {}", shortest(spec.max), shortest(v));
        return fmt::format("must be between {} and {}, not {}", shortest(spec.min),
                           shortest(spec.max), shortest(v));
    }
    if (spec.integral && v != std::floor(v)) return fmt::format("must be whole, not {}", shortest(v));
    return {};
}

std::string problem_with_numbers(const ParamSpec& spec, const std::vector<double>& numbers) {
    if (spec.length && numbers.size() != spec.length)
        return fmt::format("must have {} numbers, not {}", spec.length, numbers.size());
    for (double v : numbers)
        if (std::string problem = problem_with_number(spec, v); !problem.empty()) return problem;
    return {};
}

template <class T>
std::string must_be(const ParamValue& value, std::string_view what) {
    return std::holds_alternative<T>(value) ? "" : fmt::format("must be {}", what);
}

}  // namespace

std::string problem_with(const ParamSpec& spec, ParamValue& value) {
    switch (spec.kind) {
        case ParamKind::boolean: return must_be<bool>(value, "true or false");
        case ParamKind::integer: {
            if (auto* d = std::get_if<double>(&value); d && *d == std::floor(*d) && std::abs(*d) < 9e15)
                value = std::int64_t(*d);
            auto* i = std::get_if<std::int64_t>(&value);
            return i ? problem_with_number(spec, double(*i)) : "must be a whole number";
        }
        case ParamKind::real: {
            if (auto* i = std::get_if<std::int64_t>(&value)) value = double(*i);
            auto* d = std::get_if<double>(&value);
            return d ? problem_with_number(spec, *d) : "must be a number";
        }
        case ParamKind::choice: {
            auto* s = std::get_if<std::string>(&value);
            if (!s) return "must be one of " + join(spec.choices, ", ");
            for (const std::string& c : spec.choices)
                if (c == *s) return {};
            return fmt::format("'{}' is not one of {}{}", *s, join(spec.choices, ", "),
                               did_you_mean(*s, spec.choices));
        }
        case ParamKind::text:
        case ParamKind::path_in:
        case ParamKind::path_out: return must_be<std::string>(value, "text");
        case ParamKind::vector:
        case ParamKind::color:
        case ParamKind::list: {
            auto* v = std::get_if<std::vector<double>>(&value);
            return v ? problem_with_numbers(spec, *v) : "must be a list of numbers";
        }
        case ParamKind::rows: {
            auto* rows = std::get_if<Rows>(&value);
            if (!rows) return "must be a list of lists of numbers";
            for (const auto& row : *rows)
                if (std::string problem = problem_with_numbers(spec, row); !problem.empty())
                    return "each row " + problem;
            return {};
        }
        case ParamKind::texts:
            return must_be<std::vector<std::string>>(value, "a list of texts");
    }
    return "unknown kind";
}

namespace {

// A text is written plain only where YAML cannot take it for anything else.
std::string yaml_text(const std::string& s) {
    bool plain = !s.empty() && (std::isalpha(static_cast<unsigned char>(s[0])) || s[0] == '_' ||
                                s[0] == '/');
    for (char c : s)
        plain = plain && (std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-' ||
                          c == '.' || c == '/');
    std::string lower = s;
    for (char& c : lower) c = char(std::tolower(static_cast<unsigned char>(c)));
    for (std::string_view word : {"true", "false", "yes", "no", "on", "off", "null", "y", "n"})
        plain = plain && lower != word;
    if (plain) return s;
    std::string quoted = "\"";
    for (char c : s) {
        if (c == '"' || c == '\\')
            quoted += std::string("\\") + c;
        else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f)
            quoted += fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
        else
            quoted += c;
    }
    return quoted + "\"";
}

std::string yaml_list(const std::vector<double>& numbers) {
    std::string text = "[";
    for (std::size_t i = 0; i < numbers.size(); ++i)
        text += (i ? ", " : "") + shortest(numbers[i]);
    return text + "]";
}

}  // namespace

std::string to_yaml(const ParamValue& value) {
    if (auto* b = std::get_if<bool>(&value)) return *b ? "true" : "false";
    if (auto* i = std::get_if<std::int64_t>(&value)) return std::to_string(*i);
    if (auto* d = std::get_if<double>(&value)) return shortest(*d);
    if (auto* s = std::get_if<std::string>(&value)) return yaml_text(*s);
    if (auto* v = std::get_if<std::vector<double>>(&value)) return yaml_list(*v);
    std::string text = "[";
    if (auto* rows = std::get_if<Rows>(&value)) {
        for (std::size_t i = 0; i < rows->size(); ++i) text += (i ? ", " : "") + yaml_list((*rows)[i]);
    } else {
        auto& texts = std::get<std::vector<std::string>>(value);
        for (std::size_t i = 0; i < texts.size(); ++i) text += (i ? ", " : "") + yaml_text(texts[i]);
    }
    return text + "]";
}

Params::Params(const std::vector<ParamSpec>& specs, std::filesystem::path base_folder)
    : specs_(&specs), base_folder_(std::move(base_folder)) {
    for (const ParamSpec& spec : specs) entries_.emplace(spec.key, Entry{spec.initial, false});
}

void Params::set(const std::string& key, ParamValue value) {
    auto it = entries_.find(key);
    assert(it != entries_.end());
    it->second = {std::move(value), true};
}

const ParamValue& Params::value(std::string_view key) const {
    auto it = entries_.find(key);
    assert(it != entries_.end() && "no such parameter in the node's description");
    return it->second.value;
}

bool Params::was_set(std::string_view key) const { return entries_.find(key)->second.set; }
bool Params::boolean(std::string_view key) const { return std::get<bool>(value(key)); }
std::int64_t Params::integer(std::string_view key) const { return std::get<std::int64_t>(value(key)); }
double Params::real(std::string_view key) const { return std::get<double>(value(key)); }
const std::string& Params::text(std::string_view key) const { return std::get<std::string>(value(key)); }
const std::vector<double>& Params::numbers(std::string_view key) const {
    return std::get<std::vector<double>>(value(key));
}
const Rows& Params::rows(std::string_view key) const { return std::get<Rows>(value(key)); }
const std::vector<std::string>& Params::texts(std::string_view key) const {
    return std::get<std::vector<std::string>>(value(key));
}

std::filesystem::path Params::path(std::string_view key) const {
    std::filesystem::path given = text(key);
    for (const ParamSpec& spec : *specs_)
        if (spec.key == key && spec.kind == ParamKind::path_in && !given.empty() && given.is_relative())
            return (base_folder_ / given).lexically_normal();
    return given;
}

glm::dvec3 Params::vec3(std::string_view key) const {
    const auto& v = numbers(key);
    assert(v.size() == 3);
    return {v[0], v[1], v[2]};
}

Index3 Params::index3(std::string_view key) const { return Index3(vec3(key)); }

glm::ivec2 Params::size2(std::string_view key) const {
    const auto& v = numbers(key);
    assert(v.size() == 2);
    return {int(v[0]), int(v[1])};
}

void Params::hash_into(Hasher& hasher) const {
    for (const ParamSpec& spec : *specs_)
        if (spec.affects == Affects::output) {
            hasher.text(spec.key);
            // A path stands for what it names, wherever the graph lies.
            hasher.text(spec.kind == ParamKind::path_in ? path(spec.key).string()
                                                        : to_yaml(value(spec.key)));
        }
}

}  // namespace voxloom
