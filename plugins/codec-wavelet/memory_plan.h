// How an encoder shares out the memory that it may take. What does not fit goes to temporary files; the
// bytes that are written do not depend on it.
#pragma once

#include "plugins/codec-wavelet/encoder.h"

namespace voxloom::wavelet {

struct MemoryPlan {
    std::uint64_t tile_voxels = 1;         // of level 0, that are in hand at a time
    std::uint64_t coarse_tile_voxels = 1;  // of the other levels
    int first_level_in_memory = 1;         // it and all coarser ones are
    bool sample_in_memory = true;
    std::uint64_t payload = 0;             // compressed bytes that are held before they go to a file
};

// A quarter of the machine's memory.
std::uint64_t default_memory();
// With `limit` bytes beside the volume's own; 0: default_memory(). Throws Error, saying the least that works.
MemoryPlan plan_memory(const Volume& volume, const TreeDesc& tree, std::uint64_t limit);
std::uint64_t least_memory(const Volume& volume, const TreeDesc& tree);

}  // namespace voxloom::wavelet
