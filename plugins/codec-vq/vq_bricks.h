// Vector-quantised bricks: one level, families of one, each decoded with its macroblock's codebooks alone. Bytes in memory
// or in a mapped file.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/data/brick_index.h"
#include "plugins/codec-vq/coded_brick.h"

namespace voxloom::vq {

// Everything but the payload.
struct VqIndex {
    BricksDesc desc;  // volume.range is known
    Loop loop = Loop::closed;
    double unit = 1;  // of codewords, in values
    glm::ivec3 macroblocks{1};      // along each axis, each with codebooks of its own; at most as many as bricks
    std::vector<Codebooks> books;   // of each macroblock, x fastest; within one, of each component
    std::string provenance;
    BrickIndex bricks;

    BrickForm form(Index3 dims) const { return {dims, desc.volume.type, desc.volume.components, unit}; }
    std::size_t macroblock_of(BrickId id) const;
    std::span<const Codebooks> books_of(BrickId id) const;
};

// What such bricks of a volume would be; throws Error for bricks that cannot be.
BricksDesc vq_desc(const VolumeDesc& volume, glm::ivec3 brick);
// As many macroblocks as asked for where there are bricks for them.
glm::ivec3 macroblocks_for(const BricksDesc& desc, glm::ivec3 wanted);

class VqBricks final : public Bricks {
  public:
    // `keeper` keeps the payload alive; `resident` is the memory that it takes.
    VqBricks(VqIndex index, std::span<const std::byte> payload, std::shared_ptr<const void> keeper, std::uint64_t resident);

    BrickInfo info(BrickId id) const override { return index_.bricks.infos[number_of(desc(), id)]; }
    std::optional<BrickId> parent(BrickId) const override { return std::nullopt; }
    std::vector<DecodedBrick> refine(BrickId id, const BrickVoxels* parent, const std::stop_token& stop) const override;
    std::uint64_t family_bytes(BrickId id) const override { return desc().box_of(id).voxels() * desc().tree_voxel_bytes(); }
    std::uint64_t resident_bytes() const override;

    const VqIndex& index() const { return index_; }
    std::span<const std::byte> payload() const { return payload_; }

  private:
    VqIndex index_;
    std::span<const std::byte> payload_;
    std::shared_ptr<const void> keeper_;
    std::uint64_t resident_;
};
using VqBricksPtr = std::shared_ptr<const VqBricks>;

// --- files: docs/brick-format.md ---

// Everything before the payload.
Bytes front_of(const VqIndex& index, std::uint64_t payload_bytes);
void write_file(const VqBricks& bricks, const std::filesystem::path& path, const std::stop_token& stop = {});
// Maps the file; only its head is read. Throws Error, naming the file, for what is no such file.
VqBricksPtr open_file(const std::filesystem::path& path);
// The same of bytes in memory, which `keeper` keeps alive; `name` is for messages.
VqBricksPtr open_bytes(std::span<const std::byte> file, std::shared_ptr<const void> keeper, const std::string& name);

// Codewords of 8-bit volumes are stored as multiples of this, which is well below what rounding to integers costs; those
// of other volumes as floats.
inline constexpr float kFineStep = 1.0f / 128;
bool has_fine_steps(ScalarType type);
// The codewords as files hold them.
void round_words(ScalarType type, Codebook& book);

}  // namespace voxloom::vq
