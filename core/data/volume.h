// A volume: a description, and voxels read by region.
//
// Coordinates. Voxel i sits AT index coordinate i (node-centred): n voxels span n-1 spacings.
// index_to_world maps index coordinates to world coordinates, in double; columns 0..2 are the axis
// directions times the spacing, column 3 the position of voxel (0,0,0). Gradients are carried by the
// inverse transpose. A texel centre is at (i+1/2)/n.
#pragma once

#include <functional>
#include <glm/glm.hpp>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>

#include "core/base/buffer.h"
#include "core/base/types.h"

namespace voxloom {

struct VolumeDesc {
    Index3 dims{0};                   // voxels along x (fastest), y, z; 0 is legal (an empty volume)
    glm::dmat4 index_to_world{1.0};
    std::string unit;                 // of world lengths, "mm"; empty when unknown
    ScalarType type = ScalarType::u8;
    int components = 1;               // 1 to 4, interleaved
    bool color = false;               // 3 or 4 components that are RGB(A), drawn as they are
    std::string name;                 // of the variable, for people
    int significant_bits = 0;         // bits in use of an integer type, 12 for most CT; 0: all of them
    std::optional<ValueRange> range;  // of the finite values over all components, where known
    bool has_mask = false;            // read_mask() says which voxels are valid

    glm::dvec3 spacing() const;       // world length of one index step along each axis
    glm::dvec3 origin() const { return glm::dvec3(index_to_world[3]); }
    void set_spacing_origin(glm::dvec3 spacing, glm::dvec3 origin);  // axis-aligned
    std::uint64_t voxels() const { return Box::of(dims).voxels(); }
    std::size_t voxel_bytes() const { return bytes_of(type) * std::size_t(components); }
    // Bytes of the dense array; an Error where they do not fit in 63 bits.
    std::uint64_t dense_bytes() const;
    // Lengths of the box from the first to the last voxel's centre, in index units: dims-1.
    glm::dvec3 extent() const { return glm::max(glm::dvec3(dims) - 1.0, glm::dvec3(0.0)); }
};

// "256 x 256 x 128 u8, spacing 1 x 1 x 1 mm": one line for messages and listings.
std::string summary(const VolumeDesc& desc);

// Where a volume is sampled, in index coordinates: from the first to the last voxel on each axis; an
// axis with one voxel is a slab one spacing thick around it, along which the value is constant.
struct SamplingBox {
    glm::dvec3 lo, hi;
};
SamplingBox sampling_box(const VolumeDesc& desc);

// What an analytic volume says of itself, so that tests and references need no interpolation.
struct ClosedForm {
    std::function<double(glm::dvec3 world)> value;         // before rounding to the scalar type
    std::function<glm::dvec3(glm::dvec3 world)> gradient;  // per unit of world length
};

// Immutable and shared (VolumePtr); every member may be called from any thread at any time.
class Volume {
  public:
    explicit Volume(VolumeDesc desc) : desc_(std::move(desc)) {}
    virtual ~Volume() = default;
    Volume(const Volume&) = delete;
    Volume& operator=(const Volume&) = delete;

    const VolumeDesc& desc() const { return desc_; }

    // Reads the voxels of `box` (inside dims) into `out`, x fastest, components interleaved.
    // out.size() is box.voxels() * voxel_bytes(). NaN and Inf stay in the voxels.
    // Throws Error when the source fails, Cancelled when asked to stop.
    virtual void read(const Box& box, std::span<std::byte> out,
                      const std::stop_token& stop = {}) const = 0;
    // 1 where a voxel is valid, 0 where not. Only called when desc().has_mask.
    virtual void read_mask(const Box& box, std::span<std::uint8_t> out) const;

    // The whole dense array where it is in memory, else null. Lives as long as the volume.
    virtual const std::byte* data() const { return nullptr; }
    // False when reading any region costs as much as reading everything (gzip NRRD).
    virtual bool reads_by_region() const { return true; }
    // Memory that this volume holds, for reports and cache limits.
    virtual std::uint64_t resident_bytes() const { return 0; }
    virtual const ClosedForm* closed_form() const { return nullptr; }

  private:
    VolumeDesc desc_;
};
using VolumePtr = std::shared_ptr<const Volume>;

// A volume in memory.
class DenseVolume final : public Volume {
  public:
    // `voxels` holds desc.dense_bytes() bytes; `mask`, when present, one byte a voxel.
    DenseVolume(VolumeDesc desc, Buffer voxels, Buffer mask = {});
    void read(const Box& box, std::span<std::byte> out, const std::stop_token& stop) const override;
    void read_mask(const Box& box, std::span<std::uint8_t> out) const override;
    const std::byte* data() const override { return voxels_.data(); }
    std::uint64_t resident_bytes() const override { return voxels_.size() + mask_.size(); }

  private:
    Buffer voxels_, mask_;
};

// The volume in memory: `volume` itself where it is dense, else a copy read slab by slab.
// progress(fraction) is called now and then, from this thread.
std::shared_ptr<const Volume> in_memory(VolumePtr volume, const std::stop_token& stop = {},
                                        const std::function<void(double)>& progress = {});

// Smallest and largest finite value over all components, read slab by slab in parallel; {0,0} for a
// volume without a finite value. Takes desc().range where it is known.
ValueRange value_range(const Volume& volume, const std::stop_token& stop = {});

}  // namespace voxloom
