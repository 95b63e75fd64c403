#include "plugins/codec-wavelet/sample.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <numeric>

namespace voxloom::wavelet {

namespace {

std::uint64_t family_bytes(const TreeDesc& tree) {
    return box_of(tree, family_at(tree, 0, 0)).voxels() * (tree.bricks.volume.voxel_bytes() + tree.bricks.volume.has_mask);
}

std::int64_t room(const TreeDesc& tree) { return std::min(sample_size(tree), family_count(tree, 0)); }

bool by_key(const Sample::Kept& a, const Sample::Kept& b) { return a.key < b.key; }

// SplitMix64 (Steele, Lea, Flood 2014): different numbers, different keys.
std::uint64_t key_of(std::int64_t family) {
    std::uint64_t z = (std::uint64_t(family) + 1) * 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

}  // namespace

Selection select(const TreeDesc& tree, int level, std::int64_t most) {
    const std::int64_t all = family_count(tree, level), step = std::max<std::int64_t>(1, (all + most - 1) / most);
    const std::int64_t first = step / 2;
    return {first, step, (all - first + step - 1) / step};
}

std::int64_t sample_size(const TreeDesc& tree) {
    constexpr std::int64_t families = 384, voxels = families * 32 * 32 * 32;
    return std::clamp<std::int64_t>(voxels / std::int64_t(box_of(tree, family_at(tree, 0, 0)).voxels()), Sample::kClasses, families);
}

std::uint64_t Sample::bytes(const TreeDesc& tree) { return std::uint64_t(room(tree)) * family_bytes(tree); }

Sample::Sample(const TreeDesc& tree, bool in_memory)
    : size_(room(tree)), stride_(family_bytes(tree)), store_(bytes(tree), in_memory, "sample of the voxels"),
      free_(static_cast<std::size_t>(size_)), mutex_(std::make_unique<std::mutex>()) {
    std::iota(free_.begin(), free_.end(), std::int64_t(0));
}

void Sample::shrink_to(Class& one, std::size_t count) {
    while (one.kept.size() > count) {
        std::pop_heap(one.kept.begin(), one.kept.end(), by_key);
        free_.push_back(one.kept.back().slot);
        one.kept.pop_back();
    }
}

void Sample::keep(const TreeDesc& tree, std::int64_t family, const VoxelView& voxels, double activity) {
    Class& mine = classes_[std::size_t(std::min(kClasses - 1, int(std::bit_width(std::uint64_t(std::min(activity, 1e9) * 16)))))];
    const std::uint64_t key = key_of(family);
    const std::lock_guard lock(*mutex_);
    const bool is_new = mine.seen++ == 0;
    // A class can only lose room, so whoever was turned away would not have stayed.
    const auto met = std::count_if(classes_.begin(), classes_.end(), [](const Class& c) { return c.seen > 0; });
    const auto share = std::size_t(std::max<std::int64_t>(1, size_ / met));
    if (is_new)
        for (Class& one : classes_) shrink_to(one, share);
    if (mine.kept.size() == share) {
        if (key > mine.kept.front().key) return;
        shrink_to(mine, share - 1);
    }
    assert(!free_.empty() && "shares add up to no more than there is");
    const Kept kept{key, family, free_.back()};
    free_.pop_back();
    mine.kept.push_back(kept);
    std::push_heap(mine.kept.begin(), mine.kept.end(), by_key);

    const Box box = box_of(tree, family_at(tree, 0, family));
    Buffer own(box.voxels() * voxels.voxel_bytes, "sample of the voxels");
    copy_box(box, voxels.data, voxels.box, own.data(), box, voxels.voxel_bytes);
    const std::uint64_t at = std::uint64_t(kept.slot) * stride_;
    store_.write(at, own.bytes());
    if (!voxels.mask) return;
    const Mask mask = mask_of(voxels, box);
    store_.write(at + own.size(), std::as_bytes(std::span(mask)));
}

void Sample::finish() {
    for (Class& one : classes_) std::sort(one.kept.begin(), one.kept.end(), by_key);
}

std::vector<Sample::Kept> Sample::families() const {
    std::vector<Kept> all;
    for (const Class& one : classes_) all.insert(all.end(), one.kept.begin(), one.kept.end());
    std::sort(all.begin(), all.end(), [](const Kept& a, const Kept& b) { return a.family < b.family; });
    return all;
}

VoxelView Sample::get(const TreeDesc& tree, const Kept& kept, Buffer& buffer) const {
    const Box box = box_of(tree, family_at(tree, 0, kept.family));
    const std::size_t each = tree.bricks.volume.voxel_bytes();
    const bool masked = tree.bricks.volume.has_mask;
    buffer = Buffer(box.voxels() * (each + masked), "sample of the voxels");
    store_.read(std::uint64_t(kept.slot) * stride_, buffer.bytes());
    return {box, buffer.data(), each, masked ? buffer.as<std::uint8_t>().data() + box.voxels() * each : nullptr};
}

}  // namespace voxloom::wavelet
