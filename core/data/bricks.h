// Bricks: the interface of every codec, and of anything with levels of detail.
//
// A volume is a pyramid of levels, level 0 the finest. Level l+1 keeps the even samples of level l
// on the axes that it halves: sample n of level l sits at fine index n * 2^(times halved), NOT at
// the centre of the samples it stands for. Each level is cut into bricks of `brick` voxels a side.
//
// The unit of decoding is a family: the bricks that share a parent. A brick needs its ancestors and
// never a sibling family. Flat codecs have one level, no parents, and families of one brick.
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "core/base/buffer.h"
#include "core/base/types.h"
#include "core/data/volume.h"

namespace voxloom {

struct BrickId {
    int level = 0;
    glm::ivec3 index{0};  // position in the level's grid of bricks
    friend bool operator==(const BrickId&, const BrickId&) = default;
};
struct HashOfBrickId {
    std::size_t operator()(const BrickId& id) const;
};

struct LevelDesc {
    Index3 dims{0};         // voxels of this level
    glm::ivec3 stride{1};   // fine index of sample n is n * stride
    glm::ivec3 bricks{0};   // grid of bricks: ceil(dims / brick)
};

struct BricksDesc {
    VolumeDesc volume;              // of level 0; type is what region() delivers
    glm::ivec3 brick{32};           // voxels of a full brick along each axis
    ScalarType tree_type = ScalarType::u8;  // of decoded bricks; wider than volume.type where a
                                            // codec's coarse levels overshoot (clamped in region())
    std::vector<LevelDesc> levels;  // [0] finest; never empty; the last one is the root's
    std::uint64_t compressed_bytes = 0;  // everything: headers, tables, index

    bool has(BrickId id) const;       // such a brick exists
    Box box_of(BrickId id) const;     // voxels in its level, clipped to the level
    // Voxels of level 0 that the brick stands for: every level's boxes tile level 0. Half-open from
    // its first sample's fine index to the next brick's; the last brick takes the rest.
    Box fine_box_of(BrickId id) const;
    // The brick of the next coarser level whose fine box contains this one's; empty at the top.
    std::optional<BrickId> coarser(BrickId id) const;
    // The bricks that `coarser` leads to `id` from, in order of octant; empty at level 0.
    std::vector<BrickId> finer(BrickId id) const;
    // Which octant of coarser(id) the brick is: bit 0 upper half in x, 1 in y, 2 in z. An axis that
    // was not halved between the two levels has only the lower half.
    int octant_of(BrickId id) const;
    std::size_t tree_voxel_bytes() const { return bytes_of(tree_type) * std::size_t(volume.components); }
    // Index coordinates of `level` to world: index_to_world with the level's stride.
    glm::dmat4 level_to_world(int level) const;
};

// Levels of the pyramid over `volume`, until one brick holds everything. Of the axes whose extent
// exceeds the brick's, a level halves (ceil(n/2)) those whose spacing is at most sqrt(2) times the
// smallest among them: 0.5 x 0.5 x 5 mm first halves x and y alone. With `flat` only level 0.
// Throws Error when a side of the brick is not positive or a grid of bricks exceeds 32 bits.
std::vector<LevelDesc> pyramid_levels(const VolumeDesc& volume, glm::ivec3 brick, bool flat = false);

// What is known of a brick without decoding it. Errors are those of drawing it in place of the
// original: the samples of its level, as region() delivers them, interpolated linearly at every voxel
// of its fine box (neighbouring bricks' samples take part, the last sample is continued), minus the
// original, over all components. Voxels that are not valid do not count.
struct BrickInfo {
    // Smallest and largest finite value of the brick and of the one layer of voxels around it, so
    // that whatever is interpolated in the brick lies inside. {0, 0} where nothing is finite.
    ValueRange range;
    double l2 = 0;                         // sqrt of the sum of the squared errors
    double max_error = 0;
    std::array<double, 8> octant_l2{};     // the same over octant_of() of its finer bricks; level 0: all in [0]
    std::uint64_t compressed_bytes = 0;
    bool exact_error = false;              // false where l2 and max_error are estimates or unknown
};

// Voxels of one decoded brick. `stored` may exceed the brick's clipped box (codecs pad); the box's
// first voxel is the first stored one.
struct BrickVoxels {
    Index3 stored{0};
    Buffer voxels;  // stored.x*y*z of BricksDesc::tree_type, components interleaved
    // What the codec's refine() needs of a parent beside its voxels (integer coefficients behind
    // float voxels, say). Nobody else looks at it; the cache counts it.
    Buffer decoder_state;
    std::uint64_t bytes() const { return voxels.size() + decoder_state.size(); }
};
using BrickVoxelsPtr = std::shared_ptr<const BrickVoxels>;

struct DecodedBrick {
    BrickId id;
    BrickVoxelsPtr voxels;
};

// Immutable, shared, thread-safe: decoders keep no state between calls.
class Bricks {
  public:
    explicit Bricks(BricksDesc desc);
    virtual ~Bricks();
    Bricks(const Bricks&) = delete;
    Bricks& operator=(const Bricks&) = delete;

    const BricksDesc& desc() const { return desc_; }
    // Distinguishes this object from every other one of the process, for cache keys.
    std::uint64_t identity() const { return identity_; }

    virtual BrickInfo info(BrickId id) const = 0;
    // The brick whose voxels refine() needs: coarser(id), or empty where it needs none (roots, flat
    // codecs, levels that are stored as they are). Cheap.
    virtual std::optional<BrickId> parent(BrickId id) const = 0;
    // Decodes the family that `id` belongs to, and returns all of its bricks: those with the same
    // parent, or `id` alone where there is none. `parent` holds the voxels of parent(id), null
    // exactly when there is none. Throws Error naming the brick when the data is corrupt.
    // It may use parallel_for; other Bricks are read through a cache only on the calling thread.
    virtual std::vector<DecodedBrick> refine(BrickId id, const BrickVoxels* parent,
                                             const std::stop_token& stop) const = 0;
    // What refine(id) returns takes at most this much memory (BrickVoxels::bytes() of all): the
    // cache makes room for it beforehand. By default full bricks and no decoder state.
    virtual std::uint64_t family_bytes(BrickId id) const;

    // The dense array of a level (tree_type, x fastest) where it is in memory, else null. Saves the
    // copy into bricks; lives as long as the object.
    virtual const std::byte* level_data(int /*level*/) const { return nullptr; }
    // 1 where a voxel of the level is valid, 0 where not. Only called when desc().volume.has_mask.
    virtual void read_mask(int level, const Box& box, std::span<std::uint8_t> out) const;
    // Memory held for as long as the object lives (a dense pyramid's arrays, an index).
    virtual std::uint64_t resident_bytes() const { return 0; }

  private:
    BricksDesc desc_;
    std::uint64_t identity_;
};
using BricksPtr = std::shared_ptr<const Bricks>;

}  // namespace voxloom
