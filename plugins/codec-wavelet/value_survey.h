// What must be known of the values before they are mapped: their range, and whether they lie on a grid.
#pragma once

#include <stop_token>

#include "plugins/codec-wavelet/passes.h"
#include "plugins/codec-wavelet/value_map.h"

namespace voxloom::wavelet {

struct ValueSurvey {
    ValueRange range;  // of what is finite and valid; {0, 0} where nothing is
    // Floats that are all multiples of 1/2^n or 1/10^n, as decimal numbers in a text become: the step of the coarsest
    // such grid on which the tree's integers are exact. 0: none.
    double grid = 0;
};

// Reads the volume once, in tiles of no more than `most_voxels`.
ValueSurvey survey(const Volume& volume, const TreeDesc& tree, std::uint64_t most_voxels, const std::stop_token& stop,
                   const Progress& progress);

}  // namespace voxloom::wavelet
