// The scalar field a volume stands for: voxels as doubles, reconstruction between them, gradients.
#pragma once

#include <array>
#include <limits>
#include <vector>

#include "core/data/volume.h"

namespace voxloom::reference {

enum class Reconstruction { nearest, trilinear, tricubic };
enum class GradientStencil { central, sobel, isotropic };

inline constexpr double kInvalid = std::numeric_limits<double>::quiet_NaN();

// Immutable; every member may be called from any thread. Positions are index coordinates, gradients
// per unit of world length. A voxel that is masked or not finite is invalid, and so is a position
// whose whole footprint is: both are answered with NaN.
class Field {
  public:
    // `volume` must be in memory unless its closed form is taken. `component` is what is
    // classified; of a colour volume it is the luma. With `closed_form` values and gradients are
    // the volume's own formula, exact.
    Field(VolumePtr volume, int component, Reconstruction reconstruction, GradientStencil stencil,
          bool closed_form);

    const VolumeDesc& desc() const { return volume_->desc(); }
    bool interpolates_voxels() const { return !form_; }
    Reconstruction reconstruction() const { return reconstruction_; }

    // The scalar of one voxel; indices outside are replicated from the border.
    double voxel(Index3 i) const;
    // The stencil's derivative at one voxel, still per index step. An invalid neighbour counts as
    // the voxel itself, so that it adds no slope.
    glm::dvec3 index_gradient(Index3 i) const;
    glm::dvec3 to_world_gradient(glm::dvec3 per_index) const {
        return gradient_to_world_ * per_index;
    }

    double value(glm::dvec3 p) const;
    glm::dvec3 gradient(glm::dvec3 p) const;
    // Colour volumes: own colour and alpha, 0 to 1 (alpha 1 where there is none). [valid positions]
    glm::dvec4 color(glm::dvec3 p) const;

    // World to index coordinates, of points and of directions. Positions are taken relative to the
    // volume's origin first, so that far-away worlds lose no digits.
    glm::dvec3 to_index(glm::dvec3 world) const {
        return world_to_index_ * (world - desc().origin());
    }
    glm::dvec3 direction_to_index(glm::dvec3 world) const { return world_to_index_ * world; }
    glm::dvec3 to_world(glm::dvec3 index) const;

  private:
    // The valid voxels that a position is reconstructed from, weights adding up to 1.
    struct Footprint {
        int count = 0;
        std::array<Index3, 64> voxels;
        std::array<double, 64> weights;
    };
    Footprint footprint(glm::dvec3 p) const;
    bool gather(glm::dvec3 p, Reconstruction reconstruction, Footprint& f) const;
    Index3 clamp(Index3 i) const;
    std::uint64_t offset(Index3 i) const;
    double component(std::uint64_t voxel, int c) const;

    VolumePtr volume_;
    const std::byte* data_;
    std::vector<std::uint8_t> mask_;  // empty: all valid
    const ClosedForm* form_ = nullptr;
    int component_;
    Reconstruction reconstruction_;
    glm::dvec3 smoothing_;  // of the stencil, across the axis of differentiation
    glm::dmat3 world_to_index_, gradient_to_world_;
};

}  // namespace voxloom::reference
