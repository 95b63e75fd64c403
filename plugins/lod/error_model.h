// What is wrong with a brick in place of the original, octant by octant, as a fraction of the peak.
#pragma once

#include <array>
#include <functional>
#include <optional>

#include "core/data/bricks.h"
#include "core/data/transfer_function.h"

namespace voxloom::lod {

// Sum over the voxels of level 0 in each octant of the squared error; at level 0 all in [0].
using OctantErrors = std::array<double, 8>;
// Empty where the brick cannot be seen at all.
using ErrorModel = std::function<std::optional<OctantErrors>(BrickId)>;

// Error of the values; the peak is the extent of the volume's values.
ErrorModel value_errors(BricksPtr bricks);

// Error after classification, as a bound: no channel of a ray's colour and opacity is off by more than
// this through the octant, which is 1 at most. For a ray of length L through it, emission tau*c and
// extinction tau off by dC and dt at most, |dRGBA| <= L (dC + dt): what is emitted changes by L dC, what
// the rest is seen through by L dt. dC and dt follow from the largest error of the brick's values and
// the transfer function between the values that can be there.
ErrorModel classified_errors(BricksPtr bricks, TransferPtr transfer);

// How much tau*c (its worst channel) and tau can differ between two values in [lo, hi] that are at
// most `distance` apart: the sum of both, per world length.
double largest_change(const TransferFunction& transfer, double lo, double hi, double distance);

}  // namespace voxloom::lod
