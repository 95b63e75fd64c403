#include "plugins/render-reference/field.h"

#include <cmath>

#include "core/base/error.h"

namespace voxloom::reference {

namespace {

struct Taps {
    std::int64_t first = 0;
    int count = 0;
    std::array<double, 4> weights{};
};

// One axis of the separable kernels. Catmull-Rom interpolates and reproduces quadratics.
Taps taps(double x, Reconstruction reconstruction) {
    if (reconstruction == Reconstruction::nearest)
        return {std::int64_t(std::floor(x + 0.5)), 1, {1}};
    const double base = std::floor(x), t = x - base;
    const auto i = std::int64_t(base);
    if (reconstruction == Reconstruction::trilinear) return {i, 2, {1 - t, t}};
    const double t2 = t * t, t3 = t2 * t;
    return {i - 1,
            4,
            {0.5 * (2 * t2 - t - t3), 0.5 * (2 - 5 * t2 + 3 * t3), 0.5 * (t + 4 * t2 - 3 * t3),
             0.5 * (t3 - t2)}};
}

glm::dvec3 smoothing_of(GradientStencil stencil) {
    switch (stencil) {
        case GradientStencil::central:
            return {0, 1, 0};
        case GradientStencil::sobel:
            return glm::dvec3(1, 2, 1) / 4.0;
        case GradientStencil::isotropic:
            break;
    }
    return glm::dvec3(1, 4, 1) / 6.0;
}

}  // namespace

Field::Field(VolumePtr volume, int component, Reconstruction reconstruction,
             GradientStencil stencil, bool closed_form)
    : volume_(std::move(volume)),
      data_(volume_->data()),
      component_(component),
      reconstruction_(reconstruction),
      smoothing_(smoothing_of(stencil)) {
    const VolumeDesc& d = desc();
    if (closed_form) {
        form_ = volume_->closed_form();
        if (!form_)
            fail(
                "'{}' has no closed form to integrate; set field to voxels, or wire an analytic "
                "phantom",
                d.name.empty() ? "the volume" : d.name);
        if (d.color) fail("a closed form has no colours; set field to voxels");
    }
    const glm::dmat3 linear(d.index_to_world);
    const double determinant = glm::determinant(linear);
    if (!(std::abs(determinant) > 0) || !std::isfinite(determinant))
        fail(
            "the volume's index-to-world matrix cannot be inverted; every axis needs a spacing "
            "that is not zero and a direction of its own");
    world_to_index_ = glm::inverse(linear);
    gradient_to_world_ = glm::transpose(world_to_index_);
    if (d.has_mask && d.voxels() > 0) {
        mask_.resize(d.voxels());
        volume_->read_mask(Box::of(d.dims), mask_);
    }
}

glm::dvec3 Field::to_world(glm::dvec3 index) const {
    return glm::dmat3(desc().index_to_world) * index + desc().origin();
}

Index3 Field::clamp(Index3 i) const {
    return glm::clamp(i, Index3(0), desc().dims - Index3(1));
}

std::uint64_t Field::offset(Index3 i) const {
    return std::uint64_t((i.z * desc().dims.y + i.y) * desc().dims.x + i.x);
}

double Field::component(std::uint64_t voxel, int c) const {
    if (!mask_.empty() && !mask_[voxel]) return kInvalid;
    const std::uint64_t i = voxel * std::uint64_t(desc().components) + std::uint64_t(c);
    const double v = with_type(desc().type, [&](auto t) {
        return double(reinterpret_cast<const decltype(t)*>(data_)[i]);
    });
    return std::isfinite(v) ? v : kInvalid;
}

double Field::voxel(Index3 i) const {
    const std::uint64_t at = offset(clamp(i));
    if (!desc().color) return component(at, component_);
    if (desc().components == 4 && std::isnan(component(at, 3))) return kInvalid;
    return 0.2126 * component(at, 0) + 0.7152 * component(at, 1) + 0.0722 * component(at, 2);
}

glm::dvec3 Field::index_gradient(Index3 i) const {
    const double centre = voxel(i);
    glm::dvec3 g(0.0);
    for (int z = -1; z <= 1; ++z)
        for (int y = -1; y <= 1; ++y)
            for (int x = -1; x <= 1; ++x) {
                const glm::dvec3 smooth(smoothing_[x + 1], smoothing_[y + 1], smoothing_[z + 1]);
                const glm::dvec3 weight =
                    0.5 * glm::dvec3(x * smooth.y * smooth.z, y * smooth.x * smooth.z,
                                     z * smooth.x * smooth.y);
                if (weight == glm::dvec3(0.0)) continue;
                const double v = voxel(i + Index3(x, y, z));
                if (!std::isnan(v)) g += weight * (v - centre);
            }
    return g;
}

// False when an invalid voxel has a weight; `f` then holds the valid ones.
bool Field::gather(glm::dvec3 p, Reconstruction reconstruction, Footprint& f) const {
    const Taps x = taps(p.x, reconstruction), y = taps(p.y, reconstruction),
               z = taps(p.z, reconstruction);
    bool complete = true;
    f.count = 0;
    for (int k = 0; k < z.count; ++k)
        for (int j = 0; j < y.count; ++j)
            for (int i = 0; i < x.count; ++i) {
                const double w = x.weights[std::size_t(i)] * y.weights[std::size_t(j)] *
                                 z.weights[std::size_t(k)];
                if (w == 0) continue;
                const Index3 at = clamp({x.first + i, y.first + j, z.first + k});
                if (std::isnan(voxel(at))) {
                    complete = false;
                    continue;
                }
                f.voxels[std::size_t(f.count)] = at;
                f.weights[std::size_t(f.count)] = w;
                ++f.count;
            }
    return complete;
}

Field::Footprint Field::footprint(glm::dvec3 p) const {
    Footprint f;
    if (gather(p, reconstruction_, f)) return f;
    // What remains of a kernel with negative lobes may add up to next to nothing: beside invalid
    // voxels the tricubic one is replaced by the trilinear one before weights are renormalised.
    if (reconstruction_ == Reconstruction::tricubic && gather(p, Reconstruction::trilinear, f))
        return f;
    double sum = 0;
    for (int n = 0; n < f.count; ++n) sum += f.weights[std::size_t(n)];
    for (int n = 0; n < f.count; ++n) f.weights[std::size_t(n)] /= sum;
    return f;
}

double Field::value(glm::dvec3 p) const {
    if (form_) return form_->value(to_world(p));
    const Footprint f = footprint(p);
    if (f.count == 0) return kInvalid;
    double v = 0;
    for (int n = 0; n < f.count; ++n)
        v += f.weights[std::size_t(n)] * voxel(f.voxels[std::size_t(n)]);
    return v;
}

glm::dvec3 Field::gradient(glm::dvec3 p) const {
    if (form_) return form_->gradient(to_world(p));
    const Footprint f = footprint(p);
    glm::dvec3 g(0.0);
    for (int n = 0; n < f.count; ++n)
        g += f.weights[std::size_t(n)] * index_gradient(f.voxels[std::size_t(n)]);
    return to_world_gradient(g);
}

glm::dvec4 Field::color(glm::dvec3 p) const {
    const double scale = is_float(desc().type) ? 1.0 : 1.0 / limits_of(desc().type).second;
    const Footprint f = footprint(p);
    glm::dvec4 rgba(0.0);
    for (int n = 0; n < f.count; ++n) {
        const std::uint64_t at = offset(f.voxels[std::size_t(n)]);
        glm::dvec4 own(component(at, 0), component(at, 1), component(at, 2), 1 / scale);
        if (desc().components == 4) own.a = component(at, 3);
        rgba += f.weights[std::size_t(n)] * scale * own;
    }
    return rgba;
}

}  // namespace voxloom::reference
