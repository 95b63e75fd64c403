// What BrickInfo says of every brick, measured on what the decoder will give.
#pragma once

#include <stop_token>

#include "plugins/codec-wavelet/level_store.h"
#include "plugins/codec-wavelet/wavelet_bricks.h"

namespace voxloom::wavelet {

// Finite values of level 0, part of brick by part: the smallest and largest of all of it and of its
// outer layers, from which the range of a brick with its neighbours' first layer follows.
struct BrickParts {
    std::array<ValueRange, 27> range;  // along each axis: all, first layer, last layer
};
BrickParts parts_of(const Box& brick, const std::byte* voxels, const Box& voxels_box, ScalarType type, int components);

// Fills ranges of level 0 from `parts` (of every brick of level 0).
void fill_fine_ranges(const BricksDesc& desc, std::span<const BrickParts> parts, std::vector<BrickInfo>& infos);

// Fills ranges and errors of the levels above 0. `decoded` are the levels' integers ([0] is not used).
void fill_coarse(const TreeDesc& tree, std::span<const LevelStore> decoded, const Volume& volume,
                 std::vector<std::vector<BrickInfo>>& infos, const std::stop_token& stop);

}  // namespace voxloom::wavelet
