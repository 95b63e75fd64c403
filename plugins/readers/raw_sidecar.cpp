#include "raw_sidecar.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <bit>
#include <cmath>
#include <set>

#include "core/base/error.h"
#include "core/base/text.h"
#include "loaded.h"
#include "stored.h"
#include "text_header.h"
#include "volume_file.h"

namespace voxloom {

namespace fs = std::filesystem;

namespace {

const std::vector<std::string> kKeys = {
    "dims", "type", "endianness", "components", "color", "spacing", "origin", "direction", "unit",
    "name", "significant_bits", "offset", "compression", "file", "times", "time_unit"};

// One value of the sidecar, and where it stands.
struct Entry {
    YAML::Node node;
    const fs::path& path;
    std::string key;

    template <class... Args>
    [[noreturn]] void wrong(fmt::format_string<Args...> format, Args&&... args) const {
        fail("{}:{}: {} {}", path.string(), node.Mark().line + 1, key,
             fmt::format(format, std::forward<Args>(args)...));
    }
    std::string text() const {
        if (!node.IsScalar()) wrong("must be a text");
        return node.Scalar();
    }
    double number(const YAML::Node& n) const {
        double v = 0;
        if (!n.IsScalar() || !parse_number(n.Scalar(), v) || !std::isfinite(v))
            wrong("must hold finite numbers only");
        return v;
    }
    std::int64_t integer(const YAML::Node& n, std::int64_t lo, std::int64_t hi) const {
        std::int64_t v = 0;
        if (!n.IsScalar() || !parse_integer(n.Scalar(), v) || v < lo || v > hi)
            wrong("must be a whole number from {} to {}", lo, hi);
        return v;
    }
    std::vector<double> numbers(std::size_t count) const {
        if (!node.IsSequence() || (count && node.size() != count))
            wrong("must be a list of {}numbers", count ? std::to_string(count) + " " : "");
        std::vector<double> v;
        for (const YAML::Node& n : node) v.push_back(number(n));
        return v;
    }
    std::string choice(const std::vector<std::string>& choices) const {
        std::string t = text();
        for (const std::string& c : choices)
            if (c == t) return t;
        wrong("'{}' is not one of {}{}", t, join(choices, ", "), did_you_mean(t, choices));
    }
};

YAML::Node load_yaml(std::string_view yaml, const fs::path& path) {
    YAML::Node root;
    try {
        root = YAML::Load(std::string(yaml));
    } catch (const YAML::Exception& e) {
        fail("{}:{}: not YAML: {}", path.string(), e.mark.line + 1, e.msg);
    }
    if (!root.IsMap())
        fail("{}: it describes no raw voxels; write dims, type and endianness into it as "
             "'key: value' lines", path.string());
    std::set<std::string> met;
    for (const auto& pair : root) {
        const int line = pair.first.Mark().line + 1;
        std::string key = pair.first.IsScalar() ? pair.first.Scalar() : "";
        if (std::find(kKeys.begin(), kKeys.end(), key) == kKeys.end())
            fail("{}:{}: unknown key '{}'{}; known: {}", path.string(), line, key,
                 did_you_mean(key, kKeys), join(kKeys, ", "));
        if (!met.insert(key).second)
            fail("{}:{}: key '{}' stands twice; remove one", path.string(), line, key);
    }
    return root;
}

}  // namespace

RawSidecar parse_raw_sidecar(std::string_view yaml, const fs::path& path) {
    const YAML::Node root = load_yaml(yaml, path);
    auto entry = [&](const char* key) { return Entry{root[key], path, key}; };
    auto has = [&](const char* key) { return bool(root[key]); };
    for (const char* key : {"dims", "type"})
        if (!has(key)) fail("{}: {} is missing; add '{}: {}'", path.string(), key, key,
                            key == std::string_view("dims") ? "[256, 256, 128]" : "u16");

    RawSidecar raw;
    VolumeDesc& desc = raw.desc;
    const Entry dims = entry("dims");
    if (!dims.node.IsSequence() || dims.node.size() < 1 || dims.node.size() > 4)
        dims.wrong("must be a list of the voxels along x, y and z, and of time steps if there are any");
    desc.dims = Index3(1);
    for (std::size_t a = 0; a < dims.node.size(); ++a) {
        std::int64_t n = dims.integer(dims.node[a], a < 3 ? 0 : 1,
                                      a < 3 ? std::int64_t(1) << 48 : kMostSteps);
        (a < 3 ? desc.dims[int(a)] : raw.steps) = n;
    }

    std::vector<std::string> types;
    for (int t = 0; t < kScalarTypes; ++t) types.emplace_back(name_of(ScalarType(t)));
    desc.type = *scalar_type_named(entry("type").choice(types));
    if (has("endianness")) raw.big_endian = entry("endianness").choice({"little", "big"}) == "big";
    else if (bytes_of(desc.type) > 1)
        fail("{}: endianness is missing; add 'endianness: little' or 'endianness: big'",
             path.string());

    if (has("components")) desc.components = int(entry("components").integer(root["components"], 1, 4));
    if (has("color")) {
        desc.color = entry("color").choice({"true", "false"}) == "true";
        if (desc.color && desc.components < 3) entry("color").wrong("needs 3 or 4 components");
    }
    if (checked_product(desc.dims, desc.voxel_bytes(), path.string()) >
        std::uint64_t(std::numeric_limits<std::int64_t>::max()) / std::uint64_t(raw.steps))
        dims.wrong("ask for more bytes than fit in 63 bits");

    glm::dvec3 spacing(1), origin(0);
    glm::dmat3 direction(1);
    if (has("spacing")) {
        auto v = entry("spacing").numbers(3);
        spacing = {v[0], v[1], v[2]};
    }
    if (has("origin")) {
        auto v = entry("origin").numbers(3);
        origin = {v[0], v[1], v[2]};
    }
    if (has("direction")) {
        auto v = entry("direction").numbers(9);
        for (int i = 0; i < 9; ++i) direction[i / 3][i % 3] = v[std::size_t(i)];
    }
    desc.index_to_world = world_matrix(direction, spacing, origin, raw.warnings);
    if (has("unit")) desc.unit = entry("unit").text();
    if (has("name")) desc.name = entry("name").text();
    if (has("significant_bits"))
        desc.significant_bits = int(entry("significant_bits").integer(
            root["significant_bits"], 0, std::int64_t(8 * bytes_of(desc.type))));
    if (has("offset"))
        raw.offset = std::uint64_t(entry("offset").integer(root["offset"], 0, std::int64_t(1) << 62));
    if (has("compression")) raw.gzip = entry("compression").choice({"none", "gzip"}) == "gzip";
    if (has("file")) raw.file = entry("file").text();
    if (has("times")) {
        raw.times = entry("times").numbers(std::size_t(raw.steps));
        for (std::size_t i = 1; i < raw.times.size(); ++i)
            if (raw.times[i] <= raw.times[i - 1]) entry("times").wrong("must increase");
    }
    if (has("time_unit")) raw.time_unit = entry("time_unit").text();
    return raw;
}

VolumeFile open_raw(const fs::path& path) {
    const bool is_sidecar = lower(path.extension().string()) == ".yaml" ||
                            lower(path.extension().string()) == ".yml";
    const fs::path sidecar = is_sidecar ? path : fs::path(path.string() + ".yaml");
    if (!fs::exists(sidecar))
        fail("{} holds raw voxels and needs a description; write dims, type and endianness into {}",
             path.string(), sidecar.string());
    RawSidecar raw = parse_raw_sidecar(read_head(sidecar, kMostHeader), sidecar);
    fs::path data = !raw.file.empty() ? sidecar.parent_path() / raw.file
                    : is_sidecar      ? fs::path(sidecar).replace_extension()
                                      : path;
    if (raw.desc.name.empty()) raw.desc.name = stem_of(data);

    StoredVoxels stored;
    stored.pieces = {{data, raw.gzip ? 0 : raw.offset}};
    stored.packed = raw.gzip;
    stored.skip = raw.gzip ? raw.offset : 0;
    stored.exact = true;
    stored.samples.swap = raw.big_endian != (std::endian::native == std::endian::big);

    VolumeFile file;
    file.format = "raw";
    file.desc = raw.desc;
    file.steps = raw.steps;
    file.times = raw.times;
    file.time_unit = raw.time_unit;
    file.warnings = raw.warnings;
    file.files = {sidecar};
    serve_stored(file, std::move(stored));
    return file;
}

}  // namespace voxloom
