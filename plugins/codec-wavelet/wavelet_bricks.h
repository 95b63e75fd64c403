// A wavelet tree as Bricks: bytes in memory or in a mapped file, decoded when a family is asked for.
#pragma once

#include <memory>
#include <vector>

#include "plugins/codec-wavelet/payload.h"
#include "plugins/codec-wavelet/statistics_code.h"
#include "plugins/codec-wavelet/tree.h"

namespace voxloom::wavelet {

// Bytes of one family in the payload. Size 0: nothing but interpolation of the parent.
struct FamilyPlace {
    std::uint64_t offset = 0;
    std::uint64_t size = 0;
    std::uint32_t check = 0;  // lower half of XXH3
};

// Everything of a tree but its payload.
struct TreeIndex {
    TreeDesc tree;
    std::unique_ptr<Coder> coder;
    std::vector<std::vector<FamilyPlace>> families;  // of each level, x fastest
    std::vector<std::vector<BrickInfo>> infos;       // of each level's bricks, x fastest, as the encoder knows them ...
    CodedStatistics statistics;                      // ... or, where infos are empty, as the file has them

    std::size_t bricks_of_level(int level) const;
    BrickInfo info(int level, std::size_t brick) const;
};

class WaveletBricks final : public Bricks {
  public:
    WaveletBricks(TreeIndex index, Payload payload);

    BrickInfo info(BrickId id) const override;
    std::optional<BrickId> parent(BrickId id) const override { return desc().coarser(id); }
    std::vector<DecodedBrick> refine(BrickId id, const BrickVoxels* parent, const std::stop_token& stop) const override;
    std::uint64_t family_bytes(BrickId id) const override;
    void read_mask(int level, const Box& box, std::span<std::uint8_t> out) const override;
    std::uint64_t resident_bytes() const override;

    const TreeIndex& index() const { return index_; }
    std::span<const std::byte> payload() const { return payload_.bytes; }
    // Whoever walks through the whole payload gives it back piece by piece. Nothing happens to bytes in memory.
    void forget(std::uint64_t offset, std::uint64_t size) const { payload_.forget(offset, size); }

  private:
    // The bytes of the family of a brick, checked; those of one that is not stored read as empty streams.
    std::span<const std::byte> family_stream(BrickId id) const;

    TreeIndex index_;
    Payload payload_;
};

}  // namespace voxloom::wavelet
