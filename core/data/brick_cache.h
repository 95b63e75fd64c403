// The one cache of decoded bricks, above every codec.
//
// Byte limit, least recently used out first, pins, and each family decoded once however many
// threads ask. Ancestors are fetched as needed. Bricks that are pinned or in someone's hands stay.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <stop_token>

#include "core/data/bricks.h"

namespace voxloom {

class BrickCache {
  public:
    struct Counters {
        std::uint64_t hits = 0, misses = 0;      // bricks asked for
        std::uint64_t families_decoded = 0;
        std::uint64_t bricks_evicted = 0;
        std::uint64_t waits = 0;                 // asked for while another thread was decoding it
        std::uint64_t bytes = 0, peak_bytes = 0; // decoded voxels held
    };

    explicit BrickCache(std::uint64_t byte_limit);
    ~BrickCache();
    BrickCache(const BrickCache&) = delete;
    BrickCache& operator=(const BrickCache&) = delete;

    // The process's cache; its limit is set by the runtime.
    static BrickCache& global();

    void set_byte_limit(std::uint64_t bytes);
    std::uint64_t byte_limit() const;
    Counters counters() const;

    // The decoded brick; decodes its family, and first its ancestors, where they are not there.
    // Throws Error when the limit cannot hold the family together with what is pinned.
    BrickVoxelsPtr get(const BricksPtr& bricks, BrickId id, const std::stop_token& stop = {});
    // The brick when it is there at once; null otherwise. Never decodes.
    BrickVoxelsPtr peek(const Bricks& bricks, BrickId id);
    // The brick or its nearest cached ancestor, whichever is there at once.
    struct Nearest {
        BrickId id;
        BrickVoxelsPtr voxels;  // null when nothing of it is there
    };
    Nearest nearest(const Bricks& bricks, BrickId id);

    // Keeps a brick from being evicted for as long as the pin lives (a frame pins what it draws).
    class Pin {
      public:
        Pin() = default;
        Pin(Pin&&) noexcept;
        Pin& operator=(Pin&&) noexcept;
        ~Pin();
        const BrickVoxelsPtr& voxels() const { return voxels_; }

      private:
        friend class BrickCache;
        BrickCache* cache_ = nullptr;
        std::uint64_t identity_ = 0;
        BrickId id_;
        BrickVoxelsPtr voxels_;
    };
    Pin pin(const BricksPtr& bricks, BrickId id, const std::stop_token& stop = {});

    // Forgets every brick of one Bricks (called when it dies).
    void drop(std::uint64_t identity);

  private:
    struct State;
    std::unique_ptr<State> state_;
};

// Voxels of `box` of a level, converted to desc().volume.type: rounded and clamped to its limits.
// The box may reach outside of the level: the border is replicated.
void read_region(const BricksPtr& bricks, int level, const Box& box, std::span<std::byte> out,
                 BrickCache& cache, const std::stop_token& stop = {});

// A brick with an apron of its neighbours' voxels, `below` (0 or 1) voxels on the low sides and
// `above` (0, 1 or 2) on the high sides, replicated at the volume's border. Always a full brick:
// dims are brick + below + above whatever the clipping.
struct Apron {
    int below = 0, above = 1;
};
void read_brick(const BricksPtr& bricks, BrickId id, Apron apron, std::span<std::byte> out,
                BrickCache& cache, const std::stop_token& stop = {});

// A level as a Volume that reads through the cache; world coordinates agree with level 0.
VolumePtr level_as_volume(BricksPtr bricks, int level, BrickCache& cache);

}  // namespace voxloom
