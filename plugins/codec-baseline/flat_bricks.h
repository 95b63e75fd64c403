// Bricks that are coded each by itself: one level, families of one. Bytes in memory or in a mapped file.
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "core/data/brick_index.h"
#include "plugins/codec-baseline/coded_brick.h"

namespace voxloom::baseline {

// Everything but the payload.
struct FlatIndex {
    BricksDesc desc;  // volume.range is known
    const Codec* codec = nullptr;
    Setting setting;
    std::string provenance;
    BrickIndex bricks;

    Form form(Index3 dims) const;
};

// What such bricks of a volume would be; throws Error for bricks that cannot be.
BricksDesc flat_desc(const VolumeDesc& volume, glm::ivec3 brick);

class FlatBricks final : public Bricks {
  public:
    // `keeper` keeps the payload alive; `resident` is the memory that it takes.
    FlatBricks(FlatIndex index, std::span<const std::byte> payload, std::shared_ptr<const void> keeper,
               std::uint64_t resident);

    BrickInfo info(BrickId id) const override { return index_.bricks.infos[number_of(desc(), id)]; }
    std::optional<BrickId> parent(BrickId) const override { return std::nullopt; }
    std::vector<DecodedBrick> refine(BrickId id, const BrickVoxels* parent, const std::stop_token& stop) const override;
    std::uint64_t family_bytes(BrickId id) const override {
        return desc().box_of(id).voxels() * desc().tree_voxel_bytes();
    }
    std::uint64_t resident_bytes() const override;

    const FlatIndex& index() const { return index_; }
    std::span<const std::byte> payload() const { return payload_; }

  private:
    FlatIndex index_;
    std::span<const std::byte> payload_;
    std::shared_ptr<const void> keeper_;
    std::uint64_t resident_;
};
using FlatBricksPtr = std::shared_ptr<const FlatBricks>;

// --- files: docs/brick-format.md ---

// Everything before the payload.
Bytes front_of(const FlatIndex& index, std::uint64_t payload_bytes);
void write_file(const FlatBricks& bricks, const std::filesystem::path& path, const std::stop_token& stop = {});
// Maps the file; only its head is read. Throws Error, naming the file, for what is no such file, and for
// codecs that this build lacks.
FlatBricksPtr open_file(const std::filesystem::path& path);
// The same of bytes in memory, which `keeper` keeps alive; `name` is for messages.
FlatBricksPtr open_bytes(std::span<const std::byte> file, std::shared_ptr<const void> keeper, const std::string& name);

}  // namespace voxloom::baseline
