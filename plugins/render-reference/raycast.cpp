#include "plugins/render-reference/raycast.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "core/base/error.h"
#include "core/base/parallel.h"

namespace voxloom::reference {

namespace {

bool modulates(const RaycastScene& scene) {
    return scene.gradient_modulation != glm::dvec2(0.0);
}

double smooth_step(double lo, double hi, double x) {
    if (hi <= lo) return x < lo ? 0 : 1;
    const double t = std::clamp((x - lo) / (hi - lo), 0.0, 1.0);
    return t * t * (3 - 2 * t);
}

}  // namespace

const char* cells_problem(const RaycastScene& scene) {
    if (scene.closed_form) return "a closed form is no cubic inside of a cell";
    if (scene.reconstruction == Reconstruction::tricubic)
        return "the tricubic kernel is no cubic along a ray";
    const bool integrates = scene.compositing == Compositing::emission_absorption ||
                            scene.compositing == Compositing::x_ray;
    if (!integrates) return nullptr;
    if (scene.transfer && scene.transfer->two)
        return "a 2-D transfer function needs the gradient all along the ray";
    if (modulates(scene)) return "modulation needs the gradient all along the ray";
    if (scene.volume && scene.volume->desc().color) return "a colour volume has colours of its own";
    return nullptr;
}

Raycaster::Raycaster(RaycastScene scene, const std::stop_token& stop,
                     const std::function<void(double)>& progress)
    : scene_(std::move(scene)),
      field_(scene_.closed_form ? scene_.volume : in_memory(scene_.volume, stop, progress),
             scene_.component, scene_.reconstruction, scene_.gradient, scene_.closed_form) {
    const char* problem = cells_problem(scene_);
    if (scene_.mode == Mode::cells && problem)
        fail("{}; set mode to steps or auto instead of cells", problem);
    cells_ = scene_.mode != Mode::steps && !problem;

    const glm::dvec3 spacing = field_.desc().spacing();
    step_length_ = scene_.step * std::min({spacing.x, spacing.y, spacing.z});
    if (scene_.shading && field_.interpolates_voxels())
        flat_ = 1e-9 * value_range(*scene_.volume, stop).extent() /
                std::max({spacing.x, spacing.y, spacing.z});
    build_segments();
}

std::optional<Raycaster::Path> Raycaster::clip(const Ray& ray) const {
    const VolumeDesc& desc = field_.desc();
    if (Box::of(desc.dims).empty()) return std::nullopt;
    const SamplingBox box = sampling_box(desc);
    const glm::dvec3 p = field_.to_index(ray.origin), d = field_.direction_to_index(ray.direction);

    double t0 = 0;
    if (scene_.camera->near > 0)
        t0 = scene_.camera->near / glm::dot(ray.direction, scene_.camera->forward());
    double t1 = std::numeric_limits<double>::infinity();
    for (int a = 0; a < 3; ++a) {
        if (d[a] == 0) {
            if (p[a] < box.lo[a] || p[a] > box.hi[a]) return std::nullopt;
            continue;
        }
        const double lo = (box.lo[a] - p[a]) / d[a], hi = (box.hi[a] - p[a]) / d[a];
        t0 = std::max(t0, std::min(lo, hi));
        t1 = std::min(t1, std::max(lo, hi));
    }
    if (!(t1 > t0) || !std::isfinite(t1)) return std::nullopt;
    return Path{glm::clamp(p + t0 * d, box.lo, box.hi), d, t1 - t0, ray.direction};
}

// Extinction and its colour, before shading.
Emission Raycaster::classify(glm::dvec3 p, double value) const {
    const TransferFunction& transfer = *scene_.transfer;
    double slope = 0;
    if (transfer.two || modulates(scene_)) slope = glm::length(field_.gradient(p));
    Emission e = transfer.two ? transfer.two->at(value, slope) : transfer.one.at(value);
    if (field_.desc().color) {
        const glm::dvec4 own = field_.color(p);
        e.a *= own.a;
        e = Emission(e.a * glm::dvec3(own), e.a);
    }
    if (modulates(scene_))
        e *= smooth_step(scene_.gradient_modulation.x, scene_.gradient_modulation.y, slope);
    return e;
}

// Blinn-Phong of core/data/camera.h on extinction-weighted colour, two-sided.
Emission Raycaster::lit(const Emission& e, glm::dvec3 gradient, glm::dvec3 p,
                        const Path& path) const {
    const Lights& lights = scene_.lights;
    const glm::dvec3 base(e);
    glm::dvec3 color = lights.ambient * base;
    const double steepness = glm::length(gradient);
    if (!(steepness > flat_)) return {color, e.a};

    const glm::dvec3 normal = gradient / steepness, to_eye = -path.view;
    for (const Light& light : lights.lights) {
        glm::dvec3 to_light = -scene_.camera->forward();
        if (light.kind == Light::Kind::directional) to_light = glm::normalize(light.position);
        if (light.kind == Light::Kind::point) {
            to_light = light.position - field_.to_world(p);
            if (glm::length(to_light) > 0) to_light = glm::normalize(to_light);
        }
        const glm::dvec3 halfway = to_light + to_eye;
        const double across = glm::length(halfway);
        color += lights.diffuse * std::abs(glm::dot(normal, to_light)) * light.color * base;
        if (across > 0)
            color += lights.specular *
                     std::pow(std::abs(glm::dot(normal, halfway)) / across, lights.shininess) *
                     light.color * e.a;
    }
    return {color, e.a};
}

// What a ray shows whose picture is one sample.
glm::dvec4 Raycaster::show(const Hit& hit, const Path& path) const {
    const glm::dvec3 p = path.at(hit.t);
    if (scene_.compositing == Compositing::isosurface) {
        const TransferFunction& transfer = *scene_.transfer;
        Emission e = transfer.two ? transfer.two->at(hit.value, glm::length(field_.gradient(p)))
                                  : transfer.one.at(hit.value);
        e = e.a > 0 ? e / e.a : Emission(1.0);
        if (field_.desc().color) e = Emission(glm::dvec3(field_.color(p)), 1.0);
        return scene_.shading ? lit(e, field_.gradient(p), p, path) : e;
    }
    Emission e = classify(p, hit.value);
    if (!(e.a > 0)) return glm::dvec4(0.0);
    if (scene_.shading) e = lit(e, field_.gradient(p), p, path);
    return e / e.a * opacity_of(e.a, scene_.transfer->reference_length);
}

glm::dvec4 Raycaster::trace(const Ray& ray) const {
    const std::optional<Path> path = clip(ray);
    if (!path) return glm::dvec4(0.0);
    if (scene_.compositing == Compositing::mip || scene_.compositing == Compositing::isosurface) {
        const bool surface = scene_.compositing == Compositing::isosurface;
        const std::optional<Hit> hit =
            cells_ ? (surface ? surface_cells(*path) : maximum_cells(*path))
                   : (surface ? surface_steps(*path) : maximum_steps(*path));
        return hit ? show(*hit, *path) : glm::dvec4(0.0);
    }
    Composite out;
    if (cells_)
        emit_cells(*path, out);
    else
        emit_steps(*path, out);
    const double alpha = -std::expm1(-out.depth);
    if (scene_.compositing == Compositing::x_ray) return glm::dvec4(alpha);
    return {out.color, alpha};
}

Image Raycaster::image(const std::stop_token& stop,
                       const std::function<void(double)>& progress) const {
    const glm::ivec2 size = scene_.size;
    Image image(size, Image::Format::rgba32f);
    const glm::dvec4 under(glm::dvec3(scene_.background) * scene_.background.a,
                           scene_.background.a);
    std::span<glm::vec4> pixels = image.rgba32f();
    std::atomic<int> rows_done{0};
    parallel_for(
        0, size.y, 1,
        [&](std::int64_t from, std::int64_t to) {
            for (std::int64_t y = from; y < to; ++y) {
                for (int x = 0; x < size.x; ++x) {
                    check_stop(stop);
                    const glm::dvec4 c =
                        trace(scene_.camera->ray(x + 0.5, double(y) + 0.5, size.x, size.y));
                    pixels[std::size_t(y) * std::size_t(size.x) + std::size_t(x)] =
                        glm::vec4(c + (1 - c.a) * under);
                }
                const int done = ++rows_done;
                if (progress) progress(double(done) / size.y);
            }
        },
        stop);
    return image;
}

}  // namespace voxloom::reference
