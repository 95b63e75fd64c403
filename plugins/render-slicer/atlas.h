// Decoded bricks on the GPU: one 3-D texture, and a second and third one like it for gradients and colours.
//
// Levels that fit lie in it as they are, each as one grid of voxels of which only the bricks that were asked
// for are there: bricks that lie side by side in space do so in the texture, and a ray goes from one to
// the next without noticing. Larger ones are cut into slots, one brick each with an apron of its neighbours'
// voxels, so that it is interpolated without a look at another one; neighbours of one level therefore agree
// on the face that they share. Bricks stay from picture to picture; where slots are short the least recently
// used go first, but none of the running picture. Used on the OpenGL thread alone; voxels are decoded and
// converted on all threads.
#pragma once

#include <list>
#include <functional>
#include <optional>
#include <stop_token>
#include <unordered_map>
#include <vector>

#include "plugins/render-slicer/brick_texels.h"

namespace voxloom::slicer {

// Where in the texture bricks go.
struct Places {
    glm::ivec3 dims{0};                    // of the texture
    std::int64_t slots = 0;                // bricks that have room at once
    glm::ivec3 grid{0};                    // of slots; 0: whole levels
    int first_level = 0;                   // whole levels: the finest that is there ...
    std::vector<glm::ivec3> origin;        // ... and where each level begins, with its apron
    bool whole() const { return !origin.empty(); }

    // All levels from the finest on that `bytes` have room for with all coarser ones. Empty where not even
    // the coarsest fits.
    static std::optional<Places> whole_levels(const BricksDesc& bricks, Apron apron, std::uint64_t texel_bytes,
                                              std::uint64_t bytes);
    // Slots for `wanted` bricks, fewer where one texture cannot hold as many.
    static Places in_slots(const BricksDesc& bricks, Apron apron, std::int64_t wanted);
};

class Atlas {
  public:
    // Throws Error where the driver has no room.
    Atlas(const BricksPtr& bricks, const Texels& texels, Apron apron, const Places& places);
    // Bytes of one slot, for budgets.
    static std::uint64_t slot_bytes(const BricksDesc& bricks, Apron apron, std::uint64_t texel_bytes);

    struct Counters {
        std::uint64_t hits = 0, uploaded = 0, bytes = 0, evicted = 0;
        bool found_invalid = false;  // a value that is not finite, and no channel to say so
    };
    // Makes all of `wanted` (distinct, at most slots()) resident, through the cache of decoded bricks.
    // progress(fraction) comes now and then.
    Counters load(const BricksPtr& bricks, const std::vector<WantedBrick>& wanted, const std::stop_token& stop,
                  const std::function<void(double)>& progress);

    bool has(const WantedBrick& brick) const;  // with this mixture
    bool is_resident(BrickId id) const { return index_.contains(id); }  // with whatever mixture
    // Whether a brick or one that it shares voxels with is resident with its parent mixed in, so that values may be
    // met in it that are not its own.
    bool may_show_mixture(BrickId id) const;
    std::int64_t slots() const { return places_.slots; }
    const Places& places() const { return places_; }
    const gpu::TexturePtr& values() const { return values_; }
    const gpu::TexturePtr& gradients() const { return gradients_; }  // RGBA16_SNORM, null where not kept
    const gpu::TexturePtr& colours() const { return colours_; }      // RGBA32F, null where not kept
    std::uint64_t bytes() const;
    const Texels& texels() const { return texels_; }
    Apron apron() const { return apron_; }

    // Of a brick that the last load() was asked for: the texel of its first own voxel. Of whole levels: of
    // any brick, whose values lie within its info().range where it was never asked for.
    glm::ivec3 texel_of(BrickId id) const;
    // Smallest and largest value within kReach voxels of level 0 of the brick's cells [lo, hi), in voxels from its
    // first; lo > hi where nothing is valid.
    glm::vec2 range_of(BrickId id, glm::ivec3 lo, glm::ivec3 hi) const;
    // Cells on the sides of the blocks that ranges are kept of.
    glm::ivec3 block() const { return block_; }

  private:
    struct Brick {
        WantedBrick wanted;
        std::int64_t slot = 0;
        std::uint64_t picture = 0;       // that wanted it last
        bool spoilt = false;             // voxels on its faces are a neighbour's mixture
        std::vector<glm::vec2> ranges;   // of its blocks, x fastest
    };
    using Place = std::list<Brick>::iterator;
    glm::ivec3 corner_of(const Brick& brick) const;
    void begin_level(const Bricks& bricks, int level);
    bool keep(const WantedBrick& brick);
    bool find_slot(std::int64_t& slot);
    void spoil_neighbours(const WantedBrick& loaded);
    // Calls f(brick) for the resident ones of a brick and the 26 about it.
    template <class F>
    void for_each_around(BrickId id, const F& f) const {
        for (int o = 0; o < 27; ++o) {
            const auto it = index_.find({id.level, id.index + glm::ivec3(o % 3, o / 3 % 3, o / 9) - 1});
            if (it != index_.end()) f(*it->second);
        }
    }

    Texels texels_;
    Apron apron_;
    Places places_;
    glm::ivec3 brick_, side_, block_, blocks_;
    gpu::TexturePtr values_, gradients_, colours_;
    std::list<Brick> order_;             // most recently used first
    std::unordered_map<BrickId, Place, HashOfBrickId> index_;
    std::vector<std::int64_t> free_;
    std::vector<bool> begun_;            // whole levels
    std::uint64_t picture_ = 0;
};

}  // namespace voxloom::slicer
