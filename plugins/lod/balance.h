// Balancing a selection, and how its bricks blend into coarser neighbours.
//
// LaMar, Duchaineau, Hamann, Joy: Multiresolution techniques for interactive texture-based rendering of
// arbitrarily oriented cutting planes, 2000, section 4.3. Bricks that share a face, an edge or a corner
// may differ by one level; corners that touch a coarser brick that is drawn show the coarser samples. Which levels
// meet is decided over the complete tree that a selection implies, with what it leaves out, since a brick that is
// seen may meet two others through one that is not.
#pragma once

#include <functional>
#include <stop_token>
#include <unordered_map>

#include "plugins/lod/cut.h"

namespace voxloom::lod {

// A cut without partly replaced bricks, whose nodes can be found.
class CompleteTree {
  public:
    // Of the selection: everything between its bricks becomes a leaf that is not drawn, and octants of
    // a partly replaced brick become bricks of their own.
    CompleteTree(const BricksDesc& bricks, const Selection& selection);

    // Splits until neighbours differ by at most one level. `seen` says whether a new brick is drawn.
    void balance(const std::function<bool(BrickId)>& seen, const std::stop_token& stop = {});
    // Merges the families whose parent's price (of its node) is least, and whose neighbours allow it,
    // until no more than `most` bricks are drawn. False when that is not possible.
    bool merge_down_to(std::int64_t most, const std::function<double(BrickId)>& price,
                       const std::stop_token& stop = {});
    void set_corner_blends();

    const Cut& cut() const { return cut_; }
    Cut& cut() { return cut_; }
    std::int64_t drawn() const { return drawn_; }
    std::int32_t find(BrickId id) const;  // -1 where the tree does not reach down to it

  private:
    bool is_split(BrickId id) const;
    void split(std::int32_t node, bool drawn_children);
    void reach(BrickId id, const std::function<bool(BrickId)>& seen, std::vector<std::int32_t>& fresh);
    bool may_merge(std::int32_t node) const;

    const BricksDesc& bricks_;
    Cut cut_;
    std::unordered_map<BrickId, std::int32_t, HashOfBrickId> index_;
    std::int64_t drawn_ = 0;
};

// The 26 bricks around `id` in its level's grid; calls f(id, offset).
template <class F>
void for_each_neighbour(const BricksDesc& bricks, BrickId id, const F& f) {
    for (int i = 0; i < 27; ++i) {
        const glm::ivec3 offset(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
        const BrickId other{id.level, id.index + offset};
        if (i != 13 && bricks.has(other)) f(other, offset);
    }
}

}  // namespace voxloom::lod
