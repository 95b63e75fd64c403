// Which parts of a window are drawn again, against pictures of whole windows.
#include <gtest/gtest.h>

#include <array>
#include <random>

#include "app/editor/model/damage.h"

namespace voxloom::editor {
namespace {

constexpr glm::ivec2 kSize(160, 90);

// Two triangles.
void add_box(DrawnList& list, glm::vec2 lo, glm::vec2 hi, std::uint32_t color, std::uintptr_t texture = 1, glm::vec4 clip = {0, 0, 160, 90}) {
    if (list.commands.empty() || list.commands.back().texture != texture || list.commands.back().clip != clip)
        list.commands.push_back({clip, texture, 0, std::uint32_t(list.indices.size()), 0});
    const auto first = std::uint16_t(list.vertices.size());
    for (const glm::vec2 p : {lo, glm::vec2(hi.x, lo.y), hi, glm::vec2(lo.x, hi.y)}) list.vertices.push_back({p, {0, 0}, color});
    for (int i : {0, 1, 2, 0, 2, 3}) list.indices.push_back(std::uint16_t(first + i));
    list.commands.back().count += 6;
}

// The window as it is on the screen: the last box over a pixel's middle, painted where `only` says so.
using Picture = std::vector<std::uint64_t>;
void paint(Picture& picture, const std::vector<DrawnList>& lists, const Rect& only) {
    for (int y = only.lo.y; y < only.hi.y; ++y)
        for (int x = only.lo.x; x < only.hi.x; ++x) {
            std::uint64_t& pixel = picture[std::size_t(y * kSize.x + x)] = 0;
            const glm::vec2 p(float(x) + 0.5f, float(y) + 0.5f);
            for (const DrawnList& list : lists)
                for (const DrawnCommand& c : list.commands)
                    for (std::uint32_t i = 0; i < c.count; i += 6) {
                        const DrawnVertex &a = list.vertices[list.indices[c.first_index + i]], &b = list.vertices[list.indices[c.first_index + i + 2]];
                        const glm::vec2 lo = glm::max(a.position, glm::vec2(c.clip)), hi = glm::min(b.position, glm::vec2(c.clip.z, c.clip.w));
                        if (p.x >= lo.x && p.y >= lo.y && p.x < hi.x && p.y < hi.y) pixel = a.color + (std::uint64_t(c.texture) << 32);
                    }
        }
}
Picture painted(const std::vector<DrawnList>& lists) {
    Picture picture(std::size_t(kSize.x * kSize.y));
    paint(picture, lists, {{0, 0}, kSize});
    return picture;
}

TEST(Damage, isNothingWhereNothingChanges) {
    std::vector<DrawnList> lists{{"a", {}, {}, {}}, {"b", {}, {}, {}}};
    add_box(lists[0], {10, 10}, {50, 50}, 7);
    EXPECT_TRUE(damage(lists, lists, kSize).empty());
    EXPECT_TRUE(damage({}, {}, kSize).empty());
}

TEST(Damage, isWhereSomethingWasAndWhereItIs) {
    std::vector<DrawnList> before{{"a", {}, {}, {}}}, now = before;
    add_box(before[0], {0, 0}, {160, 90}, 1), add_box(now[0], {0, 0}, {160, 90}, 1);
    add_box(before[0], {10, 10}, {14, 14}, 2), add_box(now[0], {20, 10}, {24, 14}, 2);
    EXPECT_EQ(damage(before, now, kSize), (std::vector<Rect>{{{9, 9}, {25, 15}}}));
    // Clipped, and another texture in the same place.
    before = now = {{"a", {}, {}, {}}};
    add_box(before[0], {-50, -50}, {200, 200}, 1, 1, {30, 20, 40, 25}), add_box(now[0], {-50, -50}, {200, 200}, 1, 2, {30, 20, 40, 25});
    EXPECT_EQ(damage(before, now, kSize), (std::vector<Rect>{{{30, 20}, {40, 25}}}));
    // A window that comes, and one that goes before another.
    EXPECT_EQ(damage({}, now, kSize), (std::vector<Rect>{{{30, 20}, {40, 25}}}));
    EXPECT_EQ(damage(before, {}, kSize), (std::vector<Rect>{{{30, 20}, {40, 25}}}));
    EXPECT_EQ(damage({{"a", {}, {}, {}}, {"b", {}, {}, {}}}, {{"b", {}, {}, {}}, {"a", {}, {}, {}}}, kSize), (std::vector<Rect>{{{0, 0}, kSize}}));
}

// Every rectangle is a pass over all triangles: the more there are, the fewer rectangles.
TEST(Damage, isOneRectangleWhereManyTrianglesMove) {
    constexpr glm::ivec2 kLarge(1600, 900);
    auto moved_by = [&](float x, int still) {
        std::vector<DrawnList> lists{{"a", {}, {}, {}}};
        const glm::vec4 all(0, 0, kLarge.x, kLarge.y);
        for (int i = 0; i < still; ++i) add_box(lists[0], {1, 1}, {2, 2}, 1, 1, all);
        for (const glm::vec2 corner : {glm::vec2(0), glm::vec2(300, 0), glm::vec2(0, 300), glm::vec2(300, 300)})
            add_box(lists[0], corner + x, corner + 40.f + x, 2, 1, all);
        return lists;
    };
    EXPECT_EQ(damage(moved_by(100, 0), moved_by(101, 0), kLarge).size(), 4U);
    EXPECT_EQ(damage(moved_by(100, 10000), moved_by(101, 10000), kLarge), (std::vector<Rect>{{{99, 99}, {442, 442}}}));
    // Those of another list are no reason: what is far from them there stays a rectangle of its own.
    std::vector<DrawnList> before = moved_by(100, 10000), now = moved_by(101, 10000);
    for (auto* lists : {&before, &now}) lists->push_back({"b", {}, {}, {}}), add_box(lists->back(), {1500, 800}, {1510, 810}, lists == &now, 1, {0, 0, 1600, 900});
    EXPECT_EQ(damage(before, now, kLarge), (std::vector<Rect>{{{99, 99}, {442, 442}}, {{1499, 799}, {1511, 811}}}));
}

TEST(Damage, leavesTheRestAsItIs) {
    std::mt19937 random(5);
    auto below = [&](int n) { return int(random() % unsigned(n)); };
    std::vector<std::array<int, 6>> boxes;
    auto lists_of = [&] {
        std::vector<DrawnList> lists{{"a", {}, {}, {}}, {"b", {}, {}, {}}, {"c", {}, {}, {}}};
        for (const auto& b : boxes) add_box(lists[std::size_t(b[5] % 3)], {b[0], b[1]}, {b[0] + b[2], b[1] + b[3]}, std::uint32_t(b[4]), std::uintptr_t(1 + b[5] % 2),
                                            b[5] % 5 ? glm::vec4(0, 0, 160, 90) : glm::vec4(20, 20, 120, 70));
        return lists;
    };
    auto any = [&] { return std::array<int, 6>{below(150), below(80), 1 + below(60), 1 + below(40), below(1000), below(30)}; };
    for (int i = 0; i < 20; ++i) boxes.push_back(any());
    std::vector<DrawnList> before = lists_of();
    Picture screen = painted(before);
    double redrawn = 0;
    for (int i = 0; i < 300; ++i) {
        const auto at = std::size_t(below(int(boxes.size())));
        if (const int what = below(4); what == 0) boxes.insert(boxes.begin() + std::ptrdiff_t(at), any());
        else if (what == 1 && boxes.size() > 5) boxes.erase(boxes.begin() + std::ptrdiff_t(at));
        else boxes[at][std::size_t(below(5))] += 1;
        const std::vector<DrawnList> now = lists_of();
        for (const Rect& r : damage(before, now, kSize)) {
            ASSERT_TRUE(r.lo.x >= 0 && r.lo.y >= 0 && r.hi.x <= kSize.x && r.hi.y <= kSize.y);
            redrawn += double(r.hi.x - r.lo.x) * double(r.hi.y - r.lo.y) / (kSize.x * kSize.y);
            paint(screen, now, r);
        }
        ASSERT_EQ(screen, painted(now)) << "change " << i;
        before = now;
    }
    EXPECT_LT(redrawn, 0.5 * 300) << "much less than everything";
}

}  // namespace
}  // namespace voxloom::editor
