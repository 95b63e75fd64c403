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

    Box box_of(BrickId id) const;                     // voxels in its level, clipped to the level
    // Index coordinates of `level` to world: index_to_world with the level's stride.
    glm::dmat4 level_to_world(int level) const;
};

// Levels of the pyramid over `volume`: an axis is halved (ceil(n/2)) at a level when its spacing is
// at most sqrt(2) times the smallest spacing of that level and its extent exceeds the brick's
// (methods 1.1), until one brick holds everything. With `flat` only level 0.
std::vector<LevelDesc> pyramid_levels(const VolumeDesc& volume, glm::ivec3 brick, bool flat = false);

// Measured against the original volume, each sample upsampled linearly to level 0.
struct BrickInfo {
    ValueRange range;                      // finite values of the brick, one layer of neighbours included
    double l2 = 0;                         // sqrt of the sum of squared errors over the voxels it stands for
    double max_error = 0;
    std::array<double, 8> octant_l2{};     // share of each octant (bit 0: upper half in x, 1: y, 2: z)
    std::uint64_t compressed_bytes = 0;
    bool exact_error = false;              // false where l2 and max_error are estimates or unknown
};

// Voxels of one decoded brick. `stored` may exceed the brick's clipped box (codecs pad); the box's
// first voxel is the first stored one.
struct BrickVoxels {
    Index3 stored{0};
    Buffer voxels;  // stored.x*y*z of BricksDesc::tree_type, components interleaved
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
    // The brick whose voxels refine() needs; empty for roots and flat codecs.
    virtual std::optional<BrickId> parent(BrickId id) const = 0;
    // Decodes the family that `id` belongs to, and returns all of its bricks. `parent` holds the
    // voxels of parent(id), null exactly when there is none. Throws Error naming the brick when the
    // data is corrupt.
    virtual std::vector<DecodedBrick> refine(BrickId id, const BrickVoxels* parent,
                                             const std::stop_token& stop) const = 0;
    // Memory held for as long as the object lives (a dense pyramid's arrays, an index).
    virtual std::uint64_t resident_bytes() const { return 0; }

  private:
    BricksDesc desc_;
    std::uint64_t identity_;
};
using BricksPtr = std::shared_ptr<const Bricks>;

}  // namespace voxloom
