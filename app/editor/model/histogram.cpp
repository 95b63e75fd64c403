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

}  // namespace voxloom::editor
