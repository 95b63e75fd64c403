#include "core/base/buffer.h"

#include <cassert>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "core/base/error.h"
#include "core/base/meter.h"

namespace voxloom {

namespace {
constexpr std::uint64_t kAlignment = 64;
std::atomic<std::int64_t> in_use{0};
std::atomic<std::int64_t> peak{0};

// A node is charged for what it allocates; freeing happens on any thread, often long after the
// node's meter is gone, so only frees by the node itself are credited to it.
void charge(std::int64_t bytes) {
    std::int64_t now = in_use += bytes;
    std::int64_t before = peak;
    while (now > before && !peak.compare_exchange_weak(before, now)) {
    }
    if (Meter* meter = Meter::current()) meter->add_bytes(bytes);
}
}  // namespace

Buffer::Buffer(std::uint64_t bytes, std::string_view what) : size_(bytes) {
    if (bytes == 0) return;
    std::uint64_t rounded = (bytes + kAlignment - 1) / kAlignment * kAlignment;
    if (rounded >= bytes) data_ = static_cast<std::byte*>(std::aligned_alloc(kAlignment, rounded));
    if (!data_)
        fail("{}: {:.1f} MiB of memory are not available", what, double(bytes) / (1 << 20));
    charge(std::int64_t(bytes));
}

Buffer::Buffer(Buffer&& other) noexcept
    : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)) {}

Buffer& Buffer::operator=(Buffer&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    return *this;
}

Buffer::~Buffer() {
    if (!data_) return;
    std::free(data_);
    charge(-std::int64_t(size_));
}

std::uint64_t buffer_bytes_in_use() { return std::uint64_t(in_use.load()); }
std::uint64_t buffer_bytes_peak() { return std::uint64_t(peak.load()); }

void copy_box(const Box& box, const std::byte* from, const Box& from_box, std::byte* to,
              const Box& to_box, std::size_t voxel_bytes) {
    if (box.empty()) return;
    assert(from_box.contains(box) && to_box.contains(box));
    const Index3 fd = from_box.dims(), td = to_box.dims(), n = box.dims();
    const std::size_t row = std::size_t(n.x) * voxel_bytes;
    for (std::int64_t z = box.lo.z; z < box.hi.z; ++z) {
        for (std::int64_t y = box.lo.y; y < box.hi.y; ++y) {
            const std::int64_t f = ((z - from_box.lo.z) * fd.y + (y - from_box.lo.y)) * fd.x +
                                   (box.lo.x - from_box.lo.x);
            const std::int64_t t = ((z - to_box.lo.z) * td.y + (y - to_box.lo.y)) * td.x +
                                   (box.lo.x - to_box.lo.x);
            std::memcpy(to + std::size_t(t) * voxel_bytes, from + std::size_t(f) * voxel_bytes,
                        row);
        }
    }
}

}  // namespace voxloom
