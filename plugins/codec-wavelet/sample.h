// Some families of level 0, their voxels kept, so that coders can be trained and steps be tried without
// reading the volume again.
//
// Most families of many volumes hold next to nothing, and a few hold nearly all details. So the sample is stratified:
// families fall into classes by how much goes on in them, an octave each, and every class has an equal share of the
// room. Which of a class are kept depends on their numbers alone, not on the order in which they come.
#pragma once

#include <array>
#include <memory>
#include <mutex>
#include <vector>

#include "plugins/codec-wavelet/byte_store.h"
#include "plugins/codec-wavelet/passes.h"
#include "plugins/codec-wavelet/voxels.h"

namespace voxloom::wavelet {

// Which families of a level stand for all of it: every `step`-th from `first` on, the same whatever the memory.
struct Selection {
    std::int64_t first = 0, step = 1, count = 0;
    std::int64_t family(std::int64_t i) const { return first + i * step; }
    bool has(std::int64_t family) const { return family >= first && (family - first) % step == 0; }
};
Selection select(const TreeDesc& tree, int level, std::int64_t most);

// Families that a sample holds at most: enough for a coder to learn from.
std::int64_t sample_size(const TreeDesc& tree);

class Sample {
  public:
    struct Kept {
        std::uint64_t key = 0;   // a class is sorted by it, which is as good as random
        std::int64_t family = 0;
        std::int64_t slot = 0;
    };
    struct Class {
        std::int64_t seen = 0;   // families of this class that the volume has
        std::vector<Kept> kept;
    };
    static constexpr int kClasses = 16;

    Sample() = default;
    Sample(const TreeDesc& tree, bool in_memory);
    static std::uint64_t bytes(const TreeDesc& tree);

    // Keeps a family's voxels, if it comes to be one of the sample. `activity` is the mean size of its details.
    // Several threads may do so.
    void keep(const TreeDesc& tree, std::int64_t family, const VoxelView& voxels, double activity);
    // After the last one.
    void finish();

    const std::array<Class, kClasses>& classes() const { return classes_; }
    // All that are kept, in the order of their numbers.
    std::vector<Kept> families() const;
    // The voxels of a family that is kept; `buffer` holds them.
    VoxelView get(const TreeDesc& tree, const Kept& kept, Buffer& buffer) const;

  private:
    void shrink_to(Class& one, std::size_t count);

    std::int64_t size_ = 0;
    std::uint64_t stride_ = 0;
    ByteStore store_;
    std::array<Class, kClasses> classes_;   // heaps by key, the largest in front, until finish()
    std::vector<std::int64_t> free_;        // slots
    std::unique_ptr<std::mutex> mutex_;
};

}  // namespace voxloom::wavelet
