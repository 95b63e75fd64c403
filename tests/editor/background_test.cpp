// What is made beside the frames: once, the newest first, and no longer than somebody asks for it.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "app/editor/model/background.h"
#include "core/base/error.h"

namespace voxloom::editor {
namespace {

using Things = Background<int>;
using Thing = std::shared_ptr<int>;

// Asks until it is no longer pending, or for five seconds.
Things::Found ask(Things& things, const MadeOf& of, const Things::Make& make) {
    Things::Found found;
    for (int i = 0; i < 5000 && (found = things.find(of, make)).pending(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
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

}  // namespace
}  // namespace voxloom::editor
