// What a camera sees of boxes in a volume: whether, how far away, how large a voxel is in the picture.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <vector>

#include "core/data/bricks.h"
#include "core/data/camera.h"

namespace voxloom::lod {

// A box in index coordinates of level 0, closed.
struct Region {
    glm::dvec3 lo, hi;
    glm::dvec3 centre() const { return 0.5 * (lo + hi); }
    glm::dvec3 half() const { return 0.5 * (hi - lo); }
};
// Where the voxels of a box are sampled: up to the first voxel behind it, at the volume's end up to the
// last one; an axis of one voxel is a slab one spacing thick.
Region region_of(const VolumeDesc& volume, const Box& fine_box);

class Sight {
  public:
    Sight(const Camera& camera, glm::ivec2 size, const BricksDesc& bricks);

    // False only where nothing of the region is in the picture; one that touches its border is not.
    bool sees(const Region& region) const;
    // Least distance along the view axis from the eye to the region; 0 where the eye may be in it.
    double depth(const Region& region) const;
    // 1/depth in units of the volume's diagonal, infinite at the eye; 1 for a parallel view, in which
    // nothing is nearer than the rest.
    double nearness(double depth) const;
    // Pixels between two voxels of a level at that depth, on the axis where they are furthest apart.
    double pixels(int level, double depth) const;

    // Order in which children occlude each other: the octant of `split` (index coordinates) that is
    // on the eye's side.
    int octant_of_eye(glm::dvec3 split) const;
    // Positions 0 .. n-1 of slices of `thickness` along an axis, back to front.
    std::vector<int> back_to_front(int axis, int n, double thickness) const;

  private:
    bool perspective_;
    std::array<glm::dvec4, 5> planes_;  // index coordinates, the inside is above 0
    glm::dvec4 depth_;                  // along the view axis, world
    double near_;
    double pixels_per_length_;          // at depth 1, or anywhere
    double diagonal_;
    glm::dvec3 eye_;                    // index coordinates: where it is, or towards it
    std::vector<double> spacing_;       // largest of each level, world
};

// A world plane (|n| = 1) in index coordinates: distance in world lengths.
glm::dvec4 in_index_space(const glm::dvec4& plane, const VolumeDesc& volume);
// Distance of the region's centre from a plane in index coordinates, and how far its corners are from
// the centre along the plane's normal.
struct Reach {
    double centre, half;
};
Reach reach(const Region& region, const glm::dvec4& plane);

}  // namespace voxloom::lod
