#include "app/editor/model/pick.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "app/editor/model/param_values.h"
#include "app/editor/model/upstream.h"
#include "core/base/error.h"
#include "core/base/text.h"
#include "core/data/brick_cache.h"

namespace voxloom::editor {

namespace {

// Takes what an output gives where nothing nearer has given it.
void gather(PickScene& scene, const std::string& port, const Evaluator::State& state) {
    if (auto value = state.values.find(port); value != state.values.end()) {
        if (auto* camera = std::get_if<CameraPtr>(&value->second.value); camera && !scene.camera) scene.camera = *camera;
        if (auto* transfer = std::get_if<TransferPtr>(&value->second.value); transfer && !scene.transfer) scene.transfer = *transfer;
    }
    if (scene.volume) return;
    if (auto found = state.volumes.find(port); found != state.volumes.end()) scene.volume = found->second.lock();
    if (auto found = state.bricks.find(port); found != state.bricks.end())
        if (BricksPtr bricks = found->second.lock()) scene.volume = level_as_volume(std::move(bricks), 0, BrickCache::global());
}

// The voxels of a volume one after the other.
class Voxels {
  public:
    Voxels(const PickScene& scene, const std::stop_token& stop)
        : volume_(scene.volume->reads_by_region() ? scene.volume : in_memory(scene.volume, stop)),
          component_(scene.component), bytes_(volume_->desc().voxel_bytes()) {}

    const std::vector<double>& at(Index3 voxel, const std::stop_token& stop) {
        if (voxel == at_ && !values_.empty()) return values_;
        const VolumeDesc& desc = volume_->desc();
        const Box box{voxel, voxel + Index3(1)};
        volume_->read(box, bytes_.bytes(), stop);
        values_.clear();
        with_type(desc.type, [&](auto t) {
            for (auto v : bytes_.as<decltype(t)>()) values_.push_back(double(v));
        });
        std::uint8_t valid = 1;
        if (desc.has_mask) volume_->read_mask(box, {&valid, 1});
        classified_ = valid ? values_[std::size_t(component_)] : std::numeric_limits<double>::quiet_NaN();
        at_ = voxel;
        return values_;
    }
    // Of the voxel read last; NaN where it is not valid.
    double classified() const { return classified_; }

  private:
    VolumePtr volume_;
    int component_;
    Buffer bytes_;
    Index3 at_{0};
    std::vector<double> values_;
    double classified_ = 0;
};

// The part of a ray, in world lengths from its origin, that lies in the volume and before the camera.
struct Part {
    double from, to;
};
std::optional<Part> part_in(const SamplingBox& box, glm::dvec3 origin, glm::dvec3 direction, double nearest) {
    Part part{nearest, std::numeric_limits<double>::infinity()};
    for (int a = 0; a < 3; ++a) {
        if (direction[a] == 0) {
            if (origin[a] < box.lo[a] || origin[a] > box.hi[a]) return {};
            continue;
        }
        const double p = (box.lo[a] - origin[a]) / direction[a], q = (box.hi[a] - origin[a]) / direction[a];
        part.from = std::max(part.from, std::min(p, q));
        part.to = std::min(part.to, std::max(p, q));
    }
    if (!(part.from <= part.to) || !std::isfinite(part.to)) return {};
    return part;
}

// Where along the ray, or a negative number. `value_at` is called with rising distances.
template <class F>
double distance_seen(const PickScene& scene, Part part, double step, F&& value_at) {
    const double nothing = -1;
    const double steps = std::floor((part.to - part.from) / step);  // at most four for each voxel of a diagonal
    if (!(steps >= 0 && steps < 1e9)) return nothing;
    const auto n = std::int64_t(steps);
    auto place = [&](std::int64_t i) { return part.from + double(i) * step; };
    if (scene.how == PickScene::How::maximum) {
        double best = -std::numeric_limits<double>::infinity(), where = nothing;
        for (std::int64_t i = 0; i <= n; ++i)
            if (const double v = value_at(place(i)); v > best) best = v, where = place(i);
        return where;
    }
    if (scene.how == PickScene::How::isosurface) {
        const double first = value_at(part.from);
        for (std::int64_t i = 1; i <= n; ++i)
            if (const double v = value_at(place(i)); (v >= scene.iso_value) != (first >= scene.iso_value) && !std::isnan(v)) return place(i);
        return nothing;
    }
    const double wanted = extinction_of(kVisible, 1);  // the optical depth that hides so much
    double depth = 0;
    for (std::int64_t i = 0; i <= n; ++i) {
        const double here = step * scene.transfer->one.at(value_at(place(i))).a;
        depth += here > 0 ? here : 0;
        if (depth >= wanted) return place(i);
    }
    return nothing;
}

}  // namespace

std::optional<PickScene> pick_scene(const Graph& graph, const Registry& registry, const std::string& id, const Evaluator::State& state) {
    const GraphNode* node = graph.find(id);
    const NodeType* type = node ? registry.find(node->type) : nullptr;
    if (!type) return {};
    PickScene scene;
    for (const GraphNode* here : upstream(graph, id))
        for (const GraphInput& input : here->inputs)
            for (const WireEnd& end : input.from) gather(scene, end.node + "." + end.port, state);
    if (!scene.camera || !scene.volume || scene.volume->desc().voxels() == 0) return {};

    auto value = [&](const char* key) {
        const ParamSpec* spec = type->find_param(key);
        return spec ? value_of(*node, *spec) : ParamValue(false);
    };
    const ParamValue component = value("component"), compositing = value("compositing"), iso = value("iso_value");
    if (auto* i = std::get_if<std::int64_t>(&component)) scene.component = int(*i);
    if (auto* d = std::get_if<double>(&iso)) scene.iso_value = *d;
    if (scene.component < 0 || scene.component >= scene.volume->desc().components) return {};
    const auto* how = std::get_if<std::string>(&compositing);
    if (how && *how == "mip") scene.how = PickScene::How::maximum;
    else if (how && *how == "isosurface") scene.how = PickScene::How::isosurface;
    else if (how && *how != "emission-absorption") return {};
    if (type->find_param("normal") && type->find_param("origin"))
        if (const auto plane = plane_of(graph, registry, id)) scene.plane = plane_now(graph, registry, *plane, state);
    if (scene.plane) scene.how = PickScene::How::plane;
    else if (scene.volume->desc().color) return {};
    if (scene.how == PickScene::How::opacity && (!scene.transfer || scene.transfer->two)) return {};
    return scene;
}

std::shared_ptr<const Picked> pick(const PickScene& scene, glm::ivec2 pixel, glm::ivec2 size, const std::stop_token& stop) {
    const VolumeDesc& desc = scene.volume->desc();
    const Ray ray = scene.camera->ray(pixel.x + 0.5, pixel.y + 0.5, size.x, size.y);
    const glm::dmat4 to_index = glm::inverse(desc.index_to_world);
    const glm::dvec3 origin(to_index * glm::dvec4(ray.origin, 1)), direction(to_index * glm::dvec4(ray.direction, 0));
    const double along_axis = glm::dot(ray.direction, scene.camera->forward());
    const auto part = part_in(sampling_box(desc), origin, direction, scene.camera->near / along_axis);
    if (!part) return nullptr;
    const Index3 last = desc.dims - Index3(1);
    auto voxel_at = [&](double t) { return glm::clamp(Index3(glm::round(origin + t * direction)), Index3(0), last); };

    double t = -1;
    Voxels voxels(scene, stop);
    if (scene.how == PickScene::How::plane) {
        t = glm::dot(scene.plane->point - ray.origin, scene.plane->normal) / glm::dot(ray.direction, scene.plane->normal);
        if (!(t >= part->from && t <= part->to)) return nullptr;
    } else {
        // Half a voxel along the axis along which voxels come fastest.
        const double step = 0.5 / std::max({std::abs(direction.x), std::abs(direction.y), std::abs(direction.z)});
        t = distance_seen(scene, *part, step, [&](double at) {
            check_stop(stop);
            voxels.at(voxel_at(at), stop);
            return voxels.classified();
        });
        if (t < 0) return nullptr;
    }
    const Index3 voxel = voxel_at(t);
    return std::make_shared<const Picked>(Picked{ray.origin + t * ray.direction, voxel, voxels.at(voxel, stop)});
}

std::string text_of(const Picked& p, const std::string& unit) {
    std::vector<std::string> values;
    for (double v : p.values) values.push_back(fmt::format("{:.6g}", v));
    return fmt::format("at {:.4g} {:.4g} {:.4g}{}   voxel ({}, {}, {})   value {}", p.world.x, p.world.y, p.world.z,
                       unit.empty() ? "" : " " + unit, p.voxel.x, p.voxel.y, p.voxel.z, join(values, " "));
}

}  // namespace voxloom::editor
