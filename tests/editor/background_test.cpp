// What is made beside the frames: once, the newest first, and no longer than somebody asks for it.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>
#include <vector>

#include "app/editor/model/background.h"
#include "core/base/error.h"

namespace voxloom::editor {
namespace {

using Things = Background<int>;
using Thing = std::shared_ptr<int>;

// Asks until it is no longer pending, or for five seconds.
Things::Found ask(Things& things, const MadeOf& of, const Things::Make& make) {
    Things::Found found;
    for (int i = 0; i < 50000 && (found = things.find(of, make)).pending(); ++i) std::this_thread::sleep_for(std::chrono::microseconds(100));
    return found;
}

Things::Make gives(int value, std::atomic<int>& calls) {
    return [value, &calls](const std::stop_token&) {
        ++calls;
        return std::make_shared<const int>(value);
    };
}

TEST(Background, makesWhatIsAskedForOnceAndKeepsIt) {
    std::atomic<int> changes{0}, calls{0};
    Things things([&] { ++changes; }, 2);
    const auto a = std::make_shared<int>(1), b = std::make_shared<int>(2);
    auto made = [&](const Thing& of, double number) { return *ask(things, {of, {}, number}, gives(*of * 10 + int(number), calls)).made; };
    EXPECT_TRUE(things.find({a, {}, 0}, nullptr).pending()) << "nothing begins";
    EXPECT_EQ(made(a, 0), 10);
    EXPECT_EQ(made(b, 0), 20);
    EXPECT_EQ(made(a, 0), 10);
    EXPECT_EQ(*things.find({a, {}, 0}, nullptr).made, 10);
    EXPECT_EQ(calls, 2);
    EXPECT_EQ(made(a, 5), 15) << "another number is another thing; the oldest goes";
    EXPECT_EQ(made(b, 0), 20);
    EXPECT_EQ(calls, 4);
    EXPECT_GE(changes, 3) << "of each but the last, whose may still be on its way";
}

TEST(Background, saysWhyWhatCannotBeMadeFailedAndTriesItOnce) {
    std::atomic<int> calls{0};
    Things things(nullptr);
    const auto a = std::make_shared<int>(1);
    auto failing = [&](const std::stop_token&) -> Things::Result {
        ++calls;
        throw Error("the moon is full");
    };
    for (int i = 0; i < 2; ++i) {
        const Things::Found found = ask(things, {a}, failing);
        EXPECT_EQ(found.state, Things::Found::State::failed);
        EXPECT_EQ(found.made, nullptr);
        EXPECT_EQ(found.problem, "the moon is full");
    }
    EXPECT_EQ(calls, 1);
    const Things::Found odd = ask(things, {a, {}, 1}, [](const std::stop_token&) -> Things::Result { throw 7; });
    EXPECT_EQ(odd.state, Things::Found::State::failed);
    EXPECT_NE(odd.problem, "");
    // Nothing may be what is made, and is no failure.
    const Things::Found nothing = ask(things, {a, {}, 2}, [](const std::stop_token&) { return nullptr; });
    EXPECT_EQ(nothing.state, Things::Found::State::made);
    EXPECT_EQ(nothing.made, nullptr);
    // Nor does one that was cancelled by others keep the rest from being made.
    EXPECT_FALSE(ask(things, {a, {}, 3}, [](const std::stop_token&) -> Things::Result { throw Cancelled(); }).pending());
    EXPECT_EQ(*ask(things, {a, {}, 4}, gives(9, calls)).made, 9);
}

// --- what nobody asks for any more ----------------------------------------------------------------

// Goes on until it is stopped, and says that it began and ended.
struct Endless {
    std::atomic<int> begun{0}, ended{0};
    Things::Make make() {
        return [this](const std::stop_token& stop) -> Things::Result {
            ++begun;
            while (!stop.stop_requested()) std::this_thread::sleep_for(std::chrono::microseconds(100));
            ++ended;
            throw Cancelled();
        };
    }
    static void wait_for(const std::atomic<int>& count, int value) {
        for (int i = 0; i < 5000 && count < value; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
        ASSERT_EQ(count, value);
    }
};

TEST(Background, stopsWhatTheNewestFrameDidNotAskFor) {
    std::atomic<int> changes{0}, calls{0};
    Endless endless;
    Things things([&] { ++changes; });
    const auto a = std::make_shared<int>(1), b = std::make_shared<int>(2), c = std::make_shared<int>(3);
    things.find({c}, endless.make());
    Endless::wait_for(endless.begun, 1);
    things.find({a}, gives(1, calls));
    things.find({b}, gives(2, calls));
    things.let_go_of_unasked();
    things.find({c}, endless.make());
    things.find({a}, gives(7, calls));
    things.let_go_of_unasked();
    EXPECT_EQ(endless.ended, 0) << "it was asked for";
    things.find({a}, gives(8, calls));
    things.let_go_of_unasked();
    Endless::wait_for(endless.ended, 1);
    EXPECT_EQ(*ask(things, {a}, gives(9, calls)).made, 1) << "it waited since it was asked for first";
    EXPECT_EQ(calls, 1) << "nobody has asked for the other a second time";
    EXPECT_EQ(*ask(things, {c}, gives(3, calls)).made, 3) << "stopped is no failure";
    EXPECT_LE(changes, 2) << "of nothing that was let go";
}

TEST(Background, makesTheNewestFirst) {
    std::atomic<int> calls{0};
    Endless endless;
    Things things(nullptr);
    const auto a = std::make_shared<int>(0);
    things.find({a, {}, -1}, endless.make());
    Endless::wait_for(endless.begun, 1);
    things.let_go_of_unasked();
    std::vector<double> order;
    auto noted = [&](double number) {
        return [&, number](const std::stop_token&) {
            order.push_back(number);
            return std::make_shared<const int>(int(++calls));
        };
    };
    things.find({a, {}, -1}, endless.make());
    for (double number : {1.0, 2.0, 3.0}) things.find({a, {}, number}, noted(number));
    things.let_go_of_unasked();
    for (double number : {2.0, 3.0, 1.0}) things.find({a, {}, number}, noted(number));
    things.let_go_of_unasked();  // of the endless one
    Endless::wait_for(calls, 3);
    EXPECT_EQ(*ask(things, {a, {}, 2}, noted(2)).made, 3);
    EXPECT_EQ(order, (std::vector<double>{1, 3, 2}));
}

TEST(Background, whatWasMadeIsThereAfterFramesWithoutIt) {
    std::atomic<int> calls{0};
    Things things(nullptr);
    auto a = std::make_shared<int>(1);
    const auto b = std::make_shared<int>(2);
    ASSERT_EQ(*ask(things, {a, b}, gives(12, calls)).made, 12);
    for (int frame = 0; frame < 100; ++frame) things.let_go_of_unasked();
    EXPECT_EQ(*things.find({a, b}, nullptr).made, 12) << "as after an undo";
    std::weak_ptr<const int> kept = things.find({a, b}, nullptr).made;
    a.reset();
    things.let_go_of_unasked();
    EXPECT_TRUE(kept.expired()) << "nobody can ask for it again";
    kept = ask(things, {b}, gives(2, calls)).made;
    EXPECT_FALSE(kept.expired());
    things.clear();
    EXPECT_TRUE(kept.expired());
    EXPECT_TRUE(things.find({b}, nullptr).pending());
}

TEST(Background, keepsNothingAliveThatNobodyWaitsFor) {
    Endless endless;
    Things things(nullptr);
    const auto a = std::make_shared<int>(1);
    things.find({a}, endless.make());
    Endless::wait_for(endless.begun, 1);
    auto held = std::make_shared<int>(2);
    const std::weak_ptr<int> seen = held;
    things.find({held}, [held](const std::stop_token&) { return held; });
    things.let_go_of_unasked();
    held.reset();
    EXPECT_FALSE(seen.expired()) << "it is to be made something of";
    things.find({a}, endless.make());
    things.let_go_of_unasked();
    EXPECT_TRUE(seen.expired());
}

TEST(Background, beginsAnewWhatItWasNotTheTimeFor) {
    Endless endless;
    std::atomic<int> calls{0};
    Things things(nullptr);
    const auto a = std::make_shared<int>(1);
    things.find({a}, endless.make());
    Endless::wait_for(endless.begun, 1);
    EXPECT_TRUE(things.find({a}, nullptr).pending());
    Endless::wait_for(endless.ended, 1);
    EXPECT_TRUE(things.find({a}, nullptr).pending());
    EXPECT_EQ(*ask(things, {a}, gives(5, calls)).made, 5);
    EXPECT_EQ(*things.find({a}, nullptr).made, 5);
}

TEST(Background, endsAtOnceWithWorkBegunAndMoreWaiting) {
    const auto a = std::make_shared<int>(1);
    for (int i = 0; i < 50; ++i) {
        Endless endless;
        {
            Things things(nullptr);
            for (int k = 0; k < 4; ++k) things.find({a, {}, double(k)}, endless.make());
            if (i % 2) Endless::wait_for(endless.begun, 1);
        }
        EXPECT_LE(endless.begun, 1) << "what waits does not begin any more";
        EXPECT_EQ(endless.begun, endless.ended);
    }
}

// Asked for, let go, stopped and asked for again at any moment, it still makes what is asked for in the end.
TEST(Background, losesNothingInAnyOrder) {
    std::atomic<int> calls{0};
    std::vector<Thing> of;
    for (int i = 0; i < 5; ++i) of.push_back(std::make_shared<int>(i));
    std::uint32_t random = 1;
    auto draw = [&](std::uint32_t n) { return (random = random * 1664525u + 1013904223u) / 65536u % n; };
    for (int round = 0; round < 300; ++round) {
        Things things(nullptr, 4);
        for (int step = 0; step < 20; ++step) {
            const std::uint32_t k = draw(5);
            switch (draw(6)) {
                case 0: things.find({of[k]}, nullptr); break;
                case 1: things.let_go_of_unasked(); break;
                case 2: things.clear(); break;
                case 3: of[k] = std::make_shared<int>(int(k)); break;
                default: {
                    const Things::Found found = things.find({of[k]}, gives(int(k), calls));
                    ASSERT_TRUE(found.pending() || *found.made == int(k));
                }
            }
        }
        for (int k = 0; k < 3; ++k) {
            const Things::Found found = ask(things, {of[std::size_t(k)]}, gives(k, calls));
            ASSERT_FALSE(found.pending());
            ASSERT_EQ(*found.made, k);
            things.let_go_of_unasked();
        }
    }
}

}  // namespace
}  // namespace voxloom::editor
