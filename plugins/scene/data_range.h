// What the data wired to `fit` says of itself.
#pragma once

#include <functional>

#include "core/data/value.h"

namespace voxloom::scene {

// Smallest and largest finite value of a Volume, of Bricks (level 0) or of all steps of a Series.
// Taken from descriptions where they have it, else every voxel is read. At most `max_steps` steps of
// a Series, evenly spread, are looked at; 0: all of them.
ValueRange data_range(const Value& data, std::size_t max_steps, const std::stop_token& stop,
                      const std::function<void(double)>& progress);

// The smallest spacing of the axes along which there is more than one voxel, of all axes where there
// is none; 0 where nothing is known.
double voxel_spacing(const Value& data);

}  // namespace voxloom::scene
