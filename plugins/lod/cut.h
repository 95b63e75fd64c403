// A cut through the tree of bricks while it is being made: the nodes above and on it.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/data/selection.h"
#include "plugins/lod/sight.h"

namespace voxloom::lod {

// Nodes know what replaces each of their octants. A node with some octants replaced draws the others
// itself.
struct Cut {
    static constexpr std::int32_t kOpen = -1;    // drawn by the node itself
    static constexpr std::int32_t kUnseen = -2;  // drawn by nobody: culled, transparent, or not there
    struct Node {
        BrickId id;
        bool drawn = true;                       // false: culled or transparent as a whole
        std::array<std::int32_t, 8> child;       // a node, or one of the above
        std::array<float, 8> corner_blend{};
        double predicted_error = 0;              // of what it draws itself

        bool is_leaf() const;  // no octant is replaced by a node
        bool draws() const;    // itself, anything
        std::uint8_t open() const;
    };
    std::vector<Node> nodes;
    std::vector<std::int32_t> roots;             // the coarsest level, x fastest

    std::size_t bricks() const;                  // that draw anything
};

// A node that draws its whole brick.
Cut::Node whole_node(const BricksDesc& bricks, BrickId id);
// One for each brick of the coarsest level, none of an empty volume.
Cut coarsest_cut(const BricksDesc& bricks);

// What is drawn, back to front for `sight` (null: in order of the octants), and the largest of the
// predicted errors.
void list_bricks(const Cut& cut, const BricksDesc& bricks, const Sight* sight, Selection& selection);

// An empty selection of these bricks. A camera that is null leaves the view out.
std::shared_ptr<Selection> new_selection(const BricksDesc& bricks, std::string policy, CameraPtr camera,
                                         glm::ivec2 size);

}  // namespace voxloom::lod
