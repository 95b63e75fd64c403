// Memory for voxels: 64-byte aligned, uninitialised, metered.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

#include "core/base/types.h"

namespace voxloom {

class Meter;

class Buffer {
  public:
    Buffer() = default;
    // Throws Error, naming `what` and the size, when the memory is not there.
    explicit Buffer(std::uint64_t bytes, std::string_view what = "buffer");
    Buffer(Buffer&& other) noexcept;
    Buffer& operator=(Buffer&& other) noexcept;
    ~Buffer();

    std::byte* data() { return data_; }
    const std::byte* data() const { return data_; }
    std::uint64_t size() const { return size_; }
    std::span<std::byte> bytes() { return {data_, size_}; }
    std::span<const std::byte> bytes() const { return {data_, size_}; }
    template <class T>
    std::span<T> as() {
        return {reinterpret_cast<T*>(data_), size_ / sizeof(T)};
    }
    template <class T>
    std::span<const T> as() const {
        return {reinterpret_cast<const T*>(data_), size_ / sizeof(T)};
    }

  private:
    std::byte* data_ = nullptr;
    std::uint64_t size_ = 0;
};

std::uint64_t buffer_bytes_in_use();  // of the whole process
std::uint64_t buffer_bytes_peak();

// Copies the voxels of `box` between two dense arrays (x fastest). `from_box` and `to_box` say which
// voxels each array holds; both must contain `box`. voxel_bytes covers all components.
void copy_box(const Box& box, const std::byte* from, const Box& from_box, std::byte* to,
              const Box& to_box, std::size_t voxel_bytes);

}  // namespace voxloom
