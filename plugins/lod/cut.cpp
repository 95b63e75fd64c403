#include "plugins/lod/cut.h"

#include <algorithm>
#include <numeric>

namespace voxloom::lod {

bool Cut::Node::is_leaf() const {
    return std::ranges::none_of(child, [](std::int32_t c) { return c >= 0; });
}

bool Cut::Node::draws() const { return drawn && (is_leaf() || open() != 0); }

std::uint8_t Cut::Node::open() const {
    std::uint8_t mask = 0;
    for (int o = 0; o < 8; ++o)
        if (child[std::size_t(o)] == kOpen) mask = std::uint8_t(mask | 1 << o);
    return mask;
}

std::size_t Cut::bricks() const {
    return std::size_t(std::ranges::count_if(nodes, [](const Node& n) { return n.draws(); }));
}

Cut::Node whole_node(const BricksDesc& bricks, BrickId id) {
    Cut::Node node;
    node.id = id;
    for (int o = 0; o < 8; ++o)
        node.child[std::size_t(o)] =
            fine_box_of_octant(bricks, id, o).empty() ? Cut::kUnseen : Cut::kOpen;
    return node;
}

Cut coarsest_cut(const BricksDesc& bricks) {
    Cut cut;
    const int top = int(bricks.levels.size()) - 1;
    const glm::ivec3 n = bricks.levels.back().bricks;
    for (int z = 0; z < n.z; ++z)
        for (int y = 0; y < n.y; ++y)
            for (int x = 0; x < n.x; ++x) {
                cut.roots.push_back(std::int32_t(cut.nodes.size()));
                cut.nodes.push_back(whole_node(bricks, {top, {x, y, z}}));
            }
    return cut;
}

namespace {

class Lister {
  public:
    Lister(const Cut& cut, const BricksDesc& bricks, const Sight* sight, Selection& out)
        : cut_(cut), bricks_(bricks), sight_(sight), out_(out) {}

    void roots() {
        const LevelDesc& top = bricks_.levels.back();
        std::vector<int> order[3];
        for (int a = 0; a < 3; ++a)
            if (sight_) {
                order[a] = sight_->back_to_front(a, top.bricks[a],
                                                 double(bricks_.brick[a]) * double(top.stride[a]));
            } else {
                order[a].resize(std::size_t(top.bricks[a]));
                std::iota(order[a].begin(), order[a].end(), 0);
            }
        for (int z : order[2])
            for (int y : order[1])
                for (int x : order[0])
                    node(cut_.roots[(std::size_t(z) * std::size_t(top.bricks.y) + std::size_t(y)) *
                                        std::size_t(top.bricks.x) + std::size_t(x)]);
    }

  private:
    void node(std::int32_t index) {
        const Cut::Node& n = cut_.nodes[std::size_t(index)];
        if (!n.drawn) return;
        if (n.is_leaf()) {
            add(n, 0xff);
            return;
        }
        const glm::ivec3 finer = bricks_.levels[std::size_t(n.id.level) - 1].stride;
        const glm::ivec3 halves = bricks_.levels[std::size_t(n.id.level)].stride / finer;
        const glm::dvec3 split((n.id.index * halves + 1) * bricks_.brick * finer);
        const int eye = sight_ ? sight_->octant_of_eye(split) : 7;
        for (int i = 7; i >= 0; --i) {
            const int octant = eye ^ i;
            const std::int32_t child = n.child[std::size_t(octant)];
            if (child >= 0)
                node(child);
            else if (child == Cut::kOpen)
                add(n, std::uint8_t(1 << octant));
        }
    }
    void add(const Cut::Node& n, std::uint8_t octants) {
        // Octants of one brick that follow each other are drawn together.
        if (octants != 0xff && !out_.bricks.empty() && out_.bricks.back().id == n.id) {
            out_.bricks.back().octants = std::uint8_t(out_.bricks.back().octants | octants);
            return;
        }
        out_.bricks.push_back({n.id, octants, n.corner_blend, n.predicted_error});
        out_.predicted_error = std::max(out_.predicted_error, n.predicted_error);
    }

    const Cut& cut_;
    const BricksDesc& bricks_;
    const Sight* sight_;
    Selection& out_;
};

}  // namespace

void list_bricks(const Cut& cut, const BricksDesc& bricks, const Sight* sight, Selection& selection) {
    selection.bricks.clear();
    selection.predicted_error = 0;
    Lister(cut, bricks, sight, selection).roots();
}

std::shared_ptr<Selection> new_selection(const BricksDesc& bricks, std::string policy, CameraPtr camera,
                                         glm::ivec2 size) {
    auto selection = std::make_shared<Selection>();
    selection->of = std::make_shared<BricksDesc>(bricks);
    selection->policy = std::move(policy);
    selection->camera = std::move(camera);
    if (selection->camera) selection->size = size;
    return selection;
}

}  // namespace voxloom::lod
