#include "loaded.h"

#include <algorithm>
#include <cassert>
#include <list>

#include "core/base/error.h"

namespace voxloom {

const std::byte* LoadOnce::get(const std::stop_token& stop) {
    if (const std::byte* data = loaded()) return data;
    std::lock_guard lock(mutex_);
    if (const std::byte* data = loaded()) return data;
    check_stop(stop);
    Buffer buffer(bytes_, what_);
    load_(buffer.bytes(), stop);
    buffer_ = std::move(buffer);
    ready_.store(buffer_.data(), std::memory_order_release);
    return buffer_.data();
}

namespace {

class LoadedVolume final : public Volume {
  public:
    LoadedVolume(VolumeDesc desc, std::shared_ptr<LoadOnce> source, std::uint64_t offset)
        : Volume(std::move(desc)), source_(std::move(source)), offset_(offset) {}

    void read(const Box& box, std::span<std::byte> out, const std::stop_token& stop) const override {
        assert(out.size() == box.voxels() * desc().voxel_bytes());
        if (box.empty()) return;
        copy_box(box, source_->get(stop) + offset_, Box::of(desc().dims), out.data(), box,
                 desc().voxel_bytes());
    }
    const std::byte* data() const override {
        const std::byte* all = source_->loaded();
        return all ? all + offset_ : nullptr;
    }
    bool reads_by_region() const override { return false; }
    std::uint64_t resident_bytes() const override { return data() ? desc().dense_bytes() : 0; }

  private:
    std::shared_ptr<LoadOnce> source_;
    std::uint64_t offset_;
};

constexpr std::uint64_t kKeptBytes = 256u << 20;
constexpr std::size_t kKeptSlices = 34;  // a brick of 32 and an apron

class SliceVolume final : public Volume {
  public:
    SliceVolume(VolumeDesc desc, ReadSlice read_slice)
        : Volume(std::move(desc)), read_slice_(std::move(read_slice)) {
        slice_bytes_ = std::uint64_t(this->desc().dims.x) * std::uint64_t(this->desc().dims.y) *
                       this->desc().voxel_bytes();
        most_ = std::max<std::size_t>(kKeptSlices, kKeptBytes / std::max<std::uint64_t>(slice_bytes_, 1));
    }

    void read(const Box& box, std::span<std::byte> out, const std::stop_token& stop) const override {
        assert(out.size() == box.voxels() * desc().voxel_bytes());
        const Index3 dims = desc().dims, n = box.dims();
        const std::uint64_t part = std::uint64_t(n.x) * std::uint64_t(n.y) * desc().voxel_bytes();
        for (std::int64_t z = 0; z < n.z && part > 0; ++z) {
            check_stop(stop);
            Box flat{{box.lo.x, box.lo.y, 0}, {box.hi.x, box.hi.y, 1}};
            auto slice_of = slice(box.lo.z + z);
            copy_box(flat, slice_of->data(), Box::of({dims.x, dims.y, 1}),
                     out.data() + std::uint64_t(z) * part, flat, desc().voxel_bytes());
        }
    }
    std::uint64_t resident_bytes() const override {
        std::lock_guard lock(mutex_);
        return kept_.size() * slice_bytes_;
    }

  private:
    using Slice = std::shared_ptr<const Buffer>;

    Slice slice(std::int64_t z) const {
        std::lock_guard lock(mutex_);
        for (auto it = kept_.begin(); it != kept_.end(); ++it)
            if (it->first == z) {
                kept_.splice(kept_.begin(), kept_, it);
                return it->second;
            }
        auto fresh = std::make_shared<Buffer>(slice_bytes_, "slice of " + desc().name);
        read_slice_(z, fresh->bytes());
        kept_.emplace_front(z, fresh);
        if (kept_.size() > most_) kept_.pop_back();
        return fresh;
    }

    ReadSlice read_slice_;
    std::uint64_t slice_bytes_ = 0;
    std::size_t most_ = 0;
    mutable std::mutex mutex_;  // also around reading: one slice at a time
    mutable std::list<std::pair<std::int64_t, Slice>> kept_;  // last used first
};

}  // namespace

VolumePtr loaded_volume(VolumeDesc desc, std::shared_ptr<LoadOnce> source, std::uint64_t offset) {
    return std::make_shared<LoadedVolume>(std::move(desc), std::move(source), offset);
}

VolumePtr slice_volume(VolumeDesc desc, ReadSlice read_slice) {
    return std::make_shared<SliceVolume>(std::move(desc), std::move(read_slice));
}

}  // namespace voxloom
