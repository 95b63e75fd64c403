#include "plugins/render-slicer/decoding.h"

#include <algorithm>
#include <unordered_set>

#include "core/base/error.h"
#include "core/base/meter.h"
#include "core/base/parallel.h"
#include "core/data/brick_cache.h"

namespace voxloom::slicer {

namespace {

// Calls f(brick) for those that hold the voxels within `reach` of a brick's own, until it says false.
template <class F>
bool for_each_around(const BricksDesc& desc, BrickId id, int reach, const F& f) {
    const Index3 last = desc.levels[std::size_t(id.level)].dims - Index3(1), side(desc.brick);
    const Index3 begin = Index3(id.index) * side;
    const Index3 lo = glm::clamp(begin - Index3(reach), Index3(0), last) / side;
    const Index3 hi = glm::clamp(begin + side + Index3(reach - 1), Index3(0), last) / side;
    for (std::int64_t z = lo.z; z <= hi.z; ++z)
        for (std::int64_t y = lo.y; y <= hi.y; ++y)
            for (std::int64_t x = lo.x; x <= hi.x; ++x)
                if (!f(BrickId{id.level, glm::ivec3(x, y, z)})) return false;
    return true;
}

}  // namespace

bool is_decoded(const Bricks& bricks, BrickId id, int reach) {
    return for_each_around(bricks.desc(), id, reach,
                           [&](BrickId other) { return BrickCache::global().peek(bricks, other) != nullptr; });
}

Decoding::Decoding(const BricksPtr& bricks, const std::vector<BrickId>& missing, int reach, double bytes_per_second) {
    const BricksDesc& desc = bricks->desc();
    std::vector<std::vector<BrickId>> levels(desc.levels.size());  // coarsest first
    std::unordered_set<BrickId, HashOfBrickId> known;
    for (const BrickId& id : missing)
        for (std::optional<BrickId> at = id; at; at = desc.coarser(*at))
            for_each_around(desc, *at, reach, [&](BrickId other) {
                if (known.insert(other).second) levels[levels.size() - 1 - std::size_t(other.level)].push_back(other);
                return true;
            });
    Meter* const meter = Meter::current();
    thread_ = std::jthread([this, bricks, levels = std::move(levels), bytes_per_second, meter](const std::stop_token& stop) {
        MeterScope scope(meter);
        try {
            decode(bricks, levels, bytes_per_second, stop);
        } catch (const std::exception&) {
        }
        const std::lock_guard lock(mutex_);
        done_ = true;
        changed_.notify_all();
    });
}

Decoding::~Decoding() {
    thread_.request_stop();
    thread_.join();
}

void Decoding::decode(const BricksPtr& bricks, const std::vector<std::vector<BrickId>>& levels, double bytes_per_second,
                      const std::stop_token& stop) {
    BrickCache& cache = BrickCache::global();
    const std::int64_t start = wall_ns();
    double bytes = 0;
    for (const std::vector<BrickId>& level : levels) {
        if (bytes_per_second <= 0) {
            parallel_for(0, std::int64_t(level.size()), 1, [&](std::int64_t lo, std::int64_t hi) {
                for (std::int64_t i = lo; i < hi; ++i) cache.get(bricks, level[std::size_t(i)], stop);
            }, stop);
            continue;
        }
        for (const BrickId& id : level) {
            check_stop(stop);
            if (cache.peek(*bricks, id)) continue;
            cache.get(bricks, id, stop);
            bytes += double(bricks->info(id).compressed_bytes);
            const double ahead = bytes / bytes_per_second - double(wall_ns() - start) * 1e-9;
            std::unique_lock lock(mutex_);
            if (ahead > 0) changed_.wait_for(lock, stop, std::chrono::duration<double>(ahead), [] { return false; });
        }
    }
}

bool Decoding::wait(double seconds, const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    const bool done = changed_.wait_for(lock, stop, std::chrono::duration<double>(std::clamp(seconds, 0.0, 1e6)), [&] { return done_; });
    check_stop(stop);
    return done;
}

}  // namespace voxloom::slicer
