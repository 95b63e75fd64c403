// The one cache of decoded bricks, above every codec.
//
// Byte limit, least recently used out first, pins, and each family decoded once however many
// threads ask. Ancestors are fetched as needed. Bricks that are in someone's hands (a BrickVoxelsPtr
// or a Pin) stay. The limit holds for everything at once: what is kept, what is in someone's hands
// and what is being decoded. All members may be called from any thread.
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
        std::uint64_t hits = 0, misses = 0;      // bricks asked for: there at once, or not
        std::uint64_t families_decoded = 0, bytes_decoded = 0;
        std::uint64_t bricks_evicted = 0;
        std::uint64_t waits = 0;                 // misses that another thread was just decoding
        std::uint64_t bytes = 0, peak_bytes = 0; // held, and set aside for what is being decoded
    };

    explicit BrickCache(std::uint64_t byte_limit);
    ~BrickCache();
    BrickCache(const BrickCache&) = delete;
    BrickCache& operator=(const BrickCache&) = delete;

    // The process's cache; its limit is set by the runtime.
    static BrickCache& global();

    // A lower limit takes effect at once, but for what is in someone's hands.
    void set_byte_limit(std::uint64_t bytes);
    std::uint64_t byte_limit() const;
    Counters counters() const;

    // The decoded brick; decodes its family, and first its ancestors, where they are not there.
    // Waits while another thread decodes the same family or occupies the memory for now. Throws
    // Error when the limit cannot hold the family, its parent, and what is in someone's hands.
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
        const BrickVoxelsPtr& voxels() const { return voxels_; }

      private:
        friend class BrickCache;
        explicit Pin(BrickVoxelsPtr voxels) : voxels_(std::move(voxels)) {}
        BrickVoxelsPtr voxels_;
    };
    Pin pin(const BricksPtr& bricks, BrickId id, const std::stop_token& stop = {}) {
        return Pin(get(bricks, id, stop));
    }

    // Forgets every brick of one Bricks; what is in someone's hands counts until it is given back.
    void drop(std::uint64_t identity);
    // The same in every cache there is: called when a Bricks dies.
    static void drop_everywhere(std::uint64_t identity);

    struct State;

  private:
    friend void read_region(const BricksPtr&, int, const Box&, std::span<std::byte>, BrickCache&,
                            const std::stop_token&);
    std::shared_ptr<State> state_;  // outlives the cache in the hands of those who hold bricks
};

// Voxels of `box` of a level, converted to desc().volume.type: rounded half to even and clamped to
// its limits. The box may reach outside of the level: the border is replicated; a level without
// voxels gives zeros. Large boxes decode in parallel.
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

// What level_as_volume() will say of itself: dims and index_to_world of the level; no value range
// for coarse levels.
VolumeDesc level_volume_desc(const BricksDesc& bricks, int level);
// A level as a Volume that reads through the cache (which must outlive it); world coordinates agree
// with level 0.
VolumePtr level_as_volume(BricksPtr bricks, int level, BrickCache& cache);

}  // namespace voxloom
