// A camera over a volume, as the few numbers that a shader needs: computed in double, relative to the
// middle of the volume, in index coordinates and numbers of planes.
#pragma once

#include <array>
#include <glm/glm.hpp>

#include "core/data/camera.h"
#include "core/data/volume.h"
#include "core/gpu/program.h"

namespace voxloom::slicer {

struct View {
    View(const Camera& camera, const VolumeDesc& desc, glm::ivec2 size, double slice_distance);

    double plane_distance = 1;   // world length between planes
    double planes = 0;           // that meet the volume
    bool perspective = true;

    // Ray of pixel (x, y), pixel centres at +1/2: point on plane 0, and step to the next plane.
    glm::dvec3 point_0, point_x, point_y, step_0, step_x, step_y;
    glm::dvec4 slope{0};
    double near_plane = 0;       // in planes
    SamplingBox box;             // index coordinates
    glm::ivec2 size;             // of the picture
    // Pixels on the side of the squares that leap together, and how far, in voxels of any axis, their
    // rays are from the one through the middle; whole numbers, as blocks are widened by them.
    int square = 1;
    int square_reach() const { return reach_; }
    // Pixels leap each on its own where their squares would reach further than this.
    void limit_reach(int most) {
        if (reach_ <= most) return;
        square = 1;
        reach_ = 0;
    }

    // Slices so many times as far apart.
    void widen_slices(int times);
    // False only where no ray, nor any of those that leap together with one in the picture, comes to a box
    // of voxels.
    bool may_meet(const Box& box) const;

    // For shading: world axes, lengths in units of the volume's diagonal, from its middle.
    glm::dmat3 index_to_place, gradient_to_world;
    glm::dvec3 middle;           // index coordinates
    glm::dvec4 eye_place;
    double diagonal = 1;         // world
    glm::dvec3 middle_world;
    double smallest_spacing = 1; // gradient_to_world is per this length

    // Pixels that the volume can cover: from xy to below zw.
    glm::ivec4 bounds{0};

    void set(const gpu::Program& program) const;

  private:
    int reach_ = 0;
    std::array<glm::dvec4, 5> outside_;  // index coordinates: above 0 outside of the picture
};

}  // namespace voxloom::slicer
