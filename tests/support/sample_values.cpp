#include "tests/support/sample_values.h"

#include <glm/gtc/matrix_transform.hpp>

#include <cmath>

#include "core/base/error.h"
#include "core/data/selection.h"
#include "tests/support/volumes.h"

namespace voxloom::testing {

namespace {

VolumePtr sample_volume(Index3 dims, double time = 0) {
    VolumePtr plain = make_volume(dims, ScalarType::u8, [&](auto x, auto y, auto z) {
        return 120 + 90 * std::sin(0.31 * double(x) + time) * std::cos(0.23 * double(y)) +
               0.7 * double(z);
    });
    VolumeDesc desc = plain->desc();
    desc.index_to_world =
        glm::scale(glm::rotate(glm::dmat4(1.0), 0.4, glm::dvec3(1, 2, 3)), glm::dvec3(1, 1, 2.5));
    desc.unit = "mm";
    desc.name = "sample";
    Buffer voxels(desc.dense_bytes());
    plain->read(Box::of(dims), voxels.bytes(), {});
    return std::make_shared<DenseVolume>(desc, std::move(voxels));
}

// One level, no parents, families of one: the simplest codec there is.
class FlatBricks final : public Bricks {
  public:
    explicit FlatBricks(VolumePtr volume)
        : Bricks(describe_flat(volume->desc())), volume_(std::move(volume)) {}
    BrickInfo info(BrickId) const override {
        BrickInfo info;
        info.range = {0, 255};
        info.exact_error = true;
        return info;
    }
    std::optional<BrickId> parent(BrickId) const override { return std::nullopt; }
    std::vector<DecodedBrick> refine(BrickId id, const BrickVoxels*,
                                     const std::stop_token& stop) const override {
        const Box box = desc().box_of(id);
        auto brick = std::make_shared<BrickVoxels>();
        brick->stored = box.dims();
        brick->voxels = Buffer(box.voxels());
        volume_->read(box, brick->voxels.bytes(), stop);
        return {{id, brick}};
    }

  private:
    static BricksDesc describe_flat(const VolumeDesc& volume) {
        BricksDesc desc;
        desc.volume = volume;
        desc.brick = glm::ivec3(8);
        desc.tree_type = volume.type;
        desc.levels = pyramid_levels(volume, desc.brick, true);
        desc.compressed_bytes = volume.dense_bytes();
        return desc;
    }
    VolumePtr volume_;
};

class SampleSeries final : public Series {
  public:
    SampleSeries(SeriesDesc desc, Index3 dims) : Series(std::move(desc)), dims_(dims) {}
    Value fetch(std::size_t i, const std::stop_token& stop) const override {
        check_stop(stop);
        if (i >= desc().times.size()) fail("step {} is not there", i);
        return sample_volume(dims_, desc().times[i]);
    }

  private:
    Index3 dims_;
};

class Bytes {
  public:
    void add(std::span<const std::byte> more) { all.insert(all.end(), more.begin(), more.end()); }
    void text(const std::string& s) { add(std::as_bytes(std::span(s.data(), s.size()))); }
    template <class T>
    void number(T v) {
        add(std::as_bytes(std::span<const T, 1>(&v, 1)));
    }
    void numbers(const glm::dvec4& v) {
        for (int i = 0; i < 4; ++i) number(v[i]);
    }
    void numbers(const glm::dvec3& v) {
        for (int i = 0; i < 3; ++i) number(v[i]);
    }

    void operator()(std::monostate) {}
    void operator()(const VolumePtr& v) {
        text(summary(v->desc()));
        std::vector<std::byte> voxels(v->desc().dense_bytes());
        v->read(Box::of(v->desc().dims), voxels, {});
        add(voxels);
        if (!v->desc().has_mask) return;
        std::vector<std::uint8_t> mask(v->desc().voxels());
        v->read_mask(Box::of(v->desc().dims), mask);
        add(std::as_bytes(std::span(mask)));
    }
    void operator()(const SeriesPtr& s) {
        for (std::size_t i = 0; i < s->desc().times.size(); ++i) {
            number(s->desc().times[i]);
            add(bytes_of_value(s->fetch(i)));
        }
    }
    void operator()(const BricksPtr& b) {
        for (int level = int(b->desc().levels.size()) - 1; level >= 0; --level) {
            const glm::ivec3 n = b->desc().levels[std::size_t(level)].bricks;
            for (int z = 0; z < n.z; ++z)
                for (int y = 0; y < n.y; ++y)
                    for (int x = 0; x < n.x; ++x) brick(b, {level, {x, y, z}});
        }
    }
    void operator()(const LatticePtr& l) {
        text(l->desc().kind);
        for (const Value& grid : l->grids()) add(bytes_of_value(grid));
    }
    void operator()(const SelectionPtr& s) {
        for (const SelectedBrick& b : s->bricks) {
            number(b.id.level);
            for (int a = 0; a < 3; ++a) number(b.id.index[a]);
            number(b.octants);
            for (float blend : b.corner_blend) number(blend);
        }
    }
    void operator()(const TransferPtr& t) {
        number(t->reference_length);
        for (const auto& p : t->one.points) {
            number(p.value);
            numbers(p.emission);
        }
        if (t->two)
            for (const Emission& e : t->two->samples) numbers(e);
    }
    void operator()(const CameraPtr& c) {
        numbers(c->eye);
        numbers(c->target);
        numbers(c->up);
        for (double v : {c->vertical_fov, c->height, c->near}) number(v);
    }
    void operator()(const LightsPtr& l) {
        for (double v : {l->ambient, l->diffuse, l->specular, l->shininess}) number(v);
        for (const Light& light : l->lights) {
            numbers(light.position);
            numbers(light.color);
        }
    }
    void operator()(const ImagePtr& i) {
        add(i->bytes());
        add(std::as_bytes(std::span(i->depth)));
    }
    void operator()(const TablePtr& t) {
        for (const auto& c : t->columns) text(c.name + "|" + c.unit + ";");
        for (const auto& row : t->rows)
            for (const Table::Cell& cell : row)
                std::visit(
                    [&](const auto& v) {
                        if constexpr (std::is_same_v<std::decay_t<decltype(v)>, std::string>)
                            text(v + ";");
                        else
                            number(v);
                    },
                    cell);
    }

    std::vector<std::byte> all;

  private:
    // Decodes with the ancestors that the brick needs, each time anew.
    void brick(const BricksPtr& b, BrickId id) {
        BrickVoxelsPtr voxels = decode(b, id);
        add(voxels->voxels.bytes());
    }
    static BrickVoxelsPtr decode(const BricksPtr& b, BrickId id) {
        BrickVoxelsPtr parent;
        if (auto above = b->parent(id)) parent = decode(b, *above);
        for (const DecodedBrick& brick : b->refine(id, parent.get(), {}))
            if (brick.id == id) return brick.voxels;
        fail("a family does not hold the brick that was asked for");
    }
};

}  // namespace

Value sample_value(PortType type, Index3 dims) {
    switch (type) {
        case PortType::volume:
            return sample_volume(dims);
        case PortType::series: {
            SeriesDesc desc;
            desc.step = sample_volume(dims)->desc();
            desc.times = {0, 0.5, 2};
            desc.time_unit = "s";
            return SeriesPtr(std::make_shared<SampleSeries>(desc, dims));
        }
        case PortType::bricks:
            return BricksPtr(std::make_shared<FlatBricks>(sample_volume(dims)));
        case PortType::lattice: {
            LatticeDesc desc;
            desc.kind = "bcc";
            std::vector<Value> grids = {sample_volume(dims),
                                        sample_volume(glm::max(dims - Index3(1), Index3(0)), 0.1)};
            for (const Value& grid : grids)
                desc.grids.push_back({describe(grid), glm::dvec3(desc.grids.size() * 0.5), 0});
            return LatticePtr(std::make_shared<Lattice>(desc, grids));
        }
        case PortType::selection: {
            auto selection = std::make_shared<Selection>();
            selection->of = std::make_shared<BricksDesc>(FlatBricks(sample_volume(dims)).desc());
            selection->policy = "sample";
            if (Box::of(dims).voxels() > 0) selection->bricks.push_back({});
            return SelectionPtr(selection);
        }
        case PortType::transfer: {
            auto transfer = std::make_shared<TransferFunction>();
            transfer->one.points = {
                {0, {0, 0, 0, 0}}, {100, {0.02, 0.01, 0.04, 0.05}}, {255, {0.5, 0.4, 0.3, 0.6}}};
            return TransferPtr(transfer);
        }
        case PortType::camera: {
            auto camera = std::make_shared<Camera>();
            camera->eye = {40, 30, 60};
            camera->target = {4, 4, 8};
            return CameraPtr(camera);
        }
        case PortType::lights:
            return LightsPtr(std::make_shared<Lights>());
        case PortType::image: {
            auto image = std::make_shared<Image>(glm::ivec2(12, 9), Image::Format::rgba32f);
            for (std::size_t i = 0; i < image->rgba32f().size(); ++i) {
                const float a = float(i) / 108;
                image->rgba32f()[i] = glm::vec4(a * 0.5f, a * a, 0.0f, a);
            }
            return ImagePtr(image);
        }
        case PortType::table: {
            auto table = std::make_shared<Table>();
            table->columns = {{"name", ""}, {"time", "s"}, {"count", ""}};
            table->rows = {{std::string("a"), 0.25, std::int64_t(3)},
                           {std::string("b"), 0.5, std::int64_t(4)}};
            return TablePtr(table);
        }
    }
    return {};
}

std::vector<std::byte> bytes_of_value(const Value& value) {
    Bytes bytes;
    std::visit(bytes, value);
    return std::move(bytes.all);
}

}  // namespace voxloom::testing
