#include "plugins/codec-wavelet/sample.h"

#include <algorithm>

namespace voxloom::wavelet {

namespace {

std::uint64_t family_bytes(const TreeDesc& tree) {
    return box_of(tree, family_at(tree, 0, 0)).voxels() * (tree.bricks.volume.voxel_bytes() + tree.bricks.volume.has_mask);
}

}  // namespace

Selection select(const TreeDesc& tree, int level, std::int64_t most) {
    const std::int64_t all = family_count(tree, level), step = std::max<std::int64_t>(1, (all + most - 1) / most);
    const std::int64_t first = step / 2;
    return {first, step, (all - first + step - 1) / step};
}

std::int64_t sample_size(const TreeDesc& tree) {
    constexpr std::int64_t families = 384, voxels = families * 32 * 32 * 32;
    return std::clamp<std::int64_t>(voxels / std::int64_t(box_of(tree, family_at(tree, 0, 0)).voxels()), 16, families);
}

std::uint64_t Sample::bytes(const TreeDesc& tree) {
    return std::uint64_t(select(tree, 0, sample_size(tree)).count) * family_bytes(tree);
}

Sample::Sample(const TreeDesc& tree, bool in_memory)
    : selection_(select(tree, 0, sample_size(tree))), stride_(family_bytes(tree)),
      store_(bytes(tree), in_memory, "sample of the voxels") {}

void Sample::keep(const TreeDesc& tree, std::int64_t family, const VoxelView& voxels) {
    if (!selection_.has(family)) return;
    const Box box = box_of(tree, family_at(tree, 0, family));
    Buffer own(box.voxels() * voxels.voxel_bytes, "sample of the voxels");
    copy_box(box, voxels.data, voxels.box, own.data(), box, voxels.voxel_bytes);
    const std::uint64_t at = std::uint64_t(selection_.slot(family)) * stride_;
    store_.write(at, own.bytes());
    if (!voxels.mask) return;
    const Mask mask = mask_of(voxels, box);
    store_.write(at + own.size(), std::as_bytes(std::span(mask)));
}

VoxelView Sample::get(const TreeDesc& tree, std::int64_t i, Buffer& buffer) const {
    const Box box = box_of(tree, family_at(tree, 0, selection_.family(i)));
    const std::size_t each = tree.bricks.volume.voxel_bytes();
    const bool masked = tree.bricks.volume.has_mask;
    buffer = Buffer(box.voxels() * (each + masked), "sample of the voxels");
    store_.read(std::uint64_t(i) * stride_, buffer.bytes());
    return {box, buffer.data(), each, masked ? buffer.as<std::uint8_t>().data() + box.voxels() * each : nullptr};
}

}  // namespace voxloom::wavelet
