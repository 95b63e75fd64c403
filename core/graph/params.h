// Parameters: their descriptions, and a set of checked values.
#pragma once

#include <filesystem>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/base/hash.h"
#include "core/base/types.h"

namespace voxloom {

enum class ParamKind {
    boolean,    // bool
    integer,    // int64
    real,       // double
    text,       // string
    choice,     // string, one of ParamSpec::choices
    path_in,    // string: an existing file or folder, relative to the graph's folder
    path_out,   // string: a file to write, relative to the output folder
    vector,     // reals, exactly ParamSpec::length of them
    color,      // 3 reals, 0 to 1
    list,       // reals, any number of them
    rows,       // rows of reals (control points), each of ParamSpec::length, or of any length if 0
    texts,      // strings
};
using Rows = std::vector<std::vector<double>>;
using ParamValue = std::variant<bool, std::int64_t, double, std::string, std::vector<double>, Rows,
                                std::vector<std::string>>;

enum class Affects { output, cost, display };  // what changing it changes
enum class Scale { linear, logarithmic };

struct ParamSpec {
    std::string key;      // lower-case words with underscores
    ParamKind kind = ParamKind::real;
    ParamValue initial;   // the default
    std::string doc;      // one sentence
    double min = -std::numeric_limits<double>::infinity();  // hard range, per number, inclusive
    double max = std::numeric_limits<double>::infinity();
    double slider_min = 0, slider_max = 0;                  // equal: no slider
    Scale scale = Scale::linear;
    std::string unit;
    std::vector<std::string> choices;
    std::size_t length = 0;   // of vectors and rows
    bool integral = false;    // vectors whose numbers must be whole
    std::string group;
    std::string shown_if_key;                    // shown only while that parameter ...
    std::vector<std::string> shown_if_values;    // ... has one of these values (as text)
    Affects affects = Affects::output;
    bool expert = false;
    bool quality = false;     // a knob that trades speed for error

    ParamSpec& range(double lo, double hi) { min = lo; max = hi; return *this; }
    ParamSpec& slider(double lo, double hi, Scale s = Scale::linear) {
        slider_min = lo; slider_max = hi; scale = s; return *this;
    }
    ParamSpec& in_unit(std::string u) { unit = std::move(u); return *this; }
    ParamSpec& in_group(std::string g) { group = std::move(g); return *this; }
    ParamSpec& shown_if(std::string k, std::vector<std::string> values) {
        shown_if_key = std::move(k); shown_if_values = std::move(values); return *this;
    }
    ParamSpec& changes(Affects a) { affects = a; return *this; }
    ParamSpec& for_experts() { expert = true; return *this; }
    ParamSpec& is_quality() { quality = true; return *this; }
    ParamSpec& whole() { integral = true; return *this; }
};

namespace param {
ParamSpec boolean(std::string key, bool initial, std::string doc);
ParamSpec integer(std::string key, std::int64_t initial, std::string doc);
ParamSpec real(std::string key, double initial, std::string doc);
ParamSpec text(std::string key, std::string initial, std::string doc);
ParamSpec choice(std::string key, std::vector<std::string> choices, std::string initial,
                 std::string doc);
ParamSpec path_in(std::string key, std::string doc);
ParamSpec path_out(std::string key, std::string initial, std::string doc);
ParamSpec vector(std::string key, std::vector<double> initial, std::string doc);
ParamSpec color(std::string key, std::vector<double> initial, std::string doc);
ParamSpec list(std::string key, std::vector<double> initial, std::string doc);
ParamSpec rows(std::string key, std::size_t length, Rows initial, std::string doc);
ParamSpec texts(std::string key, std::vector<std::string> initial, std::string doc);
}  // namespace param

std::string_view name_of(ParamKind kind);  // "boolean", "integer", ...
// Why `value` is not one for `spec` ("must be between 0 and 1, not 2"), or empty when it is.
// An integer given for a real is converted in place; so is a real that is whole for an integer.
std::string problem_with(const ParamSpec& spec, ParamValue& value);
// YAML text of a value, in one line, numbers in their shortest exact form: "[1, 0.5]", "'a b'".
std::string to_yaml(const ParamValue& value);

// The values of all of a node's parameters, defaults filled in. Asking for a key or a type that the
// node's description does not have is a programming mistake (assert).
class Params {
  public:
    Params() = default;
    Params(const std::vector<ParamSpec>& specs, std::filesystem::path base_folder);
    void set(const std::string& key, ParamValue value);  // key must exist, value must have passed problem_with()

    bool boolean(std::string_view key) const;
    std::int64_t integer(std::string_view key) const;
    double real(std::string_view key) const;
    const std::string& text(std::string_view key) const;  // text and choice
    // path_in made absolute from the graph's folder; path_out as given (see Evaluation::output_path).
    std::filesystem::path path(std::string_view key) const;
    const std::vector<double>& numbers(std::string_view key) const;  // vector, color, list
    const Rows& rows(std::string_view key) const;
    const std::vector<std::string>& texts(std::string_view key) const;
    glm::dvec3 vec3(std::string_view key) const;
    Index3 index3(std::string_view key) const;
    glm::ivec2 size2(std::string_view key) const;
    bool was_set(std::string_view key) const;  // given by the user, whatever its value

    const ParamValue& value(std::string_view key) const;
    const std::vector<ParamSpec>& specs() const { return *specs_; }
    // Feeds the parameters that affect the output.
    void hash_into(Hasher& hasher) const;

  private:
    struct Entry {
        ParamValue value;
        bool set = false;
    };
    const std::vector<ParamSpec>* specs_ = nullptr;
    std::map<std::string, Entry, std::less<>> entries_;
    std::filesystem::path base_folder_;
};

}  // namespace voxloom
