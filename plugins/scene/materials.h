// Where one material ends and the next begins, from the histogram alone.
#pragma once

#include <stop_token>
#include <vector>

#include "core/data/value.h"

namespace voxloom::scene {

// `count` values that part the data into count+1 classes: Otsu's criterion for several thresholds
// (Otsu 1979, section IV; Liao, Chen & Chung 2001), on the histogram's square root, so that a
// background of nearly all voxels does not take every threshold for itself. Rising, inside
// `range`, equal where the data has fewer classes.
std::vector<double> material_boundaries(const Value& data, ValueRange range, int count,
                                        const std::stop_token& stop);

}  // namespace voxloom::scene
