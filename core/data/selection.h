// What one view draws of a Bricks, in drawing order.
//
// A selection is a cut through the tree of bricks: what it lists covers every part of the volume that
// can be seen, once. What it leaves out is outside of the view or transparent, and draws nothing.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/data/bricks.h"
#include "core/data/camera.h"

namespace voxloom {

// A brick of which some octants are replaced by finer bricks may be listed several times, each time
// with the octants whose turn it is.
struct SelectedBrick {
    BrickId id;
    // Octants drawn from this brick (bit = x | y<<1 | z<<2, see BricksDesc::octant_of); all of them,
    // and at level 0 always: the whole brick.
    std::uint8_t octants = 0xff;
    // At each corner of the brick (bit as above) how much of the coarser brick's samples is mixed in:
    // 0 its own, 1 those of coarser(id); trilinear in between.
    std::array<float, 8> corner_blend{};
    double predicted_error = 0;  // as Selection::predicted_error, of these octants
};

struct Selection {
    // The bricks it is a selection of: their description, so that a selection keeps no voxels alive.
    // Never null.
    std::shared_ptr<const BricksDesc> of;
    std::string policy;          // the node that selected: "lod.priority"

    // What it was made for; camera is null where the view did not matter.
    CameraPtr camera;
    glm::ivec2 size{0};          // pixels of the picture
    std::optional<glm::dvec4> plane;  // the cutting plane, world: dot(n, x) + w = 0, |n| = 1

    std::vector<SelectedBrick> bricks;  // back to front
    // The largest of its bricks: error of a pixel that the brick covers, as a fraction of the peak (the
    // extent of the values, or full opacity, as the policy says).
    double predicted_error = 0;
};
using SelectionPtr = std::shared_ptr<const Selection>;

// Throws Error when `selection` was made for other bricks than these: another grid, other levels.
void check_selection(const Selection& selection, const BricksDesc& bricks);

// Voxels of level 0 that an octant of a brick stands for, as fine_box_of; empty where it has none.
Box fine_box_of_octant(const BricksDesc& bricks, BrickId id, int octant);

// A point of a volume's sampling box, (0, 0, 0) to (1, 1, 1), in the world.
glm::dvec3 point_in_box(const VolumeDesc& volume, glm::dvec3 fraction);
// The world plane through a point with a normal of any length but 0, as Selection::plane.
glm::dvec4 plane_through(glm::dvec3 point, glm::dvec3 normal);

}  // namespace voxloom
