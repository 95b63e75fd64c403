#include "plugins/lod/priority.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>
#include <tuple>

#include "core/base/error.h"
#include "core/base/morton.h"

namespace voxloom::lod {

double pixel_error(double squared, double voxels, double pixels_per_voxel) {
    return voxels > 0 ? std::sqrt(squared / voxels) * std::min(1.0, pixels_per_voxel) : 0;
}

namespace {

// What the queue knows of a node beside the cut.
struct Weights {
    OctantErrors squared{};
    std::array<double, 8> voxels{}, depth{};
};

struct Entry {
    double priority, error;
    std::uint64_t place;
    int level;
    std::int32_t node;
    friend bool operator<(const Entry& a, const Entry& b) {
        return std::tie(a.priority, a.error, b.place, a.level) <
               std::tie(b.priority, b.error, a.place, b.level);
    }
};

class Queue {
  public:
    Queue(const BricksDesc& bricks, const ErrorModel& errors, const Sight& sight,
          const PriorityLimits& limits)
        : bricks_(bricks), errors_(errors), sight_(sight), limits_(limits) {}

    PriorityResult run(const std::stop_token& stop) {
        cut_ = coarsest_cut(bricks_);
        weights_.resize(cut_.nodes.size());
        constexpr double inf = std::numeric_limits<double>::infinity();
        for (std::int32_t root : cut_.roots) {
            look_at(root, inf);
            resident_ += cut_.nodes[std::size_t(root)].drawn;
            enqueue(root);
        }
        for (int turn = 0; !queue_.empty(); ++turn) {
            if (turn % 256 == 0) check_stop(stop);
            const std::int32_t node = queue_.top().node;
            queue_.pop();
            if (!replace_worst_octant(node)) break;
            enqueue(node);
        }
        return finish();
    }

  private:
    double square_of_share(const Weights& w, std::size_t o) const {
        return w.squared[o] > 0 ? w.squared[o] * sight_.nearness(w.depth[o]) * sight_.nearness(w.depth[o]) : 0;
    }

    // Fills in what is known of a new node, none of whose voxels is worse than `most` in square.
    void look_at(std::int32_t index, double most) {
        Cut::Node& node = cut_.nodes[std::size_t(index)];
        Weights& w = weights_[std::size_t(index)];
        const std::optional<OctantErrors> errors = errors_(node.id);
        node.drawn = errors.has_value();
        if (!node.drawn) return;
        bool seen = false;
        double sum = 0;
        for (int octant = 0; octant < 8; ++octant) {
            const auto o = std::size_t(octant);
            if (node.child[o] == Cut::kUnseen) continue;
            const Box box = fine_box_of_octant(bricks_, node.id, octant);
            const Region region = region_of(bricks_.volume, box);
            if (!sight_.sees(region)) {
                node.child[o] = Cut::kUnseen;
                continue;
            }
            seen = true;
            w.squared[o] = (*errors)[o];
            w.voxels[o] = double(box.voxels());
            w.depth[o] = sight_.depth(region);
            sum += w.squared[o];
        }
        node.drawn = seen;
        if (sum > most)
            for (double& s : w.squared) s *= most / sum;
    }

    // Error, voxels and least depth of what a node still draws itself.
    struct Rest {
        double squared = 0, voxels = 0, depth = std::numeric_limits<double>::infinity(), share = 0;
    };
    Rest rest_of(std::int32_t index) const {
        Rest rest;
        const Weights& w = weights_[std::size_t(index)];
        for (std::size_t o = 0; o < 8; ++o)
            if (cut_.nodes[std::size_t(index)].child[o] == Cut::kOpen) {
                rest.squared += w.squared[o];
                rest.voxels += w.voxels[o];
                rest.depth = std::min(rest.depth, w.depth[o]);
                rest.share += square_of_share(w, o);
            }
        return rest;
    }
    double pixel_error_of(const Rest& rest, int level) const {
        return pixel_error(rest.squared, rest.voxels, sight_.pixels(level, rest.depth));
    }

    void enqueue(std::int32_t index) {
        const Cut::Node& node = cut_.nodes[std::size_t(index)];
        if (!node.drawn || node.id.level == 0) return;
        const Rest rest = rest_of(index);
        if (!(rest.squared > 0) || pixel_error_of(rest, node.id.level) <= limits_.error ||
            sight_.pixels(node.id.level, rest.depth) <= limits_.pixels)
            return;
        queue_.push({std::sqrt(rest.squared) * sight_.nearness(rest.depth), std::sqrt(rest.squared),
                     morton(node.id.index), node.id.level, index});
    }

    // False when the budget does not allow it.
    bool replace_worst_octant(std::int32_t index) {
        const std::vector<BrickId> finer = bricks_.finer(cut_.nodes[std::size_t(index)].id);
        int worst = -1;
        BrickId id;
        for (const BrickId& child : finer) {
            const auto o = std::size_t(bricks_.octant_of(child));
            if (cut_.nodes[std::size_t(index)].child[o] != Cut::kOpen) continue;
            const Weights& w = weights_[std::size_t(index)];
            if (worst >= 0 && std::tuple(square_of_share(w, o), w.squared[o]) <=
                                  std::tuple(square_of_share(w, std::size_t(worst)), w.squared[std::size_t(worst)]))
                continue;
            worst = int(o);
            id = child;
        }
        const auto o = std::size_t(worst);
        const auto child = std::int32_t(cut_.nodes.size());
        cut_.nodes.push_back(whole_node(bricks_, id));
        weights_.emplace_back();
        look_at(child, weights_[std::size_t(index)].squared[o]);
        Cut::Node& parent = cut_.nodes[std::size_t(index)];
        const bool leaves = parent.open() == 1u << worst;
        const std::int64_t after = resident_ + cut_.nodes.back().drawn - leaves;
        if (after > limits_.bricks) {
            cut_.nodes.pop_back();
            weights_.pop_back();
            return false;
        }
        resident_ = after;
        parent.child[o] = child;
        enqueue(child);
        return true;
    }

    PriorityResult finish() {
        double sum = 0;
        for (std::size_t i = 0; i < cut_.nodes.size(); ++i) {
            Cut::Node& node = cut_.nodes[i];
            if (!node.draws()) continue;
            node.predicted_error = pixel_error_of(rest_of(std::int32_t(i)), node.id.level);
            for (std::size_t o = 0; o < 8; ++o) {
                if (node.child[o] != Cut::kOpen) continue;
                const double near = std::min(sight_.nearness(weights_[i].depth[o]), 1e3);
                sum += weights_[i].squared[o] * near * near;
            }
        }
        return {std::move(cut_), std::sqrt(sum)};
    }

    const BricksDesc& bricks_;
    const ErrorModel& errors_;
    const Sight& sight_;
    const PriorityLimits& limits_;
    Cut cut_;
    std::vector<Weights> weights_;  // as the cut's nodes
    std::priority_queue<Entry> queue_;
    std::int64_t resident_ = 0;
};

}  // namespace

PriorityResult select_by_priority(const BricksDesc& bricks, const ErrorModel& errors, const Sight& sight,
                                  const PriorityLimits& limits, const std::stop_token& stop) {
    return Queue(bricks, errors, sight, limits).run(stop);
}

void predict_errors(Cut& cut, const BricksDesc& bricks, const ErrorModel& errors, const Sight* sight) {
    for (Cut::Node& node : cut.nodes) {
        if (!node.draws()) continue;
        const std::optional<OctantErrors> squares = errors(node.id);
        if (!squares) {
            node.drawn = false;
            continue;
        }
        double squared = 0, voxels = 0, depth = std::numeric_limits<double>::infinity();
        for (int octant = 0; octant < 8; ++octant) {
            const auto o = std::size_t(octant);
            if (node.child[o] != Cut::kOpen) continue;
            const Box box = fine_box_of_octant(bricks, node.id, octant);
            squared += (*squares)[o];
            voxels += double(box.voxels());
            if (sight) depth = std::min(depth, sight->depth(region_of(bricks.volume, box)));
        }
        node.predicted_error =
            pixel_error(squared, voxels, sight ? sight->pixels(node.id.level, depth) : 1.0);
    }
}

void add_blend_errors(Cut& cut, const BricksDesc& bricks, const ErrorModel& errors, const Sight* sight) {
    for (Cut::Node& node : cut.nodes) {
        const std::optional<BrickId> parent = bricks.coarser(node.id);
        if (!node.draws() || !parent || std::ranges::count(node.corner_blend, 0.0f) == 8) continue;
        const std::optional<OctantErrors> squares = errors(*parent);
        if (!squares) continue;
        const int octant = bricks.octant_of(node.id);
        const Box box = fine_box_of_octant(bricks, *parent, octant);
        const double pixels = sight ? sight->pixels(parent->level, sight->depth(region_of(bricks.volume, box))) : 1.0;
        node.predicted_error = std::hypot(node.predicted_error,
                                          pixel_error((*squares)[std::size_t(octant)], double(box.voxels()), pixels));
    }
}

}  // namespace voxloom::lod
