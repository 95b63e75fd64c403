// Draws the pictures of a graph, again and again, and hands everything to the Python benchmarks as
// NumPy arrays and one JSON text.
//
//     bench-pictures GRAPH OUT [--repeat N] [--warm-up N] [--time NODE]...
//
// The graph's wanted outputs are evaluated once, so that readers and scene nodes are in the cache.
// Each node named by --time is then evaluated alone, again and again, as when somebody turns one of
// its knobs. What is written:
//
//     OUT/NODE.PORT.npy   a volume's voxels [z, y, x(, component)], a picture [y, x, rgba] float32
//     standard output     {"values": {"NODE.PORT": ...}, "times": {"NODE": {"wall": [s...],
//     "draw": [s...], "cpu": [s...]}}}
//
// "cpu" is the processor time of all threads: on a machine that others use too, it is the steadier one.
#include <fmt/core.h>

#include <bit>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/base/text.h"
#include "core/graph/evaluate.h"
#include "core/plugin/loader.h"

namespace fs = std::filesystem;
using nlohmann::json;

namespace voxloom {

namespace {

static_assert(std::endian::native == std::endian::little);

struct Options {
    fs::path graph, out;
    int repeat = 9, warm_up = 2;
    std::vector<std::string> timed;
};

Options options_of(int argc, char** argv) {
    Options options;
    std::vector<std::string> words(argv + 1, argv + argc), plain;
    for (std::size_t i = 0; i < words.size(); ++i) {
        if (!words[i].starts_with("--")) {
            plain.push_back(words[i]);
            continue;
        }
        if (i + 1 == words.size()) fail("{} needs a value", words[i]);
        const std::string &name = words[i], &value = words[++i];
        std::int64_t count = 0;
        if (name == "--time")
            options.timed.push_back(value);
        else if ((name == "--repeat" || name == "--warm-up") && parse_integer(value, count) &&
                 count >= 0)
            (name == "--repeat" ? options.repeat : options.warm_up) = int(count);
        else
            fail("{} {} is not understood; known are --repeat N, --warm-up N and --time NODE", name,
                 value);
    }
    if (plain.size() != 2) fail("give a graph and an output folder: bench-pictures GRAPH OUT");
    options.graph = plain[0];
    options.out = plain[1];
    return options;
}

// NumPy's format: magic, version, padded header, C order.
void write_npy(const fs::path& file, std::string_view type, const std::vector<std::int64_t>& shape,
               std::span<const std::byte> data) {
    std::string dims;
    for (std::int64_t n : shape) dims += fmt::format("{}, ", n);
    std::string header =
        fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({}), }}", type, dims);
    header.append(63 - (10 + header.size()) % 64, ' ');
    header += '\n';
    std::ofstream out(file, std::ios::binary);
    out.write("\x93NUMPY\x01\x00", 8);
    const char size[2] = {char(header.size() & 255), char(header.size() >> 8)};
    out.write(size, 2).write(header.data(), std::streamsize(header.size()));
    out.write(reinterpret_cast<const char*>(data.data()), std::streamsize(data.size()));
    if (!out.flush()) fail("{} cannot be written", file.string());
}

std::string numpy_type(ScalarType type) {
    const std::string_view name = name_of(type);  // "u8": unsigned, 8 bits
    return fmt::format("{}{}{}", bytes_of(type) == 1 ? "|" : "<", name[0], bytes_of(type));
}

json list(glm::dvec3 v) {
    return {v.x, v.y, v.z};
}

json exported(const VolumePtr& given, const fs::path& file) {
    const VolumePtr volume = in_memory(given);
    const VolumeDesc& d = volume->desc();
    std::vector<std::int64_t> shape = {d.dims.z, d.dims.y, d.dims.x};
    if (d.components > 1) shape.push_back(d.components);
    write_npy(file, numpy_type(d.type), shape, {volume->data(), d.dense_bytes()});
    json matrix = json::array();
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 4; ++column) matrix.push_back(d.index_to_world[column][row]);
    const ValueRange range = value_range(*volume);
    return {{"file", file.string()}, {"index_to_world", matrix}, {"range", {range.min, range.max}}};
}

json exported(const ImagePtr& image, const fs::path& file) {
    const glm::ivec2 size = image->size();
    std::vector<glm::vec4> pixels;
    for (int y = 0; y < size.y; ++y)
        for (int x = 0; x < size.x; ++x) pixels.push_back(image->at(x, y));
    write_npy(file, "<f4", {size.y, size.x, 4}, std::as_bytes(std::span<const glm::vec4>(pixels)));
    return {{"file", file.string()}};
}

// Control points: [value, tau, tau * red, tau * green, tau * blue].
json exported(const TransferPtr& transfer) {
    json points = json::array();
    for (const TransferFunction1D::Point& p : transfer->one.points)
        points.push_back({p.value, p.emission.a, p.emission.r, p.emission.g, p.emission.b});
    return {{"points", points}, {"reference_length", transfer->reference_length}};
}

json exported(const CameraPtr& camera) {
    return {{"eye", list(camera->eye)},
            {"target", list(camera->target)},
            {"up", list(camera->true_up())},
            {"vertical_fov", camera->vertical_fov},
            {"height", camera->height},
            {"near", camera->near},
            {"perspective", camera->projection == Camera::Projection::perspective}};
}

json exported(const Value& value, const fs::path& file) {
    if (auto* volume = std::get_if<VolumePtr>(&value)) return exported(*volume, file);
    if (auto* image = std::get_if<ImagePtr>(&value)) return exported(*image, file);
    if (auto* transfer = std::get_if<TransferPtr>(&value)) return exported(*transfer);
    if (auto* camera = std::get_if<CameraPtr>(&value)) return exported(*camera);
    return nullptr;
}

RunResult run(const Plan& plan, ResultCache& cache, const RunOptions& options) {
    RunResult result = evaluate(plan, cache, options);
    for (const NodeReport& node : result.nodes)
        if (node.state == NodeState::failed) fail("node '{}': {}", node.id, node.error);
    if (!result.ok) fail("{} could not be evaluated", plan.file.string());
    return result;
}

json times_of(const Plan& plan, const std::string& id, ResultCache& cache, const Options& options) {
    const int node = plan.find(id);
    if (node < 0) fail("there is no node '{}' in {}", id, options.graph.string());
    RunOptions only;
    only.output_folder = options.out;
    only.wanted = {{node, 0}};
    only.again = {node};
    json wall = json::array(), draw = json::array(), cpu = json::array();
    for (int k = -options.warm_up; k < options.repeat; ++k) {
        const std::clock_t start = std::clock();
        const RunResult result = run(plan, cache, only);
        if (k < 0) continue;
        cpu.push_back(double(std::clock() - start) / CLOCKS_PER_SEC);
        wall.push_back(result.nodes[std::size_t(node)].wall_seconds);
        draw.push_back(result.nodes[std::size_t(node)].draw_seconds);
    }
    return {{"wall", wall}, {"draw", draw}, {"cpu", cpu}};
}

void draw_pictures(const Options& options) {
    Registry registry;
    for (const std::string& problem : load_plugins(registry).problems)
        fmt::print(stderr, "{}\n", problem);
    const Document document = Document::load(options.graph);
    const Plan plan = check(document.graph(), registry);
    for (const Problem& problem : plan.problems)
        fmt::print(stderr, "{}\n", problem.text(plan.file));
    if (!plan.problems.empty()) fail("{} has problems", options.graph.string());

    fs::create_directories(options.out);
    ResultCache cache;
    RunOptions once;
    once.output_folder = options.out;
    const RunResult result = run(plan, cache, once);
    json values = json::object(), times = json::object();
    for (std::size_t i = 0; i < plan.wanted.size(); ++i) {
        const Plan::Node& node = plan.nodes[std::size_t(plan.wanted[i].node)];
        const std::string name =
            node.id + "." + node.type->outputs[std::size_t(plan.wanted[i].output)].key;
        values[name] = exported(result.outputs[i], fs::absolute(options.out) / (name + ".npy"));
    }
    for (const std::string& id : options.timed) times[id] = times_of(plan, id, cache, options);
    fmt::print("{}\n", json{{"values", values}, {"times", times}}.dump());
}

}  // namespace

}  // namespace voxloom

int main(int argc, char** argv) {
    try {
        voxloom::draw_pictures(voxloom::options_of(argc, argv));
        return 0;
    } catch (const std::exception& e) {
        fmt::print(stderr, "bench-pictures: {}\n", e.what());
        return 1;
    }
}
