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
        : scene_(scene), desc_(scene.volume->desc()), stop_(stop),
          alpha_scale_(is_float(desc_.type) ? 1 : 1 / limits_of(desc_.type).second),
          gradient_to_world_(glm::transpose(glm::inverse(glm::dmat3(desc_.index_to_world)))) {}

    // Its components.
    const std::vector<double>& values(Index3 voxel) {
        read({voxel, voxel + Index3(1)});
        return values_;
    }
    // What is classified; NaN where the voxel is not valid.
    double scalar(Index3 voxel) {
        read({voxel, voxel + Index3(1)});
        return scalar_of(0);
    }
    // Extinction as renderers have it at the voxel.
    double extinction(Index3 voxel) {
        const TransferFunction& transfer = *scene_.transfer;
        const double v = scalar(voxel);
        if (!(transfer.max_extinction(v, v) > 0)) return 0;
        const double alpha = desc_.color && desc_.components == 4 ? std::clamp(values_[3] * alpha_scale_, 0.0, 1.0) : 1;
        const bool modulated = scene_.modulation != glm::dvec2(0);
        const double slope = transfer.two || modulated ? glm::length(gradient(voxel)) : 0;
        double e = alpha * (transfer.two ? transfer.two->at(v, slope) : transfer.one.at(v)).a;
        if (modulated) e *= shown_of(slope);
        return e > 0 ? e : 0;
    }

  private:
    void read(const Box& box) {
        if (box == box_) return;
        box_ = {};
        const auto count = std::size_t(box.voxels());
        if (bytes_.size() != count * desc_.voxel_bytes()) bytes_ = Buffer(count * desc_.voxel_bytes(), "voxels");
        scene_.volume->read(box, bytes_.bytes(), stop_);
        values_.clear();
        with_type(desc_.type, [&](auto t) {
            for (auto v : bytes_.as<decltype(t)>()) values_.push_back(double(v));
        });
        valid_.assign(count, 1);
        if (desc_.has_mask) scene_.volume->read_mask(box, valid_);
        box_ = box;
    }
    double scalar_of(std::size_t k) const {
        const double* v = &values_[k * std::size_t(desc_.components)];
        const double s = desc_.color ? 0.2126 * v[0] + 0.7152 * v[1] + 0.0722 * v[2] : v[scene_.component];
        return valid_[k] && std::isfinite(s) ? s : std::numeric_limits<double>::quiet_NaN();
    }
    // The renderers' stencil: a difference along one axis, smoothed along the other two. Beside the volume values are
    // those of its border, and a voxel that is not valid is as the one in the middle.
    glm::dvec3 gradient(Index3 voxel) {
        const Box box{glm::max(voxel - Index3(1), Index3(0)), glm::min(voxel + Index3(2), desc_.dims)};
        read(box);
        const Index3 n = box.dims();
        auto value_at = [&](Index3 at) {
            at = glm::clamp(at, box.lo, box.hi - Index3(1)) - box.lo;
            return scalar_of(std::size_t((at.z * n.y + at.y) * n.x + at.x));
        };
        const double middle = value_at(voxel), side = scene_.smoothing;
        glm::dvec3 g(0);
        for (int z = -1; z <= 1; ++z)
            for (int y = -1; y <= 1; ++y)
                for (int x = -1; x <= 1; ++x) {
                    const glm::dvec3 o(x, y, z), w = glm::mix(glm::dvec3(1 - 2 * side), glm::dvec3(side), glm::abs(o));
                    if (const double v = value_at(voxel + Index3(x, y, z)); !std::isnan(v))
                        g += 0.5 * (v - middle) * o * glm::dvec3(w.y * w.z, w.x * w.z, w.x * w.y);
                }
        return gradient_to_world_ * g;
    }
    double shown_of(double slope) const {
        const double lo = scene_.modulation.x, hi = scene_.modulation.y;
        if (hi <= lo) return slope < lo ? 0 : 1;
        const double t = std::clamp((slope - lo) / (hi - lo), 0.0, 1.0);
        return t * t * (3 - 2 * t);
    }

    const PickScene& scene_;
    const VolumeDesc& desc_;
    const std::stop_token& stop_;
    const double alpha_scale_;
    const glm::dmat3 gradient_to_world_;
    Box box_;  // that was read last
    Buffer bytes_;
    std::vector<double> values_;
    std::vector<std::uint8_t> valid_;
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

// The first place along the ray where `value_at` is greatest, or a negative number where it is never above `nothing`.
template <class F>
double greatest(Part part, double step, std::int64_t steps, double nothing, F&& value_at) {
    double where = -1;
    for (std::int64_t i = 0; i <= steps; ++i)
        if (const double t = part.from + double(i) * step, v = value_at(t); v > nothing) nothing = v, where = t;
    return where;
}

// Where along the ray what is seen is met, or a negative number.
template <class F>
double distance_seen(const PickScene& scene, Part part, double step, Voxels& voxels, F&& voxel_at) {
    const double nowhere = -1, steps = std::floor((part.to - part.from) / step);  // at most four for each voxel of a diagonal
    if (!(steps >= 0 && steps < 1e9)) return nowhere;
    const auto n = std::int64_t(steps);
    auto scalar_at = [&](double t) { return voxels.scalar(voxel_at(t)); };
    auto extinction_at = [&](double t) { return voxels.extinction(voxel_at(t)); };
    switch (scene.how) {
        case PickScene::How::plane: break;
        case PickScene::How::maximum: return greatest(part, step, n, -std::numeric_limits<double>::infinity(), scalar_at);
        case PickScene::How::densest: return greatest(part, step, n, 0, extinction_at);
        case PickScene::How::isosurface: {
            const bool beyond = scalar_at(part.from) >= scene.iso_value;
            for (std::int64_t i = 1; i <= n; ++i)
                if (const double t = part.from + double(i) * step, v = scalar_at(t); !std::isnan(v) && (v >= scene.iso_value) != beyond) return t;
            break;
        }
        case PickScene::How::opacity: {
            const double wanted = extinction_of(kVisible, 1);  // the optical depth that hides so much
            double depth = 0;
            for (std::int64_t i = 0; i <= n; ++i)
                if (const double t = part.from + double(i) * step; (depth += step * extinction_at(t)) >= wanted) return t;
            break;
        }
    }
    return nowhere;
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
    const ParamValue modulation = value("gradient_modulation"), stencil = value("gradient");
    if (auto* i = std::get_if<std::int64_t>(&component)) scene.component = int(*i);
    if (auto* d = std::get_if<double>(&iso)) scene.iso_value = *d;
    if (auto* m = std::get_if<std::vector<double>>(&modulation); m && m->size() == 2) scene.modulation = {(*m)[0], (*m)[1]};
    if (auto* name = std::get_if<std::string>(&stencil)) scene.smoothing = *name == "central" ? 0 : *name == "sobel" ? 0.25 : 1.0 / 6;
    if (!scene.volume->desc().color && (scene.component < 0 || scene.component >= scene.volume->desc().components)) return {};
    const auto* how = std::get_if<std::string>(&compositing);
    if (how && *how == "mip") scene.how = PickScene::How::maximum;
    else if (how && *how == "isosurface") scene.how = PickScene::How::isosurface;
    else if (how && *how == "x-ray") scene.how = PickScene::How::densest;
    else if (how && *how != "emission-absorption") return {};
    if (type->find_param("normal") && type->find_param("origin"))
        if (const auto plane = plane_of(graph, registry, id)) scene.plane = plane_now(graph, registry, *plane, state);
    if (scene.plane) scene.how = PickScene::How::plane;
    const bool classified = scene.how == PickScene::How::opacity || scene.how == PickScene::How::densest;
    if (classified && !scene.transfer) return {};
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
        t = distance_seen(scene, *part, step, voxels, [&](double at) {
            check_stop(stop);
            return voxel_at(at);
        });
        if (t < 0) return nullptr;
    }
    const Index3 voxel = voxel_at(t);
    return std::make_shared<const Picked>(Picked{ray.origin + t * ray.direction, voxel, voxels.values(voxel)});
}

std::string text_of(const Picked& p, const std::string& unit) {
    std::vector<std::string> values;
    for (double v : p.values) values.push_back(fmt::format("{:.6g}", v));
    return fmt::format("at {:.4g} {:.4g} {:.4g}{}   voxel ({}, {}, {})   value {}", p.world.x, p.world.y, p.world.z,
                       unit.empty() ? "" : " " + unit, p.voxel.x, p.voxel.y, p.voxel.z, join(values, " "));
}

}  // namespace voxloom::editor
