// How often each value occurs in a volume, for the transfer function's editor.
#pragma once

#include <memory>
#include <stop_token>
#include <vector>

#include "core/data/volume.h"

namespace voxloom::editor {

struct Histogram {
    ValueRange range;
    std::vector<double> counts;  // of equal bins over the range; not finite values are left out
    bool sampled = false;        // of a part of the voxels alone, spread over the whole volume
};

inline constexpr std::size_t kHistogramBins = 256;

// Of the first component. Of larger volumes about `most_voxels` are read, in whole rows.
Histogram histogram_of(const Volume& volume, const std::stop_token& stop = {},
                       std::uint64_t most_voxels = std::uint64_t(4) << 20);

// How often each value occurs with each gradient: boundaries between materials are arcs in it.
struct GradientHistogram {
    // kHistogramBins values, equal bins over `range` of the histogram, times kGradientBins gradients, the
    // smallest first. A gradient is a change by this share of the range along the shortest spacing; bins are
    // equal in its logarithm, from kLeastGradient to 1, and smaller and larger ones are in the outermost.
    std::vector<double> counts;
};
inline constexpr std::size_t kGradientBins = 64;
inline constexpr double kLeastGradient = 1e-3;

// By central differences of the first component in the world, one-sided at the border.
GradientHistogram gradient_histogram_of(const Volume& volume, ValueRange range, const std::stop_token& stop = {},
                                        std::uint64_t most_voxels = std::uint64_t(1) << 20);

}  // namespace voxloom::editor
