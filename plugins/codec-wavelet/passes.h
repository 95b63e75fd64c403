// What the passes of an encoder share: how a level is walked through in tiles, and how far the work is.
#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <stop_token>

#include "core/base/parallel.h"
#include "plugins/codec-wavelet/tree.h"

namespace voxloom::wavelet {

std::int64_t family_count(const TreeDesc& tree, int level);
FamilyId family_at(const TreeDesc& tree, int level, std::int64_t i);  // x fastest
// What a family needs of its parent, as a box of that level. The root needs nothing.
Box parent_box(const TreeDesc& tree, FamilyId family);
// The bricks of a family, in the order in which it is decoded.
std::vector<BrickId> bricks_of(const TreeDesc& tree, FamilyId family);
std::size_t place_of(const BricksDesc& desc, BrickId id);  // in its level, x fastest

// Of so many bytes or voxels that `parts` things have in common, what part i counts as its own.
inline std::uint64_t share_of(std::uint64_t all, std::size_t i, std::size_t parts) { return all / parts + (i < all % parts); }

// Families [first, last) of a level, whose boxes together are `box`: some of a row, some rows of a slab, or slabs.
struct Tile {
    int level = 0;
    std::int64_t first = 0, last = 0;
    Box box;
};
// The tile from family `first` on with no more than so many voxels, but one family.
Tile tile_from(const TreeDesc& tree, int level, std::int64_t first, std::uint64_t most_voxels);

// Tells a share of the work: fractions of it are mapped to [from, to] of the whole. [any thread]
class Progress {
  public:
    explicit Progress(std::function<void(double)> tell) : state_(std::make_shared<State>()) { state_->tell = std::move(tell); }
    Progress part(double from, double to) const {
        Progress p = *this;
        p.from_ = from_ + (to_ - from_) * from;
        p.to_ = from_ + (to_ - from_) * to;
        return p;
    }
    void operator()(double fraction) const {
        if (!state_->tell) return;
        const std::lock_guard lock(state_->mutex);
        const double f = from_ + (to_ - from_) * fraction;
        if (f <= state_->last) return;  // threads overtake each other
        state_->last = f;
        state_->tell(f);
    }

  private:
    struct State {
        std::function<void(double)> tell;
        std::mutex mutex;
        double last = -1;
    };
    std::shared_ptr<State> state_;
    double from_ = 0, to_ = 1;
};

// Calls use(i) for every family of the tile, in parallel. `progress` is of the whole level.
template <class Use>
void each_family(const TreeDesc& tree, const Tile& tile, const std::stop_token& stop, const Progress& progress, const Use& use) {
    const double count = double(family_count(tree, tile.level));
    std::atomic<std::int64_t> done{tile.first};
    parallel_for(tile.first, tile.last, 1, [&](std::int64_t lo, std::int64_t hi) {
        for (std::int64_t i = lo; i < hi; ++i) {
            check_stop(stop);
            use(i);
            progress(double(++done) / count);
        }
    }, stop);
}

}  // namespace voxloom::wavelet
