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

}  // namespace voxloom::editor
