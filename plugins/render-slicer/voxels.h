// What is computed at the voxels before drawing: gradients, and colours for pre-classification.
#pragma once

#include <functional>
#include <glm/glm.hpp>
#include <stop_token>
#include <vector>

#include "core/data/transfer_function.h"
#include "core/data/volume.h"

namespace voxloom::slicer {

// Weight of a neighbour in the smoothing of a gradient's other two axes: 0 central differences,
// 1/4 Sobel, 1/6 the isotropic (1 4 1)/6.
// Fills slice z with (dx, dy, dz, 0) per index step, of values mapped by (v - offset)/scale. The border
// is replicated; a neighbour that is not valid counts as the voxel itself. `volume` is in memory.
class Gradients {
  public:
    Gradients(const Volume& volume, int component, double offset, double scale, double side);
    // [any thread]
    void slice(int z, glm::vec4* out) const;
    // Largest component over the volume.
    float largest(const std::stop_token& stop) const;

  private:
    void load(int z, float* values, std::uint8_t* valid) const;
    const Volume& volume_;
    int component_;
    double offset_, scale_;
    float side_;
    bool checks_;  // there may be invalid voxels
};

// Fills slice z with optical depth and colour (x c, x) of a slab of thickness d, classified at the
// voxels; transparent where a voxel is not valid.
void classify_slice(const Volume& volume, int component, const TransferFunction1D& tf, double d, int z,
                    glm::vec4* out);

}  // namespace voxloom::slicer
