#include "app/editor/model/histogram.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/error.h"

namespace voxloom::editor {

namespace {

// Rows of voxels, spread evenly: every `step`-th of the volume's y-z plane.
template <class F>
void for_rows(const Volume& volume, std::int64_t step, const std::stop_token& stop, F&& f) {
    const VolumeDesc& desc = volume.desc();
    const std::int64_t rows = desc.dims.y * desc.dims.z;
    Buffer row(std::size_t(desc.dims.x) * desc.voxel_bytes());
    for (std::int64_t r = 0; r < rows; r += step) {
        check_stop(stop);
        const Index3 lo(0, r % desc.dims.y, r / desc.dims.y);
        volume.read({lo, lo + Index3(desc.dims.x, 1, 1)}, row.bytes(), stop);
        with_type(desc.type, [&](auto t) {
            const auto voxels = row.as<decltype(t)>();
            for (std::size_t i = 0; i < voxels.size(); i += std::size_t(desc.components)) f(double(voxels[i]));
        });
    }
}

}  // namespace

Histogram histogram_of(const Volume& volume, const std::stop_token& stop, std::uint64_t most_voxels) {
    const VolumeDesc& desc = volume.desc();
    Histogram h;
    h.counts.assign(kHistogramBins, 0.0);
    const std::uint64_t voxels = desc.voxels();
    if (voxels == 0) return h;
    // An odd step does not keep to the same rows of every slice where their number is a power of two.
    std::int64_t step = std::int64_t((voxels + most_voxels - 1) / most_voxels);
    if (step > 1) step |= 1;
    h.sampled = step > 1;
    if (desc.range && desc.components == 1) {
        h.range = *desc.range;
    } else {
        h.range = {std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
        for_rows(volume, step, stop, [&](double v) {
            if (!std::isfinite(v)) return;
            h.range.min = std::min(h.range.min, v);
            h.range.max = std::max(h.range.max, v);
        });
        if (h.range.min > h.range.max) h.range = {};
    }
    const double half = h.range.max / 2 - h.range.min / 2;  // the extent itself may overflow
    const double scale = half > 0 ? double(kHistogramBins) / 2 / half : 0;
    for_rows(volume, step, stop, [&](double v) {
        if (!std::isfinite(v) || v < h.range.min || v > h.range.max) return;
        const double bin = (v / 2 - h.range.min / 2) * 2 * scale;
        h.counts[std::size_t(std::clamp(bin, 0.0, double(kHistogramBins - 1)))] += 1;
    });
    return h;
}

GradientHistogram gradient_histogram_of(const Volume& volume, ValueRange range, const std::stop_token& stop, std::uint64_t most_voxels) {
    const VolumeDesc& desc = volume.desc();
    GradientHistogram h;
    h.counts.assign(kHistogramBins * kGradientBins, 0.0);
    const std::uint64_t voxels = desc.voxels();
    const double extent = range.max - range.min;
    if (voxels == 0 || !(extent > 0) || !std::isfinite(extent)) return h;
    const glm::dvec3 spacing = desc.spacing();
    const double shortest = std::min({spacing.x, spacing.y, spacing.z});
    std::int64_t step = std::int64_t((voxels + most_voxels - 1) / most_voxels);
    if (step > 1) step |= 1;
    // Rows of the first component; of a row beside the volume, the one at its border.
    const std::int64_t nx = desc.dims.x;
    Buffer raw(std::size_t(nx) * desc.voxel_bytes());
    auto read = [&](std::int64_t y, std::int64_t z, std::vector<double>& row) {
        const Index3 lo(0, std::clamp<std::int64_t>(y, 0, desc.dims.y - 1), std::clamp<std::int64_t>(z, 0, desc.dims.z - 1));
        volume.read({lo, lo + Index3(nx, 1, 1)}, raw.bytes(), stop);
        row.resize(std::size_t(nx));
        with_type(desc.type, [&](auto t) {
            const auto all = raw.as<decltype(t)>();
            for (std::size_t x = 0; x < row.size(); ++x) row[x] = double(all[x * std::size_t(desc.components)]);
        });
    };
    auto steps = [](std::int64_t at, std::int64_t n) { return double(std::max<std::int64_t>(1, std::min(at + 1, n - 1) - std::max<std::int64_t>(at - 1, 0))); };
    std::vector<double> here, above, below, before, behind;
    for (std::int64_t r = 0; r < desc.dims.y * desc.dims.z; r += step) {
        check_stop(stop);
        const std::int64_t y = r % desc.dims.y, z = r / desc.dims.y;
        read(y, z, here), read(y - 1, z, above), read(y + 1, z, below), read(y, z - 1, before), read(y, z + 1, behind);
        for (std::int64_t x = 0; x < nx; ++x) {
            const auto i = std::size_t(x);
            const glm::dvec3 g((here[std::size_t(std::min(x + 1, nx - 1))] - here[std::size_t(std::max<std::int64_t>(x - 1, 0))]) / (steps(x, nx) * spacing.x),
                               (below[i] - above[i]) / (steps(y, desc.dims.y) * spacing.y), (behind[i] - before[i]) / (steps(z, desc.dims.z) * spacing.z));
            const double gradient = glm::length(g) * shortest / extent, value = (here[i] - range.min) / extent;
            if (!std::isfinite(gradient) || !(value >= 0 && value <= 1)) continue;
            const double height = std::log(std::max(gradient, kLeastGradient) / kLeastGradient) / -std::log(kLeastGradient);
            const auto bin = [](double share, std::size_t bins) { return std::min(std::size_t(share * double(bins)), bins - 1); };
            h.counts[bin(std::min(height, 1.0), kGradientBins) * kHistogramBins + bin(value, kHistogramBins)] += 1;
        }
    }
    return h;
}

}  // namespace voxloom::editor
