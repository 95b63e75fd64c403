// Blocks of voxels: what values are in them, and how far one may leap.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <stop_token>
#include <vector>

#include "core/data/volume.h"

namespace voxloom::slicer {

// Smallest and largest value that reconstruction can meet in each block of `size` cells a side and
// within `reach` voxels of it: its voxels, the layer shared with the next block, and for cubic
// kernels one more layer and their overshoot. lo > hi where no voxel is valid. Colours count by their luma.
struct BlockRanges {
    int size = 8;
    glm::ivec3 grid{0};             // blocks; x fastest
    std::vector<glm::vec2> ranges;  // in the volume's values
    ValueRange all;                 // what reconstruction can meet anywhere
    std::size_t count() const { return ranges.size(); }
};
BlockRanges block_ranges(const Volume& volume, int component, int size, int reach,
                         bool cubic, const std::stop_token& stop);

// Catmull-Rom weights sum to 1 with absolute sum at most 1.25 an axis: how far a value may overshoot
// half the range of its footprint, in three axes.
inline constexpr double kCubicOvershoot = 1.25 * 1.25 * 1.25;

// For each block the chessboard distance, in blocks and at most 127, to the nearest block of the
// other kind: positive in blocks that are seen, negative in those that are not. All blocks nearer
// than that are of the block's own kind, so one look leaps over them.
std::vector<std::int8_t> leaps(glm::ivec3 grid, const std::vector<std::uint8_t>& seen);

}  // namespace voxloom::slicer
