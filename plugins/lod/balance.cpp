#include "plugins/lod/balance.h"

#include <algorithm>
#include <deque>
#include <queue>
#include <tuple>

#include "core/base/error.h"

namespace voxloom::lod {

CompleteTree::CompleteTree(const BricksDesc& bricks, const Selection& selection)
    : bricks_(bricks), cut_(coarsest_cut(bricks)) {
    for (std::int32_t root : cut_.roots) {
        cut_.nodes[std::size_t(root)].drawn = false;
        index_.emplace(cut_.nodes[std::size_t(root)].id, root);
    }
    std::vector<std::int32_t> fresh;
    const auto nobody = [](BrickId) { return false; };
    auto draw = [&](BrickId id, double error) {
        reach(id, nobody, fresh);
        Cut::Node& node = cut_.nodes[std::size_t(find(id))];
        node.drawn = true;
        node.predicted_error = error;
    };
    // Whole bricks first, so that those which were replaced in part are known by being split.
    for (const SelectedBrick& brick : selection.bricks)
        if (brick.octants == 0xff || brick.id.level == 0) draw(brick.id, brick.predicted_error);
    for (const SelectedBrick& brick : selection.bricks)
        if (brick.octants != 0xff && brick.id.level > 0)
            for (const BrickId& child : bricks.finer(brick.id))
                if (brick.octants >> bricks.octant_of(child) & 1) draw(child, brick.predicted_error);
    drawn_ = std::int64_t(cut_.bricks());
}

std::int32_t CompleteTree::find(BrickId id) const {
    const auto it = index_.find(id);
    return it == index_.end() ? -1 : it->second;
}

bool CompleteTree::is_split(BrickId id) const {
    const std::int32_t node = find(id);
    return node >= 0 && !cut_.nodes[std::size_t(node)].is_leaf();
}

// The children are drawn where the node was.
void CompleteTree::split(std::int32_t index, bool drawn_children) {
    const BrickId id = cut_.nodes[std::size_t(index)].id;
    const double error = cut_.nodes[std::size_t(index)].predicted_error;
    for (const BrickId& finer : bricks_.finer(id)) {
        const auto child = std::int32_t(cut_.nodes.size());
        cut_.nodes[std::size_t(index)].child[std::size_t(bricks_.octant_of(finer))] = child;
        cut_.nodes.push_back(whole_node(bricks_, finer));
        cut_.nodes.back().drawn = drawn_children;
        cut_.nodes.back().predicted_error = error;
        index_.emplace(finer, child);
    }
    // From now on it stands for its children; whether they are drawn is theirs to say.
    cut_.nodes[std::size_t(index)].drawn = true;
}

// Splits what is above `id` until it is there; nodes that are new go to `fresh`.
void CompleteTree::reach(BrickId id, const std::function<bool(BrickId)>& seen,
                         std::vector<std::int32_t>& fresh) {
    std::vector<BrickId> missing;
    while (find(id) < 0) {
        missing.push_back(id);
        id = *bricks_.coarser(id);
    }
    for (; !missing.empty(); missing.pop_back()) {
        const std::int32_t parent = find(*bricks_.coarser(missing.back()));
        const bool was_drawn = cut_.nodes[std::size_t(parent)].draws();
        const std::size_t first = cut_.nodes.size();
        split(parent, was_drawn);
        drawn_ -= was_drawn;
        for (std::size_t i = first; i < cut_.nodes.size(); ++i) {
            if (was_drawn) cut_.nodes[i].drawn = seen(cut_.nodes[i].id);
            drawn_ += cut_.nodes[i].drawn;
            fresh.push_back(std::int32_t(i));
        }
    }
}

void CompleteTree::balance(const std::function<bool(BrickId)>& seen, const std::stop_token& stop) {
    // The finest ask first: what they split is split once.
    std::vector<std::int32_t> work(cut_.nodes.size());
    for (std::size_t i = 0; i < work.size(); ++i) work[i] = std::int32_t(i);
    std::ranges::stable_sort(work, [&](std::int32_t a, std::int32_t b) {
        return cut_.nodes[std::size_t(a)].id.level > cut_.nodes[std::size_t(b)].id.level;
    });
    std::vector<std::int32_t> fresh;
    for (std::size_t turn = 0; !work.empty(); ++turn) {
        if (turn % 256 == 0) check_stop(stop);
        const Cut::Node& node = cut_.nodes[std::size_t(work.back())];
        const BrickId id = node.id;
        work.pop_back();
        // A brick's neighbour may be one level coarser: the neighbour's parent has to be there. That
        // holds for split nodes too, as their children ask for more.
        const std::optional<BrickId> parent = bricks_.coarser(id);
        if (!parent) continue;
        fresh.clear();
        for_each_neighbour(bricks_, id, [&](BrickId other, glm::ivec3) {
            const BrickId above = *bricks_.coarser(other);
            if (above != *parent && find(above) < 0) reach(above, seen, fresh);
        });
        work.insert(work.end(), fresh.begin(), fresh.end());
    }
}

bool CompleteTree::may_merge(std::int32_t index) const {
    const Cut::Node& node = cut_.nodes[std::size_t(index)];
    bool may = true;
    for (std::int32_t child : node.child)
        if (child >= 0) {
            const Cut::Node& c = cut_.nodes[std::size_t(child)];
            may = may && c.is_leaf();
            for_each_neighbour(bricks_, c.id, [&](BrickId other, glm::ivec3) { may = may && !is_split(other); });
        }
    return may;
}

bool CompleteTree::merge_down_to(std::int64_t most, const std::function<double(BrickId)>& price,
                                 const std::stop_token& stop) {
    struct Offer {
        double price;
        std::int32_t node;
        bool operator<(const Offer& other) const {
            return std::tie(price, node) > std::tie(other.price, other.node);  // the cheapest on top
        }
    };
    std::priority_queue<Offer> offers;
    auto offer = [&](std::int32_t node) {
        if (node >= 0 && !cut_.nodes[std::size_t(node)].is_leaf() && may_merge(node))
            offers.push({price(cut_.nodes[std::size_t(node)].id), node});
    };
    if (drawn_ > most)
        for (std::size_t i = 0; i < cut_.nodes.size(); ++i) offer(std::int32_t(i));
    for (std::size_t turn = 0; drawn_ > most; ++turn) {
        if (turn % 64 == 0) check_stop(stop);
        if (offers.empty()) return false;
        const Offer cheapest = offers.top();
        offers.pop();
        const std::int32_t index = cheapest.node;
        // Offers stand until they are taken; meanwhile things may have changed.
        if (cut_.nodes[std::size_t(index)].is_leaf() || !may_merge(index)) continue;
        Cut::Node& node = cut_.nodes[std::size_t(index)];
        bool drawn = false;
        for (std::int32_t& child : node.child)
            if (child >= 0) {
                Cut::Node& c = cut_.nodes[std::size_t(child)];
                drawn = drawn || c.drawn;
                drawn_ -= c.drawn;
                c.drawn = false;
                index_.erase(c.id);
                child = Cut::kOpen;
            }
        node.drawn = drawn;
        node.predicted_error = cheapest.price;
        drawn_ += drawn;
        const BrickId id = node.id;
        if (const auto parent = bricks_.coarser(id)) offer(find(*parent));
        for_each_neighbour(bricks_, id, [&](BrickId other, glm::ivec3) {
            if (const auto parent = bricks_.coarser(other)) offer(find(*parent));
        });
    }
    return true;
}

void CompleteTree::set_corner_blends() {
    for (Cut::Node& node : cut_.nodes) {
        if (!node.draws() || find(node.id) < 0) continue;
        node.corner_blend.fill(0.0f);
        for_each_neighbour(bricks_, node.id, [&](BrickId other, glm::ivec3 offset) {
            if (find(other) >= 0) return;  // as fine as this one, or finer
            std::int32_t coarser = -1;
            for (std::optional<BrickId> above = bricks_.coarser(other); above && coarser < 0; above = bricks_.coarser(*above))
                coarser = find(*above);
            if (coarser < 0 || !cut_.nodes[std::size_t(coarser)].draws()) return;  // shows nothing to blend into
            // The corners that the neighbour touches: on each axis its own side, or both.
            for (int corner = 0; corner < 8; ++corner) {
                bool touches = true;
                for (int a = 0; a < 3; ++a)
                    touches = touches && (offset[a] == 0 || (offset[a] > 0) == bool(corner >> a & 1));
                if (touches) node.corner_blend[std::size_t(corner)] = 1.0f;
            }
        });
    }
}

}  // namespace voxloom::lod
