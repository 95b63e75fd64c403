#include "core/measure/statistics.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/measure/sum.h"

namespace voxloom {

double quantile(std::span<const double> sorted, double q) {
    double position = q * double(sorted.size() - 1);
    std::size_t below = std::min(std::size_t(position), sorted.size() - 1);
    std::size_t above = std::min(below + 1, sorted.size() - 1);
    return std::lerp(sorted[below], sorted[above], position - double(below));
}

Statistics statistics_of(std::span<const double> samples) {
    std::vector<double> sorted;
    std::copy_if(samples.begin(), samples.end(), std::back_inserter(sorted),
                 [](double v) { return !std::isnan(v); });
    if (sorted.empty()) return {};
    std::sort(sorted.begin(), sorted.end());
    Sum sum;
    for (double v : sorted) sum.add(v);
    return {sorted.size(), sorted.front(), sorted.back(), sum.value() / double(sorted.size()),
            quantile(sorted, 0.5), quantile(sorted, 0.95)};
}

}  // namespace voxloom
