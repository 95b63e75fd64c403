// Parallel loops that charge the node they work for, stop when asked, and never steal foreign work.
#pragma once

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <cstdint>
#include <stop_token>

#include "core/base/error.h"
#include "core/base/meter.h"
#include "core/base/tsan.h"

namespace voxloom {

// Calls body(lo, hi) on disjoint sub-ranges of [begin, end), at least `grain` long where possible.
// Isolated: while waiting, this thread runs no task of another node. Exceptions of body propagate.
template <class Body>
void parallel_for(std::int64_t begin, std::int64_t end, std::int64_t grain, const Body& body,
                  const std::stop_token& stop = {}) {
    check_stop(stop);
    if (end - begin <= grain) {
        if (end > begin) body(begin, end);
        return;
    }
    Meter* meter = Meter::current();
    auto task = [&](std::int64_t lo, std::int64_t hi) {
        MeterScope charge(meter);
        check_stop(stop);
        body(lo, hi);
    };
#if defined(__SANITIZE_THREAD__)
    tsan::parallel_for(begin, end, grain, task);
#else
    tbb::this_task_arena::isolate([&] {
        tbb::parallel_for(tbb::blocked_range<std::int64_t>(begin, end, std::size_t(grain)),
                          [&](const auto& range) { task(range.begin(), range.end()); });
    });
#endif
}

}  // namespace voxloom
