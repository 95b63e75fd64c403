#include "app/editor/model/input_queue.h"

#include <gtest/gtest.h>

#include <random>

namespace voxloom::editor {
namespace {

using Kind = InputEvent::Kind;

InputEvent key(int code, bool down) { return {.kind = Kind::key, .code = code, .down = down}; }
InputEvent button(int code, bool down) { return {.kind = Kind::button, .code = code, .down = down}; }
InputEvent text(int character, int by, bool repeated = false) {
    return {.kind = Kind::text, .code = character, .typed_by = by, .repeated = repeated};
}
InputEvent pointer(double x, double y) { return {.kind = Kind::pointer, .at = {x, y}}; }
InputEvent wheel(double y) { return {.kind = Kind::wheel, .at = {0, y}}; }

std::vector<std::size_t> sizes(InputQueue& queue) {
    std::vector<std::size_t> all;
    while (!queue.empty()) all.push_back(queue.next_frame().size());
    return all;
}
void add(InputQueue& queue, std::initializer_list<InputEvent> events) {
    for (const InputEvent& event : events) queue.add(event);
}

TEST(InputQueue, aKeyIsSeenDownBeforeItIsUp) {
    InputQueue queue;
    add(queue, {key(65, true), text('a', 65), key(65, false)});
    EXPECT_EQ(sizes(queue), (std::vector<std::size_t>{2, 1}));
    add(queue, {key(340, true), key(65, true), text('A', 65), key(65, false), key(340, false)});
    EXPECT_EQ(sizes(queue), (std::vector<std::size_t>{1, 2, 2})) << "a modifier is down before the key, and not up before it";
    add(queue, {key(341, true), key(90, true), key(341, false), key(90, false), key(341, true)});
    EXPECT_EQ(sizes(queue), (std::vector<std::size_t>{1, 1, 2, 1})) << "whichever is let go first";
}

TEST(InputQueue, whatIsDoneWithTheMouseIsDoneWhereItWas) {
    InputQueue queue;
    add(queue, {pointer(1, 1), pointer(2, 2), button(0, true), pointer(9, 9), button(0, false), pointer(5, 5)});
    EXPECT_EQ(sizes(queue), (std::vector<std::size_t>{3, 2, 1}));
    add(queue, {button(0, true), button(0, false), button(0, true)});
    EXPECT_EQ(sizes(queue), (std::vector<std::size_t>{1, 1, 1}));
    add(queue, {wheel(1), button(0, true), wheel(1), wheel(1)});
    EXPECT_EQ(sizes(queue), (std::vector<std::size_t>{1, 1, 2}));
    add(queue, {key(341, true), button(0, true), key(341, false), button(0, false)});
    EXPECT_EQ(sizes(queue), (std::vector<std::size_t>{2, 1, 1})) << "the modifier belongs to the click";
}

TEST(InputQueue, movesAndTurnsOfTheWheelAreNeverBehind) {
    InputQueue queue;
    for (int i = 0; i < 1000; ++i) add(queue, {wheel(1), pointer(i, 0)});
    const auto frame = queue.next_frame();
    EXPECT_TRUE(queue.empty());
    EXPECT_EQ(frame.back().at.x, 999);
}

TEST(InputQueue, whatIsTypedWaitsForItsField) {
    InputQueue queue;
    add(queue, {key(258, true), key(258, false), key(80, true), text('p', 80), key(80, false), button(0, true)});
    EXPECT_EQ(queue.next_frame().size(), 1u);
    queue.wait_for_texts();  // the first key opened it
    int waited = 0;
    std::vector<InputEvent> frame = queue.next_frame();
    ASSERT_EQ(frame.size(), 1u) << "keys are let go in the meantime";
    for (frame = queue.next_frame(); frame.empty(); frame = queue.next_frame()) ASSERT_LT(++waited, 10);
    EXPECT_GT(waited, 0);
    EXPECT_EQ(frame.size(), 2u);
    EXPECT_EQ(sizes(queue), (std::vector<std::size_t>{1, 1}));
}

TEST(InputQueue, aKeyThatOpenedAFieldTypesNothingIntoItUntilItIsPressedAgain) {
    InputQueue queue;
    add(queue, {key(71, true), text('g', 71)});
    EXPECT_EQ(queue.next_frame().size(), 2u);
    queue.wait_for_texts();
    add(queue, {text('g', 71, true), text('g', 71, true), key(71, false)});
    EXPECT_EQ(queue.next_frame().size(), 1u);
    EXPECT_TRUE(queue.empty());
    add(queue, {key(71, true), text('g', 71), text('g', 71, true)});
    std::size_t typed = 0;
    while (!queue.empty())
        for (const InputEvent& event : queue.next_frame()) typed += event.kind == Kind::text;
    EXPECT_EQ(typed, 2u);
}

TEST(InputQueue, nothingIsLostAndNothingChangesPlaces) {
    std::mt19937 random(5);
    auto pick = [&](int n) { return int(random() % unsigned(n)); };
    for (int round = 0; round < 200; ++round) {
        InputQueue queue;
        std::vector<InputEvent> sent, seen;
        for (int i = 0; i < 300; ++i) {
            InputEvent event = std::vector<InputEvent>{pointer(i, 0), wheel(i), button(pick(3), pick(2)), key(pick(4), pick(2)), text(i, pick(4))}[std::size_t(pick(5))];
            event.at.y = i;
            sent.push_back(event);
            queue.add(event);
            if (pick(20) == 0) queue.wait_for_texts();
            if (pick(3) == 0)
                for (const InputEvent& e : queue.next_frame()) seen.push_back(e);
        }
        for (int frames = 0; !queue.empty(); ++frames) {
            ASSERT_LT(frames, 1000);
            std::set<int> keys;
            int pressed = 0;
            for (const InputEvent& e : queue.next_frame()) {
                seen.push_back(e);
                if (e.kind != Kind::key) continue;
                pressed += e.down;
                EXPECT_TRUE(keys.insert(e.code).second) << "a key changes twice in a frame";
            }
            EXPECT_LE(pressed, 1);
        }
        ASSERT_EQ(seen.size(), sent.size());
        for (std::size_t i = 0; i < sent.size(); ++i) ASSERT_EQ(seen[i].at.y, sent[i].at.y);
    }
}

}  // namespace
}  // namespace voxloom::editor
