// Value ranges of bricks with the first layer of their neighbours, gathered brick by brick.
#pragma once

#include <array>

#include "plugins/codec-wavelet/voxels.h"

namespace voxloom::wavelet {

// Finite values of a brick, part by part: along each axis all of it, its first layer, or its last one. A
// neighbour's range needs just one of these parts.
struct BrickParts {
    std::array<ValueRange, 27> range;  // x fastest; an empty one has min > max
};
BrickParts no_parts();
BrickParts parts_of(const Box& brick, const VoxelView& voxels, ScalarType type, int components);
// The same of a plane of the tree's integers, as region() delivers them, which takes `parts` along.
void add_parts(const TreeDesc& tree, const Box& brick, const std::vector<std::int32_t>& plane, const Box& box, BrickParts& parts);
// A sample of a coarse level as region() delivers it.
double delivered(const TreeDesc& tree, std::int32_t v);

// Before the first brick, and after the last one: bricks without a finite value have {0, 0}.
void begin_ranges(std::vector<BrickInfo>& infos);
void end_ranges(std::vector<BrickInfo>& infos);
// Widens the ranges of the brick and of its neighbours; infos are those of its level.
void widen_ranges(const BricksDesc& desc, BrickId id, const BrickParts& parts, std::vector<BrickInfo>& infos);

}  // namespace voxloom::wavelet
