// Volumes whose voxels come all at once, or a slice at a time.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <stop_token>

#include "core/data/volume.h"

namespace voxloom {

// Loads what it holds when it is first asked for, once, whoever asks; a load that fails or is
// cancelled leaves it unloaded. Shared by the steps of a file that can only be read whole.
class LoadOnce {
  public:
    using Load = std::function<void(std::span<std::byte> out, const std::stop_token& stop)>;
    LoadOnce(std::uint64_t bytes, std::string what, Load load)
        : bytes_(bytes), what_(std::move(what)), load_(std::move(load)) {}
    const std::byte* get(const std::stop_token& stop);
    const std::byte* loaded() const { return ready_.load(std::memory_order_acquire); }

  private:
    std::uint64_t bytes_;
    std::string what_;
    Load load_;
    std::mutex mutex_;
    Buffer buffer_;
    std::atomic<const std::byte*> ready_{nullptr};
};

// The part of `source` that begins at `offset`. data() is there once something was read.
VolumePtr loaded_volume(VolumeDesc desc, std::shared_ptr<LoadOnce> source, std::uint64_t offset = 0);

// A volume whose slices are read one by one. Slices read last are kept, as many as a brick is thick
// or 256 MiB, so that going through bricks layer by layer reads each slice once.
using ReadSlice = std::function<void(std::int64_t z, std::span<std::byte> out)>;
VolumePtr slice_volume(VolumeDesc desc, ReadSlice read_slice);

}  // namespace voxloom
