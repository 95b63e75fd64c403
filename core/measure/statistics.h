// Stopwatch, and what is said of repeated measurements: median and 95th percentile, not the mean.
#pragma once

#include <cstddef>
#include <span>

#include "core/base/meter.h"

namespace voxloom {

// Wall time since its making or the last restart().
class Stopwatch {
  public:
    void restart() { start_ = wall_ns(); }
    double seconds() const { return double(wall_ns() - start_) * 1e-9; }

  private:
    std::int64_t start_ = wall_ns();
};

struct Statistics {
    std::size_t count = 0;
    double min = 0, max = 0, mean = 0;
    double median = 0, p95 = 0;
};
// Of no samples: all 0. NaNs are left out.
Statistics statistics_of(std::span<const double> samples);

// The value below which the share q (0 to 1) of the samples lies, linear between neighbours in
// order; `sorted` is not empty and rises.
double quantile(std::span<const double> sorted, double q);

}  // namespace voxloom
