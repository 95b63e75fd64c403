// Decoded bricks on the GPU: one 3-D texture cut into slots, one brick each.
//
// A slot holds a brick with an apron of its neighbours' voxels, so that it is interpolated without a look
// at another one; neighbours of one level therefore agree on the face that they share. Bricks stay from
// picture to picture, least recently used out first; those of the running picture stay in any case. Used
// on the OpenGL thread alone; voxels are decoded and converted on all threads.
#pragma once

#include <list>
#include <stop_token>
#include <unordered_map>
#include <vector>

#include "core/data/brick_cache.h"
#include "core/gpu/source.h"

namespace voxloom::slicer {

class Atlas {
  public:
    // `slots` bricks at most, fewer where one texture cannot hold as many. Throws Error where the driver
    // has no room.
    Atlas(const BricksDesc& bricks, const gpu::TexelLayout& layout, Apron apron, std::int64_t slots);
    // Bytes of one slot, for budgets.
    static std::uint64_t slot_bytes(const BricksDesc& bricks, const gpu::TexelLayout& layout, Apron apron);

    struct Counters {
        std::uint64_t hits = 0, uploaded = 0, bytes = 0, evicted = 0;
        bool found_invalid = false;  // a value that is not finite, and no channel to say so
    };
    // Makes all of `wanted` (distinct, at most slots()) resident, through the cache of decoded bricks.
    // progress(fraction) comes now and then.
    Counters load(const BricksPtr& bricks, const std::vector<BrickId>& wanted, const std::stop_token& stop,
                  const std::function<void(double)>& progress);

    std::int64_t slots() const { return slots_; }
    const gpu::TexturePtr& texture() const { return texture_; }
    std::uint64_t bytes() const { return texture_->bytes; }
    const gpu::TexelLayout& layout() const { return layout_; }
    Apron apron() const { return apron_; }

    // Of a brick that the last load() was asked for: the texel of its first own voxel.
    glm::ivec3 texel_of(BrickId id) const;
    // Smallest and largest value within `kReach` voxels of the brick's cells [lo, hi), in voxels from its
    // first; lo > hi where nothing is valid.
    glm::vec2 range_of(BrickId id, glm::ivec3 lo, glm::ivec3 hi) const;
    // Cells on the sides of the blocks that ranges are kept of.
    glm::ivec3 block() const { return block_; }

    static constexpr int kReach = 3;

  private:
    struct Brick {
        BrickId id;
        std::int64_t slot;
        std::uint64_t picture;           // that wanted it last
        std::vector<glm::vec2> ranges;   // of its blocks, x fastest
    };
    using Place = std::list<Brick>::iterator;
    glm::ivec3 corner_of(std::int64_t slot) const;
    void fill(const BricksPtr& bricks, Brick& brick, std::span<std::byte> texels, bool& invalid,
              const std::stop_token& stop) const;

    gpu::TexelLayout layout_;
    Apron apron_;
    glm::ivec3 brick_, side_, grid_{0}, block_, blocks_;
    std::int64_t slots_ = 0;
    gpu::TexturePtr texture_;
    std::list<Brick> order_;             // most recently used first
    std::unordered_map<BrickId, Place, HashOfBrickId> index_;
    std::vector<std::int64_t> free_;
    std::uint64_t picture_ = 0;
};

}  // namespace voxloom::slicer
