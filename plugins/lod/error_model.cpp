#include "plugins/lod/error_model.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/data/selection.h"
#include "plugins/lod/sight.h"

namespace voxloom::lod {

namespace {

double peak_of(const Bricks& bricks) {
    const BricksDesc& desc = bricks.desc();
    if (desc.volume.range && desc.volume.range->extent() > 0) return desc.volume.range->extent();
    // The coarsest level's values, as nothing is known of the finest; they cannot be far off.
    double lo = std::numeric_limits<double>::infinity(), hi = -lo;
    const glm::ivec3 n = desc.levels.back().bricks;
    for (int z = 0; z < n.z; ++z)
        for (int y = 0; y < n.y; ++y)
            for (int x = 0; x < n.x; ++x) {
                const ValueRange r = bricks.info({int(desc.levels.size()) - 1, {x, y, z}}).range;
                lo = std::min(lo, r.min);
                hi = std::max(hi, r.max);
            }
    return hi > lo && std::isfinite(hi - lo) ? hi - lo : 1.0;
}

}  // namespace

ErrorModel value_errors(BricksPtr bricks) {
    const double scale = 1 / (peak_of(*bricks) * std::sqrt(double(bricks->desc().volume.components)));
    return [bricks = std::move(bricks), scale](BrickId id) -> std::optional<OctantErrors> {
        const BrickInfo info = bricks->info(id);
        OctantErrors errors{};
        for (std::size_t o = 0; o < 8; ++o) {
            const double e = info.octant_l2[o] * scale;
            errors[o] = e * e;
        }
        return errors;
    };
}

double largest_change(const TransferFunction& transfer, double lo, double hi, double distance) {
    if (!(distance > 0) || !(lo <= hi)) return 0;
    if (transfer.two) return 2 * transfer.two->max_extinction(lo, hi);
    const TransferFunction1D& tf = transfer.one;
    Emission least = glm::min(tf.at(lo), tf.at(hi)), most = glm::max(tf.at(lo), tf.at(hi));
    Emission steepest(0.0);
    // The segments that [lo, hi] meets: from the last point at or before lo to the first one beyond hi.
    auto it = std::ranges::lower_bound(tf.points, lo, {}, &TransferFunction1D::Point::value);
    for (; it != tf.points.end(); ++it) {
        if (it->value <= hi) {
            least = glm::min(least, it->emission);
            most = glm::max(most, it->emission);
        }
        if (it != tf.points.begin()) {
            const TransferFunction1D::Point& before = *(it - 1);
            const double width = it->value - before.value;
            for (int c = 0; c < 4; ++c) {
                const double rise = std::abs(it->emission[c] - before.emission[c]);
                if (rise > 0) steepest[c] = std::max(steepest[c], rise / width);  // a step: infinite
            }
        }
        if (it->value > hi) break;
    }
    const Emission change = glm::min(most - least, steepest * distance);
    return std::max({change.r, change.g, change.b}) + change.a;
}

ErrorModel classified_errors(BricksPtr bricks, TransferPtr transfer) {
    const glm::dmat3 to_world(bricks->desc().volume.index_to_world);
    return [bricks = std::move(bricks), transfer = std::move(transfer),
            to_world](BrickId id) -> std::optional<OctantErrors> {
        const BricksDesc& desc = bricks->desc();
        const BrickInfo info = bricks->info(id);
        // Nobody knows how wrong an unmeasured brick of a coarse level is: any value may be in it.
        const bool unknown = id.level > 0 && !info.exact_error && info.max_error == 0;
        const double e = unknown ? std::numeric_limits<double>::infinity() : info.max_error;
        // The finest level is all that there is to see.
        const double beyond = id.level > 0 ? e : 0;
        const double lo = info.range.min - beyond, hi = info.range.max + beyond;
        // Unbounded intervals are cut off where doubles end, for the transfer function's sake.
        constexpr double most = std::numeric_limits<double>::max();
        const double extinction = transfer->max_extinction(std::max(lo, -most), std::min(hi, most));
        if (!(extinction > 0)) return std::nullopt;

        OctantErrors errors{};
        for (int o = 0; o < 8; ++o) {
            const Box box = fine_box_of_octant(desc, id, o);
            if (box.empty()) continue;
            const double here = unknown ? e : std::min(e, info.octant_l2[std::size_t(o)]);
            const Region region = region_of(desc.volume, box);
            const glm::dvec3 h = region.hi - region.lo;
            double length = 0;
            for (int corner = 0; corner < 4; ++corner)
                length = std::max(length, glm::length(to_world * (h * glm::dvec3(corner & 1 ? -1 : 1,
                                                                                 corner & 2 ? -1 : 1, 1))));
            double change = largest_change(*transfer, std::max(info.range.min - here, -most),
                                           std::min(info.range.max + here, most), here);
            if (desc.volume.color) {
                const double top = is_float(desc.volume.type) ? 1.0 : limits_of(desc.volume.type).second;
                change += extinction * std::min(here / top, 1.0);
            }
            const double bound = std::min(length * change, 1.0);
            errors[std::size_t(o)] = bound * bound * double(box.voxels());
        }
        return errors;
    };
}

}  // namespace voxloom::lod
