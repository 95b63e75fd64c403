#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "plugins/lod/balance.h"
#include "plugins/lod/nodes.h"
#include "plugins/lod/priority.h"
#include "plugins/lod/synthetic_bricks.h"
#include "tests/support/run_node.h"

namespace voxloom::lod {
namespace {

using voxloom::testing::NodeInputs;
using voxloom::testing::NodeRun;
using voxloom::testing::params_from_yaml;
using voxloom::testing::run_node;

// A brick's box if the volume did not end: where its neighbours meet it.
Region whole_region(const BricksDesc& desc, BrickId id) {
    const glm::dvec3 size = glm::dvec3(desc.brick) * glm::dvec3(desc.levels[std::size_t(id.level)].stride);
    return {glm::dvec3(id.index) * size, glm::dvec3(id.index + 1) * size};
}

std::vector<const Cut::Node*> leaves_of(const CompleteTree& tree) {
    std::vector<const Cut::Node*> leaves;
    for (const Cut::Node& n : tree.cut().nodes)
        if (n.is_leaf() && tree.find(n.id) >= 0) leaves.push_back(&n);
    return leaves;
}

void expect_balanced(const CompleteTree& tree, const BricksDesc& desc) {
    const auto leaves = leaves_of(tree);
    std::size_t touching = 0;
    for (const Cut::Node* a : leaves)
        for (const Cut::Node* b : leaves) {
            const Region p = whole_region(desc, a->id), q = whole_region(desc, b->id);
            if (a == b || glm::any(glm::greaterThan(p.lo, q.hi)) || glm::any(glm::greaterThan(q.lo, p.hi))) continue;
            ++touching;
            EXPECT_LE(std::abs(a->id.level - b->id.level), 1);
        }
    EXPECT_TRUE(leaves.size() < 2 || touching > 0);
}

void expect_blends(const CompleteTree& tree, const BricksDesc& desc) {
    const auto leaves = leaves_of(tree);
    for (const Cut::Node* a : leaves) {
        if (!a->drawn) continue;
        const Region p = whole_region(desc, a->id);
        for (int corner = 0; corner < 8; ++corner) {
            const glm::dvec3 at(corner & 1 ? p.hi.x : p.lo.x, corner & 2 ? p.hi.y : p.lo.y, corner & 4 ? p.hi.z : p.lo.z);
            float want = 0;
            for (const Cut::Node* b : leaves) {
                const Region q = whole_region(desc, b->id);
                if (b->draws() && b->id.level > a->id.level && glm::all(glm::lessThanEqual(q.lo, at)) && glm::all(glm::lessThanEqual(at, q.hi)))
                    want = 1;
            }
            EXPECT_EQ(a->corner_blend[std::size_t(corner)], want);
        }
    }
}

// A selection by splitting bricks at random from the coarsest on, some of it left out.
Selection random_selection(const BricksDesc& desc, unsigned seed, bool in_part) {
    std::mt19937 random(seed);
    Cut cut = coarsest_cut(desc);
    for (std::size_t i = 0; i < cut.nodes.size() && cut.nodes.size() < 300; ++i) {
        const BrickId id = cut.nodes[i].id;
        if (id.level == 0 || (i > 0 && random() % 3 == 0)) continue;
        for (const BrickId& finer : desc.finer(id)) {
            if (in_part && random() % 4 == 0) continue;
            cut.nodes[i].child[std::size_t(desc.octant_of(finer))] = std::int32_t(cut.nodes.size());
            cut.nodes.push_back(whole_node(desc, finer));
        }
    }
    for (Cut::Node& n : cut.nodes)
        if (n.is_leaf() && random() % 5 == 0) n.drawn = false;
    auto selection = new_selection(desc, "test", nullptr, {});
    list_bricks(cut, desc, nullptr, *selection);
    return *selection;
}

const auto everything = [](BrickId) { return true; };

TEST(Balance, NeighboursDifferByOneLevelAndCornersFollowTheCoarser) {
    struct {
        Index3 dims;
        glm::dvec3 spacing;
    } volumes[] = {{{64, 64, 64}, glm::dvec3(1)}, {{61, 33, 90}, glm::dvec3(1)}, {{128, 128, 12}, {0.5, 0.5, 5}}, {{200, 1, 1}, glm::dvec3(1)}};
    for (const auto& v : volumes) {
        const SyntheticBricks bricks(v.dims, glm::ivec3(4), shell_error, v.spacing);
        for (unsigned seed = 0; seed < 3; ++seed) {
            CompleteTree tree(bricks.desc(), random_selection(bricks.desc(), seed, seed % 2 == 1));
            tree.balance(everything);
            tree.set_corner_blends();
            EXPECT_EQ(tree.drawn(), std::int64_t(tree.cut().bricks()));
            expect_balanced(tree, bricks.desc());
            expect_blends(tree, bricks.desc());
        }
    }
}

TEST(Balance, DrawsTheSameVoxelsAsBefore) {
    const SyntheticBricks bricks({61, 33, 50}, glm::ivec3(4), shell_error);
    for (bool in_part : {false, true}) {
        const Selection before = random_selection(bricks.desc(), 11, in_part);
        CompleteTree tree(bricks.desc(), before);
        tree.balance(everything);
        Selection after = before;
        list_bricks(tree.cut(), bricks.desc(), nullptr, after);
        auto drawn = [&](const Selection& s) {
            std::vector<int> count(bricks.desc().volume.voxels());
            for (const SelectedBrick& b : s.bricks)
                for (int o = 0; o < 8; ++o) {
                    const bool whole = b.octants == 0xff;
                    if (whole ? o > 0 : !(b.octants >> o & 1)) continue;
                    const Box box = whole ? bricks.desc().fine_box_of(b.id) : fine_box_of_octant(bricks.desc(), b.id, o);
                    for (auto z = box.lo.z; z < box.hi.z; ++z)
                        for (auto y = box.lo.y; y < box.hi.y; ++y)
                            for (auto x = box.lo.x; x < box.hi.x; ++x) ++count[std::size_t((z * 33 + y) * 61 + x)];
                }
            return count;
        };
        EXPECT_EQ(drawn(before), drawn(after));
        for (const SelectedBrick& b : after.bricks) EXPECT_EQ(b.octants, 0xff);
    }
}

TEST(Balance, MergingKeepsTheBudgetAndTheBalance) {
    const SyntheticBricks bricks({64, 64, 64}, glm::ivec3(4), shell_error);
    for (std::int64_t budget : {400, 100, 30, 9, 1}) {
        CompleteTree tree(bricks.desc(), random_selection(bricks.desc(), 4, true));
        tree.balance(everything);
        ASSERT_GT(tree.drawn(), 400);
        EXPECT_TRUE(tree.merge_down_to(budget, [&](BrickId id) { return bricks.info(id).l2; }));
        EXPECT_LE(tree.drawn(), budget);
        EXPECT_GE(tree.drawn(), budget - 8);  // no more than it takes
        EXPECT_EQ(tree.drawn(), std::int64_t(tree.cut().bricks()));
        tree.set_corner_blends();
        expect_balanced(tree, bricks.desc());
        expect_blends(tree, bricks.desc());
    }
}

TEST(Balance, WhatIsMixedInCountsAsAnError) {
    // Level 1 is off by 0.03 everywhere, level 2 by 0.04: bricks of level 1 that blend may be off by 0.05.
    const auto bricks = std::make_shared<SyntheticBricks>(Index3(64), glm::ivec3(8), [](int level, glm::dvec3) { return 0.02 + 0.01 * level; });
    auto selection = new_selection(bricks->desc(), "test", nullptr, {});
    for (const BrickId& id : bricks->desc().finer({3, {0, 0, 0}})) {
        if (bricks->desc().octant_of(id) != 3) selection->bricks.push_back({.id = id});
        else
            for (const BrickId& finer : bricks->desc().finer(id)) selection->bricks.push_back({.id = finer});
    }
    CompleteTree tree(bricks->desc(), *selection);
    const ErrorModel errors = value_errors(bricks);
    predict_errors(tree.cut(), bricks->desc(), errors, nullptr);
    tree.set_corner_blends();
    add_blend_errors(tree.cut(), bricks->desc(), errors, nullptr);
    std::size_t blending = 0;
    for (const Cut::Node* node : leaves_of(tree)) {
        const bool blends = std::ranges::any_of(node->corner_blend, [](float share) { return share > 0; });
        EXPECT_NEAR(node->predicted_error, node->id.level == 2 ? 0.04 : blends ? 0.05 : 0.03, 1e-6);
        blending += blends;
    }
    EXPECT_EQ(blending, 7u);  // all but the one in the volume's corner
}

TEST(BalanceNode, CountsWhatItAddsAgainstTheBudget) {
    const BricksPtr bricks = std::make_shared<SyntheticBricks>(Index3(256, 256, 256), glm::ivec3(8), shell_error);
    auto camera = std::make_shared<Camera>();
    camera->eye = {500, 300, 100};
    camera->target = {128, 128, 128};
    const NodeType priority = priority_node(), balance = balance_node();
    const NodeRun chosen = run_node(priority, params_from_yaml(priority, "{max_bricks: 300, max_error: 0, pixels: 0.0625}"),
                                    {{"bricks", {bricks}}, {"camera", {CameraPtr(camera)}}});
    double free = 0;
    for (int budget : {0, 300}) {
        const NodeRun r = run_node(balance, params_from_yaml(balance, fmt::format("{{max_bricks: {}}}", budget)),
                                   {{"bricks", {bricks}}, {"selection", {chosen.output<Selection>("selection")}}});
        if (budget == 0) {
            free = r.measured("bricks");
            EXPECT_GT(free, r.measured("bricks before"));
        } else {
            EXPECT_GT(free, 300);
            EXPECT_LE(r.measured("bricks"), 300);
        }
        EXPECT_GT(r.measured("predicted pixel error"), 0);
    }
}

TEST(BalanceNode, RefusesBricksThatTheSelectionIsNotOf) {
    const BricksPtr bricks = std::make_shared<SyntheticBricks>(Index3(64), glm::ivec3(8), shell_error);
    const BricksPtr others = std::make_shared<SyntheticBricks>(Index3(65), glm::ivec3(8), shell_error);
    const SelectionPtr selection = new_selection(others->desc(), "test", nullptr, {});
    const NodeType node = balance_node();
    EXPECT_THROW(run_node(node, params_from_yaml(node, "{}"), {{"bricks", {bricks}}, {"selection", {selection}}}), Error);
}

}  // namespace
}  // namespace voxloom::lod
