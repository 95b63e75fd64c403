#include "plugins/scene/data_range.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/error.h"

namespace voxloom::scene {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

ValueRange join(ValueRange a, ValueRange b) {
    return {std::min(a.min, b.min), std::max(a.max, b.max)};
}

ValueRange range_of_bricks(const Bricks& bricks, const std::stop_token& stop) {
    const BricksDesc& desc = bricks.desc();
    if (desc.volume.range) return *desc.volume.range;
    ValueRange all{kInf, -kInf};
    const glm::ivec3 n = desc.levels.front().bricks;
    for (int z = 0; z < n.z; ++z)
        for (int y = 0; y < n.y; ++y) {
            check_stop(stop);
            for (int x = 0; x < n.x; ++x) {
                // A brick without a finite value says {0, 0}. So does one of zeros, but then the
                // layer that bricks share brings the zero in with its neighbours.
                const ValueRange range = bricks.info({0, {x, y, z}}).range;
                if (range != ValueRange{}) all = join(all, range);
            }
        }
    return all.min > all.max ? ValueRange{} : all;
}

ValueRange range_of_series(const Series& series, std::size_t max_steps, const std::stop_token& stop,
                           const std::function<void(double)>& progress) {
    const std::size_t steps = series.desc().times.size();
    const std::size_t count = max_steps == 0 ? steps : std::min(max_steps, steps);
    ValueRange all{kInf, -kInf};
    for (std::size_t i = 0; i < count; ++i) {
        check_stop(stop);
        std::size_t step = count > 1 ? i * (steps - 1) / (count - 1) : 0;
        all = join(all, data_range(series.fetch(step, stop), 0, stop, {}));
        if (progress) progress(double(i + 1) / double(count));
    }
    return all.min > all.max ? ValueRange{} : all;
}

}  // namespace

ValueRange data_range(const Value& data, std::size_t max_steps, const std::stop_token& stop,
                      const std::function<void(double)>& progress) {
    if (auto* volume = std::get_if<VolumePtr>(&data)) return value_range(**volume, stop);
    if (auto* bricks = std::get_if<BricksPtr>(&data)) return range_of_bricks(**bricks, stop);
    if (auto* series = std::get_if<SeriesPtr>(&data))
        return range_of_series(**series, max_steps, stop, progress);
    fail("input 'fit' holds neither a Volume nor Bricks, so its range of values is not known; wire "
         "one of them, or set 'range'");
}

double voxel_spacing(const Value& data) {
    ValueDesc desc = describe(data);
    const VolumeDesc* volume = desc.volume();
    if (!volume) return 0;
    const glm::dvec3 spacing = volume->spacing();
    double smallest = kInf;
    for (int a = 0; a < 3; ++a)
        if (volume->dims[a] > 1) smallest = std::min(smallest, spacing[a]);
    if (smallest == kInf) smallest = std::min({spacing.x, spacing.y, spacing.z});
    return smallest > 0 && std::isfinite(smallest) ? smallest : 0;
}

}  // namespace voxloom::scene
