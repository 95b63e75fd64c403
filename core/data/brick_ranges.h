// Value ranges of bricks, each with the first layer of its neighbours' voxels, from bricks that are at hand
// one at a time.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "core/data/bricks.h"

namespace voxloom {

// Smallest and largest finite value of a brick and of its outer layers: along each axis all of it, its
// first or its last layer (digits 0, 1, 2 in base 3, x lowest). min > max where nothing is finite.
struct BrickParts {
    std::array<ValueRange, 27> range;
};
// `voxels` is a dense array of `voxels_box`, which holds `brick`.
BrickParts parts_of(const Box& brick, const std::byte* voxels, const Box& voxels_box, ScalarType type, int components);

// Fills BrickInfo::range of level 0 from the parts of every brick of it, both x fastest.
void fill_fine_ranges(const BricksDesc& desc, std::span<const BrickParts> parts, std::vector<BrickInfo>& infos);

}  // namespace voxloom
