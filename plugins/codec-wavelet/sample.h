// Some families of level 0, their voxels kept, so that coders can be trained and steps be tried without
// reading the volume again.
#pragma once

#include "plugins/codec-wavelet/byte_store.h"
#include "plugins/codec-wavelet/passes.h"
#include "plugins/codec-wavelet/voxels.h"

namespace voxloom::wavelet {

// Which families of a level stand for all of it: every `step`-th from `first` on, the same whatever the memory.
struct Selection {
    std::int64_t first = 0, step = 1, count = 0;
    std::int64_t family(std::int64_t i) const { return first + i * step; }
    bool has(std::int64_t family) const { return family >= first && (family - first) % step == 0; }
    std::int64_t slot(std::int64_t family) const { return (family - first) / step; }
};
Selection select(const TreeDesc& tree, int level, std::int64_t most);

// Families that a sample holds: enough for a coder to learn from.
std::int64_t sample_size(const TreeDesc& tree);

class Sample {
  public:
    Sample() = default;
    Sample(const TreeDesc& tree, bool in_memory);
    static std::uint64_t bytes(const TreeDesc& tree);

    const Selection& selection() const { return selection_; }
    // Keeps a family's voxels, if it is one of the sample. Several threads may do so.
    void keep(const TreeDesc& tree, std::int64_t family, const VoxelView& voxels);
    // The voxels of family i of the selection; `buffer` holds them.
    VoxelView get(const TreeDesc& tree, std::int64_t i, Buffer& buffer) const;

  private:
    Selection selection_;
    std::uint64_t stride_ = 0;
    ByteStore store_;
};

}  // namespace voxloom::wavelet
