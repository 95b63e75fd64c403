#include "plugins/render-slicer/voxels.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "core/base/parallel.h"

namespace voxloom::slicer {

namespace {

double luma(const double* c) { return 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]; }

}  // namespace

Gradients::Gradients(const Volume& volume, int component, double offset, double scale, double side)
    : volume_(volume), component_(component), offset_(offset), scale_(scale), side_(float(side)),
      checks_(volume.desc().has_mask || is_float(volume.desc().type)) {}

void Gradients::load(int z, float* values, std::uint8_t* valid) const {
    const VolumeDesc& desc = volume_.desc();
    const std::size_t count = std::size_t(desc.dims.x) * std::size_t(desc.dims.y);
    const double to_unit = 1.0 / scale_;
    if (desc.has_mask)
        volume_.read_mask({{0, 0, z}, {desc.dims.x, desc.dims.y, z + 1}}, {valid, count});
    else if (checks_)
        std::fill(valid, valid + count, std::uint8_t(1));
    with_type(desc.type, [&](auto t) {
        using T = decltype(t);
        auto v = reinterpret_cast<const T*>(volume_.data()) +
                 count * std::size_t(z) * std::size_t(desc.components);
        const std::size_t stride = std::size_t(desc.components);
        for (std::size_t i = 0; i < count; ++i, v += stride) {
            double value;
            if (desc.color) {
                double c[3] = {double(v[0]), double(v[1]), double(v[2])};
                value = luma(c);
            } else {
                value = double(v[component_]);
            }
            values[i] = float((value - offset_) * to_unit);
            if constexpr (std::is_floating_point_v<T>)
                if (!std::isfinite(value)) valid[i] = 0;
        }
    });
}

void Gradients::slice(int z, glm::vec4* out) const {
    const VolumeDesc& desc = volume_.desc();
    const int nx = int(desc.dims.x), ny = int(desc.dims.y), nz = int(desc.dims.z);
    const std::size_t count = std::size_t(nx) * std::size_t(ny);
    std::vector<float> planes(3 * count);
    std::vector<std::uint8_t> valid(checks_ ? 3 * count : 0);
    for (int k = 0; k < 3; ++k)
        load(std::clamp(z + k - 1, 0, nz - 1), planes.data() + std::size_t(k) * count,
             checks_ ? valid.data() + std::size_t(k) * count : nullptr);
    const float w[3] = {side_, 1 - 2 * side_, side_};

    if (checks_ && std::find(valid.begin(), valid.end(), 0) != valid.end()) {
        // Invalid voxels near: neighbour by neighbour, each as the centre where it is not valid.
        for (int y = 0; y < ny; ++y)
            for (int x = 0; x < nx; ++x) {
                glm::vec3 g(0.0f);
                const std::size_t here = count + std::size_t(y) * std::size_t(nx) + std::size_t(x);
                if (valid[here])
                    for (int n = 0; n < 27; ++n) {
                        const glm::ivec3 o(n % 3, n / 3 % 3, n / 9);
                        const std::size_t at =
                            std::size_t(o.z) * count +
                            std::size_t(std::clamp(y + o.y - 1, 0, ny - 1)) * std::size_t(nx) +
                            std::size_t(std::clamp(x + o.x - 1, 0, nx - 1));
                        const float v = planes[valid[at] ? at : here];
                        g += 0.5f * v * glm::vec3(float(o.x - 1) * w[o.y] * w[o.z],
                                                  float(o.y - 1) * w[o.x] * w[o.z],
                                                  float(o.z - 1) * w[o.x] * w[o.y]);
                    }
                *out++ = glm::vec4(g, 0.0f);
            }
        return;
    }

    // Separable: along z and y for a row at a time, then along x.
    const std::size_t n = std::size_t(nx);
    std::vector<float> smooth(n), along_y(n), along_z(n);
    for (int y = 0; y < ny; ++y) {
        const std::size_t rows[3] = {std::size_t(std::max(y - 1, 0)) * n, std::size_t(y) * n,
                                     std::size_t(std::min(y + 1, ny - 1)) * n};
        const float* p[3][3];
        for (std::size_t k = 0; k < 3; ++k)
            for (std::size_t j = 0; j < 3; ++j) p[k][j] = planes.data() + k * count + rows[j];
        for (std::size_t x = 0; x < n; ++x) {
            float s[3], dy[3];
            for (int k = 0; k < 3; ++k) {
                s[k] = w[0] * (p[k][0][x] + p[k][2][x]) + w[1] * p[k][1][x];
                dy[k] = p[k][2][x] - p[k][0][x];
            }
            smooth[x] = w[0] * (s[0] + s[2]) + w[1] * s[1];
            along_y[x] = w[0] * (dy[0] + dy[2]) + w[1] * dy[1];
            along_z[x] = s[2] - s[0];
        }
        for (std::size_t x = 0; x < n; ++x) {
            const std::size_t a = x > 0 ? x - 1 : 0, b = std::min(x + 1, n - 1);
            *out++ = 0.5f * glm::vec4(smooth[b] - smooth[a],
                                      w[0] * (along_y[a] + along_y[b]) + w[1] * along_y[x],
                                      w[0] * (along_z[a] + along_z[b]) + w[1] * along_z[x], 0.0f);
        }
    }
}

float Gradients::largest(const std::stop_token& stop) const {
    // A bound suffices: half of the largest difference that the value range allows would waste bits on
    // smooth data, so every gradient is looked at once.
    const VolumeDesc& desc = volume_.desc();
    const std::size_t count = std::size_t(desc.dims.x) * std::size_t(desc.dims.y);
    std::atomic<float> all{0.0f};
    parallel_for(0, desc.dims.z, 1, [&](std::int64_t lo, std::int64_t hi) {
        std::vector<glm::vec4> one(count);
        for (std::int64_t z = lo; z < hi; ++z) {
            slice(int(z), one.data());
            float mine = 0;
            for (const glm::vec4& g : one)
                mine = std::max({mine, std::abs(g.x), std::abs(g.y), std::abs(g.z)});
            for (float seen = all; mine > seen && !all.compare_exchange_weak(seen, mine);) {}
        }
    }, stop);
    return all;
}

void classify_slice(const Volume& volume, int component, const TransferFunction1D& tf, double d, int z,
                    glm::vec4* out) {
    const VolumeDesc& desc = volume.desc();
    const std::size_t count = std::size_t(desc.dims.x) * std::size_t(desc.dims.y);
    std::vector<std::uint8_t> mask(desc.has_mask ? count : 0);
    if (desc.has_mask) volume.read_mask({{0, 0, z}, {desc.dims.x, desc.dims.y, z + 1}}, mask);
    const double top = is_float(desc.type) ? 1.0 : limits_of(desc.type).second;
    with_type(desc.type, [&](auto t) {
        using T = decltype(t);
        auto v = reinterpret_cast<const T*>(volume.data()) +
                 count * std::size_t(z) * std::size_t(desc.components);
        T last{};
        glm::vec4 last_emission(0.0f);
        bool known = false;
        for (std::size_t i = 0; i < count; ++i, v += desc.components) {
            if (desc.has_mask && !mask[i]) {
                out[i] = glm::vec4(0.0f);
            } else if (desc.color) {
                double c[4] = {double(v[0]), double(v[1]), double(v[2]), top};
                if (desc.components == 4) c[3] = double(v[3]);
                double depth = std::min(tf.at(luma(c)).a * d * std::clamp(c[3] / top, 0.0, 1.0), 1e30);
                if (!(depth > 0)) depth = 0;
                glm::dvec3 own = glm::clamp(glm::dvec3(c[0], c[1], c[2]) / top, 0.0, 1.0);
                out[i] = glm::vec4(glm::dvec4(own, 1.0) * depth);
            } else {
                // Neighbours often agree: classify them once.
                if (!known || v[component] != last) {
                    last = v[component];
                    known = true;
                    last_emission = std::isfinite(double(last))
                                        ? glm::vec4(glm::min(tf.at(double(last)) * d, glm::dvec4(1e30)))
                                        : glm::vec4(0.0f);
                }
                out[i] = last_emission;
            }
        }
    });
}

}  // namespace voxloom::slicer
