// The runs that a frame's triangles are drawn in.
#include <gtest/gtest.h>

#include <random>

#include "app/editor/model/batches.h"

namespace voxloom::editor {
namespace {

constexpr Letters kLetters{7, {0.25f, 0.5f}};
constexpr std::uint32_t kSolid = 0xff102030, kClear = 0x80102030;

// Two triangles, of one colour or of letters.
void add_box(DrawnList& list, glm::vec2 lo, glm::vec2 size, std::uint32_t color, bool letter = false) {
    const auto first = std::uint16_t(list.vertices.size());
    for (const glm::vec2 p : {glm::vec2(0), glm::vec2(1, 0), glm::vec2(1), glm::vec2(0, 1)})
        list.vertices.push_back({lo + p * size, letter ? p : kLetters.white, color});
    for (int i : {0, 1, 2, 0, 2, 3}) list.indices.push_back(std::uint16_t(first + i));
    list.commands.back().count += 6;
}
DrawnList one_command(std::uintptr_t texture = kLetters.texture) { return {"a", {}, {}, {{{0, 0, 1000, 1000}, texture, 0, 0, 0}}}; }

TEST(Batches, largeAreasOfOneColourNeedNoTexture) {
    DrawnList list = one_command();
    add_box(list, {0, 0}, {500, 500}, kSolid);
    add_box(list, {10, 10}, {100, 80}, kClear);
    add_box(list, {20, 20}, {8, 12}, kSolid, true);
    add_box(list, {0, 0}, {50, 160}, kSolid);
    const std::vector<Batch> batches = batches_of({list}, kLetters);
    ASSERT_EQ(batches.size(), 4U);
    EXPECT_EQ(batches[0].kind, Batch::Kind::opaque);
    EXPECT_EQ(batches[1].kind, Batch::Kind::plain);
    EXPECT_EQ(batches[2].kind, Batch::Kind::textured);
    EXPECT_EQ(batches[3].kind, Batch::Kind::opaque);
}

TEST(Batches, smallThingsAmongLettersStayWithThem) {
    DrawnList list = one_command();
    for (int i = 0; i < 50; ++i) {
        add_box(list, {i, 0}, {4, 4}, i % 3 ? kSolid : kClear);
        add_box(list, {i, 0}, {8, 12}, kSolid, true);
    }
    const std::vector<Batch> batches = batches_of({list}, kLetters);
    ASSERT_EQ(batches.size(), 1U);
    EXPECT_EQ(batches[0].kind, Batch::Kind::textured);
    EXPECT_EQ(batches[0].count, 600U);
}

TEST(Batches, picturesKeepTheirTextureWhereverTheirTexelsLie) {
    DrawnList list = one_command(9);
    add_box(list, {0, 0}, {500, 500}, kSolid);  // its texels lie where the letters' white does
    const std::vector<Batch> batches = batches_of({list}, kLetters);
    ASSERT_EQ(batches.size(), 1U);
    EXPECT_EQ(batches[0].kind, Batch::Kind::textured);
    EXPECT_EQ(batches[0].texture, 9U);
    EXPECT_TRUE(batches_of({}, kLetters).empty());
    EXPECT_TRUE(batches_of({one_command()}, kLetters).empty());
}

TEST(Batches, drawEverythingOnceInOrderAndInAWayThatCan) {
    std::mt19937 random(3);
    auto below = [&](int n) { return int(random() % unsigned(n)); };
    std::vector<DrawnList> lists(3);
    for (DrawnList& list : lists)
        for (int c = 0; c < 5; ++c) {
            list.commands.push_back({{c, 0, 900, 900}, std::uintptr_t(7 + c % 2), 0, std::uint32_t(list.indices.size()), 0});
            for (int i = below(60); i > 0; --i)
                add_box(list, {below(500), below(500)}, {1 + below(300), 1 + below(300)}, below(2) ? kSolid : kClear, below(3) == 0);
        }
    const std::vector<Batch> batches = batches_of(lists, kLetters);
    auto batch = batches.begin();
    std::uint32_t drawn = 0;  // of the batch
    for (std::uint32_t l = 0; l < lists.size(); ++l)
        for (const DrawnCommand& command : lists[l].commands)
            for (std::uint32_t at = 0; at < command.count; at += 3, drawn += 3) {
                if (batch != batches.end() && drawn == batch->count) ++batch, drawn = 0;
                ASSERT_NE(batch, batches.end());
                ASSERT_EQ(batch->list, l);
                ASSERT_EQ(batch->clip, command.clip);
                ASSERT_EQ(batch->first_vertex, command.first_vertex);
                ASSERT_EQ(batch->first_index + drawn, command.first_index + at);
                const DrawnVertex& v = lists[l].vertices[lists[l].indices[command.first_index + at]];
                const bool plain = command.texture == kLetters.texture && v.texel == kLetters.white && lists[l].vertices[lists[l].indices[command.first_index + at + 1]].texel == kLetters.white;
                if (batch->kind != Batch::Kind::textured) { ASSERT_TRUE(plain); }
                else { ASSERT_EQ(batch->texture, command.texture); }
                if (batch->kind == Batch::Kind::opaque) { ASSERT_EQ(v.color, kSolid); }
            }
    ASSERT_EQ(drawn, batches.back().count);
    EXPECT_EQ(batch + 1, batches.end());
}

}  // namespace
}  // namespace voxloom::editor
