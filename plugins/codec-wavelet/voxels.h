// Original voxels of a box, and the integers of the tree that they become.
#pragma once

#include <stop_token>

#include "core/data/volume.h"
#include "plugins/codec-wavelet/mask_layer.h"
#include "plugins/codec-wavelet/tree.h"

namespace voxloom::wavelet {

// Voxels in the order of `box`; those of a box inside are rows of it. Refers to memory of others.
struct VoxelView {
    Box box;
    const std::byte* data = nullptr;
    std::size_t voxel_bytes = 1;
    const std::uint8_t* mask = nullptr;  // 1 where a voxel is valid; null: all are

    std::size_t place(std::int64_t x, std::int64_t y, std::int64_t z) const {
        const Index3 n = box.dims();
        return std::size_t(((z - box.lo.z) * n.y + y - box.lo.y) * n.x + x - box.lo.x);
    }
    const std::byte* row(std::int64_t x, std::int64_t y, std::int64_t z) const { return data + place(x, y, z) * voxel_bytes; }
    const std::uint8_t* mask_row(std::int64_t x, std::int64_t y, std::int64_t z) const { return mask ? mask + place(x, y, z) : nullptr; }
};
Mask mask_of(const VoxelView& voxels, const Box& box);

// A box of the volume: where that is in memory itself, else read into a buffer by all threads.
class VoxelTile {
  public:
    VoxelTile(const Volume& volume, const Box& box, const std::stop_token& stop);
    const VoxelView& view() const { return view_; }

  private:
    Buffer voxels_, mask_;
    VoxelView view_;
};

// The tree's integers of a family of level 0. What is not finite or not valid is filled from what is near: a jump would
// cost details. Shared faces are filled from what they hold themselves. `planes` may be those of another family:
// memory is got anew only where it does not do.
void integers_of(const TreeDesc& tree, const VoxelView& voxels, FamilyId family, FamilyCodec::Planes& planes);

}  // namespace voxloom::wavelet
