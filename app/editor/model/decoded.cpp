#include "app/editor/model/decoded.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/base/meter.h"
#include "core/data/brick_cache.h"
#include "core/measure/volume_error.h"

namespace voxloom::editor {

namespace {

// A volume that counts the processor time of reading it.
class Timed final : public Volume {
  public:
    explicit Timed(VolumePtr volume) : Volume(volume->desc()), volume_(std::move(volume)) {}
    void read(const Box& box, std::span<std::byte> out, const std::stop_token& stop) const override {
        MeterScope charge(&meter_);
        volume_->read(box, out, stop);
    }
    void read_mask(const Box& box, std::span<std::uint8_t> out) const override { volume_->read_mask(box, out); }
    double cpu_seconds() const { return double(meter_.cpu_ns()) * 1e-9; }

  private:
    VolumePtr volume_;
    mutable Meter meter_;
};

void read_all(const Volume& volume, Index3 tile, const std::stop_token& stop) {
    const Index3 dims = volume.desc().dims;
    for (std::int64_t z = 0; z < dims.z; z += tile.z)
        for (std::int64_t y = 0; y < dims.y; y += tile.y)
            for (std::int64_t x = 0; x < dims.x; x += tile.x) {
                check_stop(stop);
                const Box box{{x, y, z}, glm::min(Index3(x, y, z) + tile, dims)};
                Buffer voxels(box.voxels() * volume.desc().voxel_bytes(), "decoded voxels");
                volume.read(box, voxels.bytes(), stop);
            }
}

VolumePtr as_volume(const Value& value) {
    if (auto* volume = std::get_if<VolumePtr>(&value)) return *volume;
    if (auto* bricks = std::get_if<BricksPtr>(&value)) return level_as_volume(*bricks, 0, BrickCache::global());
    return nullptr;
}

}  // namespace

std::shared_ptr<const Decoded> decode_all(const BricksPtr& bricks, const Value& wanted, const std::stop_token& stop) {
    auto decoded = std::make_shared<Decoded>();
    const VolumeDesc& desc = bricks->desc().volume;
    const double compressed = double(bricks->desc().compressed_bytes), voxels = double(desc.voxels());
    if (voxels > 0 && compressed > 0) {
        decoded->ratio = double(desc.dense_bytes()) / compressed;
        decoded->bits_per_voxel = 8 * compressed / voxels;
    }
    try {
        const VolumePtr original = as_volume(wanted);
        BrickCache cache(BrickCache::global().byte_limit());
        const auto volume = std::make_shared<const Timed>(level_as_volume(bricks, 0, cache));
        const Index3 tile = tile_of_bricks(bricks->desc().brick);
        if (original && problem_with_comparison(desc, original->desc()).empty()) {
            CompareOptions options;
            options.tile = tile;
            options.stop = stop;
            const VolumeError error = compare_volumes(volume, original, options);
            decoded->psnr = error.psnr_range;
            decoded->max_error = error.max_error;
        } else {
            read_all(*volume, tile, stop);
        }
        decoded->cpu_seconds = volume->cpu_seconds();
        decoded->bytes_per_second = double(desc.dense_bytes()) / decoded->cpu_seconds;
    } catch (const Cancelled&) {
        throw;
    } catch (const std::exception& e) {
        decoded->problem = e.what();
    }
    return decoded;
}

}  // namespace voxloom::editor
