// A volume to a body-centred cubic lattice.
#pragma once

#include <functional>
#include <optional>
#include <stop_token>

#include "plugins/lattice-bcc/bcc.h"
#include "plugins/lattice-bcc/filters.h"

namespace voxloom::bcc {

struct ResampleOptions {
    std::optional<Filter> filter;  // none: the volume's closed form is evaluated at every site
    double step = kSameBand;       // A's spacing over the volume's; not above kSameBand, or there would be aliases
    ScalarType type = ScalarType::f32;
};

// The volume is read slice by slice, once a grid and component, and once before where there may be something that is not valid.
// Memory beside the lattice is eight bytes for each of its sites, for each component, and for half of the volume's voxels; five
// times the sites' where something is not valid.
//
// What is not finite, or masked out, takes no part: a site whose footprint of four samples an axis touches such a voxel takes
// the trilinear mean of those of its eight neighbours that are valid, and is NaN (of integers: masked out) where none
// with a weight is left. The B-spline has no such footprint; Catmull-Rom takes its place in those volumes.
// Throws Error where there is no closed form to evaluate, Cancelled when asked to stop.
LatticePtr resample(const Volume& volume, const ResampleOptions& options, const std::stop_token& stop = {},
                    const std::function<void(double)>& progress = {});

}  // namespace voxloom::bcc
