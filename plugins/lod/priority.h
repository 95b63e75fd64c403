// Error-driven selection: the queue of Guthe, Wand, Gonser, Strasser (Interactive Rendering of Large
// Volume Data Sets, 2002, section 4.2), with what the paper leaves open filled in.
#pragma once

#include <stop_token>

#include "plugins/lod/cut.h"
#include "plugins/lod/error_model.h"

namespace voxloom::lod {

struct PriorityLimits {
    std::int64_t bricks = 2048;  // that draw anything; a brick replaced in part still counts
    double error = 0;            // expected error of a covered pixel at which a brick is good enough
    double pixels = 1;           // a brick whose voxels are no further apart in the picture is never split
};

struct PriorityResult {
    Cut cut;
    // sqrt of the sum of (E/z)^2 over everything drawn, z in units of the volume's diagonal and not
    // below a thousandth: never rises with the budget.
    double sum = 0;
};

// From the coarsest level on, the octant whose error weighs most, E/z, gets its own brick, until the
// budget is used up or everything is good enough.
//
// A brick's priority is E/z of the octants that it still draws, so it neither starves nor stays in
// front of the queue when its worst octant is gone. Octants outside of the view and bricks that cannot
// be seen cost nothing. A child's error is at most what its parent's was there. Ties are broken by
// error, then by place, so the result is a function of the input; each budget's result extends that of
// a smaller one.
PriorityResult select_by_priority(const BricksDesc& bricks, const ErrorModel& errors, const Sight& sight,
                                  const PriorityLimits& limits, const std::stop_token& stop = {});

// Expected error of a pixel that the given octants of a brick cover: the RMS error of their voxels, less
// where several voxels share the pixel.
double pixel_error(double squared, double voxels, double pixels_per_voxel);

// For selections made by other rules: the pixel error of every brick of a cut, and which of them cannot
// be seen (drawn becomes false).
void predict_errors(Cut& cut, const BricksDesc& bricks, const ErrorModel& errors, const Sight* sight);
// Where bricks blend, what their parents' errors there add to that: ((1-s) a + s b)^2 is at most a^2 + b^2, whatever the
// shares s; of bounds the larger one holds.
void add_blend_errors(Cut& cut, const BricksDesc& bricks, const ErrorModel& errors, const Sight* sight);

}  // namespace voxloom::lod
