#include "tests/support/fake_nodes.h"

#include <chrono>
#include <fstream>
#include <thread>

#include "core/base/error.h"

namespace voxloom::testing {

namespace {

VolumeDesc cube(std::int64_t size, ScalarType type) {
    VolumeDesc desc;
    desc.dims = Index3(size);
    desc.type = type;
    return desc;
}

VolumePtr filled(const VolumeDesc& desc, double value) {
    Buffer voxels(desc.dense_bytes(), "a fake volume");
    with_type(desc.type, [&](auto t) {
        using T = decltype(t);
        for (T& v : voxels.as<T>()) v = T(value);
    });
    return std::make_shared<DenseVolume>(desc, std::move(voxels));
}

double first_voxel(const Volume& volume) {
    if (volume.desc().voxels() == 0) return 0;
    Buffer voxel(volume.desc().voxel_bytes());
    volume.read({Index3(0), Index3(1)}, voxel.bytes());
    return with_type(volume.desc().type,
                     [&](auto t) { return double(voxel.as<decltype(t)>()[0]); });
}

// Every fake volume is constant, so its first voxel is all there is to compute.
VolumePtr sum_of(const std::vector<Value>& volumes) {
    double sum = 0;
    for (const Value& v : volumes) sum += first_voxel(*std::get<VolumePtr>(v));
    return filled(std::get<VolumePtr>(volumes.front())->desc(), sum);
}

void same_shape(Description& d, const ValueDesc& a, const ValueDesc& b, std::string_view where) {
    if (a.volume()->dims != b.volume()->dims)
        d.problem("the volumes have different sizes: " + summary(a) + " and " + summary(b), where);
}

NodeType source() {
    NodeType type;
    type.id = "fake.source";
    type.title = "Source";
    type.doc = "A constant cube.";
    type.outputs = {{"volume", PortType::volume, "The cube."}};
    type.params = {param::integer("size", 4, "Voxels along each axis.").range(0, 1e9),
                   param::real("value", 1, "Of every voxel."),
                   param::choice("scalar", {"u8", "f32"}, "f32", "Scalar type."),
                   param::path_in("path", "A file that must exist, where one is given."),
                   param::integer("threads", 0, "Changes nothing but the cost.")
                       .range(0, 64)
                       .changes(Affects::cost)};
    type.describe = [](Description& d) {
        if (d.params().was_set("path") && !std::filesystem::exists(d.params().path("path")))
            d.problem("there is no file " + d.params().path("path").string(), "path");
        d.output("volume",
                 cube(d.params().integer("size"), *scalar_type_named(d.params().text("scalar"))));
    };
    type.evaluate = [](Evaluation& e) {
        e.output("volume", filled(cube(e.params().integer("size"),
                                       *scalar_type_named(e.params().text("scalar"))),
                                  e.params().real("value")));
    };
    return type;
}

NodeType add() {
    NodeType type;
    type.id = "fake.add";
    type.title = "Add";
    type.doc = "Adds a number to every voxel.";
    type.inputs = {{"volume", PortType::volume, "What is added to."}};
    type.outputs = {{"volume", PortType::volume, "The sums."}};
    type.params = {
        param::real("amount", 1, "What is added.").range(-1000, 1000),
        param::real("milliseconds", 0, "Time that it takes.").range(0, 1e6).changes(Affects::cost)};
    type.describe = [](Description& d) { d.output("volume", *d.input("volume")); };
    type.evaluate = [](Evaluation& e) {
        auto volume = e.input<Volume>("volume");
        double total = e.params().real("milliseconds");
        for (double done = 0; done < total; done += 1) {
            check_stop(e.stop());
            e.progress(done / total, "waiting");
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        e.count("additions");
        e.measure("amount", e.params().real("amount"));
        e.output("volume",
                 filled(volume->desc(), first_voxel(*volume) + e.params().real("amount")));
    };
    return type;
}

NodeType sum() {
    NodeType type;
    type.id = "fake.sum";
    type.title = "Sum";
    type.doc = "Adds two volumes.";
    type.inputs = {{"a", PortType::volume, "One."}, {"b", PortType::volume, "The other.", true}};
    type.outputs = {{"volume", PortType::volume, "The sums."}};
    type.describe = [](Description& d) {
        if (d.input("b")) same_shape(d, *d.input("a"), *d.input("b"), "b");
        d.output("volume", *d.input("a"));
    };
    type.evaluate = [](Evaluation& e) {
        auto a = e.input<Volume>("a"), b = e.input<Volume>("b");
        e.output("volume", filled(a->desc(), first_voxel(*a) + (b ? first_voxel(*b) : 0)));
    };
    return type;
}

NodeType gather() {
    NodeType type;
    type.id = "fake.gather";
    type.title = "Gather";
    type.doc = "Adds any number of volumes.";
    type.inputs = {{"volumes", PortType::volume, "What is added.", false, true}};
    type.outputs = {{"volume", PortType::volume, "The sums."}};
    type.describe = [](Description& d) {
        for (const ValueDesc& v : d.inputs("volumes"))
            same_shape(d, d.inputs("volumes").front(), v, "volumes");
        d.output("volume", d.inputs("volumes").front());
    };
    type.evaluate = [](Evaluation& e) { e.output("volume", sum_of(e.values("volumes"))); };
    return type;
}

NodeType table() {
    NodeType type;
    type.id = "fake.table";
    type.title = "Table";
    type.doc = "The first voxel as a table, and a transfer function.";
    type.inputs = {{"source", PortTypes{PortType::volume, PortType::bricks}, "What is measured."}};
    type.outputs = {{"table", PortType::table, "One row."},
                    {"transfer", PortType::transfer, "The default one."}};
    type.evaluate = [](Evaluation& e) {
        auto result = std::make_shared<Table>();
        result->columns = {{"first", ""}};
        result->rows = {{first_voxel(*e.input<Volume>("source"))}};
        e.output("table", TablePtr(result));
        e.output("transfer", std::make_shared<const TransferFunction>());
    };
    return type;
}

NodeType write() {
    NodeType type;
    type.id = "fake.write";
    type.title = "Write";
    type.doc = "Writes the first voxel as text.";
    type.writes_files = true;
    type.inputs = {{"volume", PortType::volume, "What is written."}};
    type.params = {param::path_out("file", "first.txt", "Where it goes.")};
    type.evaluate = [](Evaluation& e) {
        std::ofstream(e.output_path("file")) << first_voxel(*e.input<Volume>("volume")) << "\n";
    };
    return type;
}

NodeType every() {
    NodeType type;
    type.id = "fake.every";
    type.title = "Every kind";
    type.doc = "Has a parameter of every kind.";
    type.outputs = {{"image", PortType::image, "An empty picture."}};
    type.params = {param::boolean("boolean", false, "A boolean."),
                   param::integer("integer", 3, "An integer.").range(-10, 10),
                   param::real("real", 0.5, "A real.").range(0, 1),
                   param::text("text", "", "A text."),
                   param::choice("choice", {"red", "green", "blue"}, "red", "A choice."),
                   param::path_in("path_in", "A file that is read."),
                   param::path_out("path_out", "a.txt", "A file that is written."),
                   param::vector("vector", {8, 8}, "A size.").range(1, 4096).whole(),
                   param::color("color", {1, 1, 1}, "A colour."),
                   param::list("list", {}, "Numbers."),
                   param::rows("rows", 2, {}, "Pairs of numbers."),
                   param::texts("texts", {}, "Texts.")};
    type.describe = [](Description& d) {
        d.output("image", ImageDesc{d.params().size2("vector")});
    };
    type.evaluate = [](Evaluation& e) {
        auto image = std::make_shared<Image>(e.params().size2("vector"), Image::Format::rgba8);
        for (std::byte& b : image->bytes()) b = std::byte(e.params().boolean("boolean") ? 255 : 0);
        e.output("image", ImagePtr(image));
    };
    return type;
}

NodeType failing() {
    NodeType type;
    type.id = "fake.fail";
    type.title = "Fail";
    type.doc = "Always fails.";
    type.inputs = {{"volume", PortType::volume, "Not looked at.", true}};
    type.outputs = {{"volume", PortType::volume, "Never there."}};
    type.params = {param::text("message", "it failed; take another node", "What is said."),
                   param::choice("when", {"evaluate", "describe"}, "evaluate", "When it fails.")};
    type.describe = [](Description& d) {
        if (d.params().text("when") == "describe") fail("{}", d.params().text("message"));
    };
    type.evaluate = [](Evaluation& e) { fail("{}", e.params().text("message")); };
    return type;
}

}  // namespace

void FakeCounts::described(const std::string& type) {
    std::lock_guard lock(mutex_);
    ++described_[type];
}
void FakeCounts::evaluated(const std::string& node) {
    std::lock_guard lock(mutex_);
    ++evaluated_[node];
}
int FakeCounts::descriptions(const std::string& type) const {
    std::lock_guard lock(mutex_);
    auto it = described_.find(type);
    return it == described_.end() ? 0 : it->second;
}
int FakeCounts::evaluations(const std::string& node) const {
    std::lock_guard lock(mutex_);
    auto it = evaluated_.find(node);
    return it == evaluated_.end() ? 0 : it->second;
}
int FakeCounts::evaluations() const {
    std::lock_guard lock(mutex_);
    int sum = 0;
    for (const auto& [node, n] : evaluated_) sum += n;
    return sum;
}
void FakeCounts::clear() {
    std::lock_guard lock(mutex_);
    described_.clear();
    evaluated_.clear();
}

Registry fake_registry(FakeCounts* counts) {
    Registry registry;
    registry.set_origin("tests/support/fake_nodes.cpp");
    for (NodeType type : {source(), add(), sum(), gather(), table(), write(), every(), failing()}) {
        if (counts) {
            if (type.describe)
                type.describe = [counts, id = type.id, inner = type.describe](Description& d) {
                    counts->described(id);
                    inner(d);
                };
            type.evaluate = [counts, inner = type.evaluate](Evaluation& e) {
                counts->evaluated(e.node_id());
                inner(e);
            };
        }
        registry.add(std::move(type));
    }
    return registry;
}

}  // namespace voxloom::testing
