#include "core/data/brick_cache.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <map>
#include <mutex>
#include <random>
#include <set>
#include <thread>

#include "core/base/error.h"
#include "core/base/tsan.h"
#include "tests/support/volumes.h"

namespace voxloom {
namespace {

// A codec whose voxels are a formula of level and position, and that checks what it is given.
class FormulaBricks : public Bricks {
  public:
    static BricksDesc make_desc(Index3 dims, int brick, bool flat, ScalarType type, ScalarType tree) {
        BricksDesc desc;
        desc.volume.dims = dims;
        desc.volume.type = type;
        desc.volume.name = "formula";
        desc.brick = glm::ivec3(brick);
        desc.tree_type = tree;
        desc.levels = pyramid_levels(desc.volume, desc.brick, flat);
        return desc;
    }
    explicit FormulaBricks(Index3 dims, int brick = 4, bool flat = false, bool depends = true,
                           ScalarType type = ScalarType::u16, ScalarType tree = ScalarType::i32)
        : Bricks(make_desc(dims, brick, flat, type, tree)), depends_(depends && !flat) {}

    static double value(int level, Index3 i) {
        return double((i.x * 7 + i.y * 131 + i.z * 977 + level * 3301) % 90001) - 12000.5;
    }
    BrickInfo info(BrickId) const override { return {}; }
    std::optional<BrickId> parent(BrickId id) const override {
        return depends_ ? desc().coarser(id) : std::nullopt;
    }
    std::vector<DecodedBrick> refine(BrickId id, const BrickVoxels* above,
                                     const std::stop_token& stop) const override {
        const std::optional<BrickId> p = parent(id);
        EXPECT_EQ(p.has_value(), above != nullptr);
        if (p) expect_right(*p, *above);
        if (on_refine) on_refine(id, stop);
        std::vector<DecodedBrick> family;
        for (BrickId member : p ? desc().finer(*p) : std::vector{id}) {
            const auto key = std::tuple(member.level, member.index.x, member.index.y, member.index.z);
            {
                std::lock_guard lock(mutex_);
                EXPECT_TRUE(decoding_.insert(key).second) << "decoded twice at the same time";
            }
            family.push_back({member, decoded(member)});
            std::lock_guard lock(mutex_);
            decoding_.erase(key);
        }
        ++families;
        return family;
    }
    BrickVoxelsPtr decoded(BrickId id) const {
        const Index3 lo = desc().box_of(id).lo;
        auto brick = std::make_shared<BrickVoxels>();
        brick->stored = Index3(desc().brick);  // padded at the border
        brick->voxels = Buffer(Box::of(brick->stored).voxels() * desc().tree_voxel_bytes());
        with_type(desc().tree_type, [&](auto t) {
            auto* out = reinterpret_cast<decltype(t)*>(brick->voxels.data());
            for (std::int64_t z = 0; z < brick->stored.z; ++z)
                for (std::int64_t y = 0; y < brick->stored.y; ++y)
                    for (std::int64_t x = 0; x < brick->stored.x; ++x)
                        *out++ = decltype(t)(value(id.level, lo + Index3(x, y, z)));
        });
        return brick;
    }
    void expect_right(BrickId id, const BrickVoxels& brick) const {
        const BrickVoxelsPtr right = decoded(id);
        EXPECT_EQ(brick.stored, right->stored);
        EXPECT_TRUE(std::ranges::equal(brick.voxels.bytes(), right->voxels.bytes()));
    }

    std::uint64_t brick_bytes() const {
        return Box::of(Index3(desc().brick)).voxels() * desc().tree_voxel_bytes();
    }
    mutable std::atomic<int> families{0};
    std::function<void(BrickId, const std::stop_token&)> on_refine;

  private:
    bool depends_;
    mutable std::mutex mutex_;
    mutable std::set<std::tuple<int, int, int, int>> decoding_;
};
using FormulaPtr = std::shared_ptr<FormulaBricks>;

BrickId random_brick(const BricksDesc& desc, std::mt19937& random) {
    BrickId id;
    id.level = int(random() % desc.levels.size());
    for (int a = 0; a < 3; ++a)
        id.index[a] = int(random() % unsigned(desc.levels[std::size_t(id.level)].bricks[a]));
    return id;
}

TEST(BrickCache, DecodesAncestorsAndWholeFamiliesOnce) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(16, 16, 16));  // levels of 64, 8, 1 bricks
    BrickCache cache(1 << 20);
    bricks->expect_right({0, {3, 2, 1}}, *cache.get(bricks, {0, {3, 2, 1}}));
    EXPECT_EQ(bricks->families, 3);
    const auto counters = cache.counters();
    EXPECT_EQ(counters.misses, 1u);
    EXPECT_EQ(counters.hits, 0u);
    EXPECT_EQ(counters.families_decoded, 3u);
    EXPECT_EQ(counters.bytes, (1 + 8 + 8) * bricks->brick_bytes());
    // A sibling is there; a cousin needs one family more.
    bricks->expect_right({0, {2, 3, 0}}, *cache.get(bricks, {0, {2, 3, 0}}));
    EXPECT_EQ(cache.counters().hits, 1u);
    EXPECT_EQ(bricks->families, 3);
    bricks->expect_right({0, {0, 0, 0}}, *cache.get(bricks, {0, {0, 0, 0}}));
    EXPECT_EQ(bricks->families, 4);
}

TEST(BrickCache, PeekNeverDecodesAndNearestFindsTheNearestAncestor) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(16, 16, 16));
    BrickCache cache(1 << 20);
    EXPECT_FALSE(cache.peek(*bricks, {0, {0, 0, 0}}));
    EXPECT_FALSE(cache.nearest(*bricks, {0, {3, 3, 3}}).voxels);
    cache.get(bricks, {2, {0, 0, 0}});
    EXPECT_EQ(cache.nearest(*bricks, {0, {3, 3, 3}}).id, (BrickId{2, {0, 0, 0}}));
    cache.get(bricks, {1, {0, 0, 0}});
    const auto nearest = cache.nearest(*bricks, {0, {3, 3, 3}});
    EXPECT_EQ(nearest.id, (BrickId{1, {1, 1, 1}}));
    bricks->expect_right(nearest.id, *nearest.voxels);
    EXPECT_TRUE(cache.peek(*bricks, {1, {1, 0, 1}}));
    EXPECT_EQ(bricks->families, 2);
}

// The cache against a list, most recently used first, that holds `capacity` bricks.
TEST(BrickCache, EvictsAsANaiveListDoes) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(20, 12, 8), 4, true);  // 30 families of one
    constexpr std::size_t kCapacity = 7;
    BrickCache cache(kCapacity * bricks->brick_bytes());
    std::vector<BrickId> list;
    std::mt19937 random(1);
    std::uint64_t hits = 0, evicted = 0;
    for (int step = 0; step < 3000; ++step) {
        const BrickId id = random_brick(bricks->desc(), random);
        const auto it = std::ranges::find(list, id);
        const bool there = it != list.end();
        if (there) {
            ++hits;
            list.erase(it);
        } else if (list.size() == kCapacity) {
            ++evicted;
            list.pop_back();
        }
        list.insert(list.begin(), id);
        const auto before = cache.counters();
        bricks->expect_right(id, *cache.get(bricks, id));
        EXPECT_EQ(cache.counters().hits - before.hits, there ? 1u : 0u) << step;
    }
    EXPECT_EQ(cache.counters().hits, hits);
    EXPECT_EQ(cache.counters().bricks_evicted, evicted);
    EXPECT_EQ(cache.counters().bytes, kCapacity * bricks->brick_bytes());
    EXPECT_LE(cache.counters().peak_bytes, kCapacity * bricks->brick_bytes());
    // What is left is what the list says, and nothing else.
    for (int i = 0; i < 30; ++i) {
        const BrickId id{0, {i % 5, i / 5 % 3, i / 15}};
        EXPECT_EQ(cache.peek(*bricks, id) != nullptr, std::ranges::count(list, id) == 1);
    }
}

TEST(BrickCache, PinsOutliveAnyNumberOfOtherBricks) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(32, 32, 32), 4, true);
    BrickCache cache(4 * bricks->brick_bytes());
    const auto pin = cache.pin(bricks, {0, {1, 2, 3}});
    const BrickVoxelsPtr held = cache.get(bricks, {0, {3, 2, 1}});
    std::mt19937 random(2);
    for (int i = 0; i < 200; ++i) cache.get(bricks, random_brick(bricks->desc(), random));
    EXPECT_EQ(cache.peek(*bricks, {0, {1, 2, 3}}), pin.voxels());
    EXPECT_EQ(cache.peek(*bricks, {0, {3, 2, 1}}), held);
    bricks->expect_right({0, {1, 2, 3}}, *pin.voxels());
    EXPECT_LE(cache.counters().peak_bytes, cache.byte_limit());
}

TEST(BrickCache, ALimitTooSmallForOneFamilyIsAnErrorThatSaysSo) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(16, 16, 16));
    BrickCache cache(8 * bricks->brick_bytes());  // a family, but not its parent beside it
    EXPECT_NO_THROW(cache.get(bricks, {2, {0, 0, 0}}));
    try {
        cache.get(bricks, {1, {0, 0, 0}});
        FAIL() << "eight bricks of memory cannot hold nine";
    } catch (const Error& error) {
        EXPECT_THAT(error.what(), ::testing::HasSubstr("raise the limit of the brick cache"));
        EXPECT_THAT(error.what(), ::testing::HasSubstr("formula"));
    }
    EXPECT_LE(cache.counters().peak_bytes, cache.byte_limit());
    cache.set_byte_limit(9 * bricks->brick_bytes());
    bricks->expect_right({0, {0, 0, 0}}, *cache.get(bricks, {0, {0, 0, 0}}));
    EXPECT_LE(cache.counters().peak_bytes, cache.byte_limit());
}

TEST(BrickCache, TooManyPinsAreAnErrorAndLeaveTheCacheWhole) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(32, 4, 4), 4, true);
    BrickCache cache(3 * bricks->brick_bytes());
    std::vector<BrickCache::Pin> pins;
    for (int i = 0; i < 3; ++i) pins.push_back(cache.pin(bricks, {0, {i, 0, 0}}));
    EXPECT_THROW(cache.get(bricks, {0, {3, 0, 0}}), Error);
    pins.pop_back();
    EXPECT_NO_THROW(cache.get(bricks, {0, {3, 0, 0}}));
}

TEST(BrickCache, ALowerLimitTakesEffectAtOnceAndForPinsWhenTheyEnd) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(32, 4, 4), 4, true);
    BrickCache cache(1 << 20);
    for (int i = 0; i < 8; ++i) cache.get(bricks, {0, {i, 0, 0}});
    {
        const auto pin = cache.pin(bricks, {0, {0, 0, 0}});
        cache.set_byte_limit(0);
        EXPECT_EQ(cache.counters().bytes, bricks->brick_bytes());
    }
    EXPECT_EQ(cache.counters().bytes, 0u);
    EXPECT_EQ(cache.counters().bricks_evicted, 8u);
}

TEST(BrickCache, BricksThatDieAreForgottenInEveryCache) {
    const std::uint64_t before = buffer_bytes_in_use();
    BrickCache one(1 << 20), two(1 << 20);
    BrickVoxelsPtr held;
    {
        auto bricks = std::make_shared<FormulaBricks>(Index3(16, 16, 16));
        for (BrickCache* cache : {&one, &two}) cache->get(bricks, {0, {0, 0, 0}});
        held = two.get(bricks, {0, {0, 0, 0}});
        EXPECT_GT(one.counters().bytes, 0u);
    }
    EXPECT_EQ(one.counters().bytes, 0u);
    EXPECT_EQ(two.counters().bytes, held->bytes());  // still in memory, still counted
    held.reset();
    EXPECT_EQ(two.counters().bytes, 0u);
    EXPECT_EQ(buffer_bytes_in_use(), before);
}

TEST(BrickCache, VoxelsOutliveTheCacheInTheHandsOfTheirHolder) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(8, 8, 8));
    BrickVoxelsPtr held;
    {
        BrickCache cache(1 << 20);
        held = cache.get(bricks, {0, {1, 1, 1}});
    }
    bricks->expect_right({0, {1, 1, 1}}, *held);
}

// Something that a decoder can be held up at.
class Gate {
  public:
    void wait_until_reached() {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [&] { return reached_; });
    }
    void open() {
        std::lock_guard lock(mutex_);
        open_ = true;
        changed_.notify_all();
    }
    void pass() {
        std::unique_lock lock(mutex_);
        reached_ = true;
        changed_.notify_all();
        changed_.wait(lock, [&] { return open_; });
    }
    void pass(const std::stop_token& stop) {
        std::unique_lock lock(mutex_);
        reached_ = true;
        changed_.notify_all();
        changed_.wait(lock, stop, [&] { return open_; });
        check_stop(stop);
    }

  private:
    std::mutex mutex_;
    std::condition_variable_any changed_;
    bool reached_ = false, open_ = false;
};

void wait_for(const std::function<bool()>& condition) {
    while (!condition()) std::this_thread::yield();
}

TEST(BrickCache, AFamilyIsDecodedOnceHoweverManyAsk) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(8, 8, 8));
    Gate gate;
    bricks->on_refine = [&](BrickId id, const std::stop_token&) {
        if (id.level == 0) gate.pass();
    };
    BrickCache cache(1 << 20);
    std::vector<std::jthread> threads;
    for (int i = 0; i < 8; ++i)
        threads.emplace_back([&, i] {
            const BrickId id{0, {i & 1, i >> 1 & 1, i >> 2}};
            bricks->expect_right(id, *cache.get(bricks, id));
        });
    gate.wait_until_reached();
    wait_for([&] { return cache.counters().misses == 8; });
    gate.open();
    threads.clear();
    EXPECT_EQ(bricks->families, 2);
    EXPECT_EQ(cache.counters().families_decoded, 2u);
    EXPECT_EQ(cache.counters().hits, 0u);
    EXPECT_GE(cache.counters().waits, 1u);
    EXPECT_LE(cache.counters().waits, 7u);
}

TEST(BrickCache, AWaiterTakesOverFromADecoderThatIsCancelled) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(8, 8, 8), 4, true);
    Gate gate;
    std::atomic<int> calls{0};
    bricks->on_refine = [&](BrickId, const std::stop_token& stop) {
        if (calls++ == 0) gate.pass(stop);
    };
    BrickCache cache(1 << 20);
    std::stop_source stop;
    std::atomic<bool> cancelled{false};
    std::jthread first([&] {
        try {
            cache.get(bricks, {0, {0, 0, 0}}, stop.get_token());
        } catch (const Cancelled&) {
            cancelled = true;
        }
    });
    gate.wait_until_reached();
    std::jthread second([&] { bricks->expect_right({0, {0, 0, 0}}, *cache.get(bricks, {0, {0, 0, 0}})); });
    wait_for([&] { return cache.counters().waits == 1; });
    stop.request_stop();
    first.join();
    second.join();
    EXPECT_TRUE(cancelled);
    EXPECT_EQ(calls, 2);
    EXPECT_EQ(cache.counters().bytes, bricks->brick_bytes());
}

TEST(BrickCache, AWaiterThatIsCancelledReturnsWhileTheDecoderGoesOn) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(8, 8, 8), 4, true);
    Gate gate;
    bricks->on_refine = [&](BrickId, const std::stop_token&) { gate.pass(); };
    BrickCache cache(1 << 20);
    std::jthread decoder([&] { cache.get(bricks, {0, {0, 0, 0}}); });
    gate.wait_until_reached();
    std::stop_source stop;
    std::jthread waiter([&] {
        EXPECT_THROW(cache.get(bricks, {0, {0, 0, 0}}, stop.get_token()), Cancelled);
    });
    wait_for([&] { return cache.counters().waits == 1; });
    stop.request_stop();
    waiter.join();
    gate.open();
    decoder.join();
    EXPECT_TRUE(cache.peek(*bricks, {0, {0, 0, 0}}));
}

TEST(BrickCache, ADecodersErrorReachesEveryoneWhoWaitedAndTheNextOneTriesAgain) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(8, 8, 8), 4, true);
    Gate gate;
    std::atomic<bool> corrupt{true};
    bricks->on_refine = [&](BrickId, const std::stop_token&) {
        gate.pass();
        if (corrupt) fail("brick 0 is corrupt");
    };
    BrickCache cache(1 << 20);
    std::atomic<int> errors{0};
    std::vector<std::jthread> threads;
    for (int i = 0; i < 3; ++i)
        threads.emplace_back([&] {
            try {
                cache.get(bricks, {0, {0, 0, 0}});
            } catch (const Error& error) {
                EXPECT_STREQ(error.what(), "brick 0 is corrupt");
                ++errors;
            }
        });
    wait_for([&] { return cache.counters().waits == 2; });
    gate.open();
    threads.clear();
    EXPECT_EQ(errors, 3);
    EXPECT_EQ(cache.counters().bytes, 0u);
    corrupt = false;
    EXPECT_NO_THROW(cache.get(bricks, {0, {0, 0, 0}}));
}

TEST(BrickCache, RandomAccessFromManyThreadsIsRightAndKeepsTheLimit) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(40, 36, 33));
    auto flat = std::make_shared<FormulaBricks>(Index3(40, 36, 33), 4, true);
    // Room for what eight threads hold (two bricks each), and one family with its parent.
    BrickCache cache((8 * 2 + 1 + 8) * bricks->brick_bytes());
    std::vector<std::jthread> threads;
    for (unsigned t = 0; t < 8; ++t)
        threads.emplace_back([&, t] {
            std::mt19937 random(t);
            BrickVoxelsPtr held;
            for (int i = 0; i < 300; ++i) {
                const FormulaPtr& source = random() % 4 ? bricks : flat;
                const BrickId id = random_brick(source->desc(), random);
                switch (random() % 8) {
                    case 0: cache.peek(*source, id); break;
                    case 1: cache.nearest(*source, id); break;
                    case 2: cache.drop(random() % 16 ? 0 : source->identity()); break;
                    default: {
                        BrickVoxelsPtr brick = cache.get(source, id);
                        source->expect_right(id, *brick);
                        held = std::move(brick);
                    }
                }
            }
        });
    threads.clear();
    const auto counters = cache.counters();
    EXPECT_LE(counters.peak_bytes, cache.byte_limit());
    EXPECT_LE(counters.bytes, cache.byte_limit());
    EXPECT_EQ(counters.families_decoded, std::uint64_t(bricks->families + flat->families));
}

// Exactly one family and its parent fit, so that the threads have to go one after the other.
TEST(BrickCache, ThreadsThatFitOnlyOneAtATimeAllGetTheirBricks) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(33, 33, 33));
    BrickCache cache(9 * bricks->brick_bytes());
    std::vector<std::jthread> threads;
    for (unsigned t = 0; t < 8; ++t)
        threads.emplace_back([&, t] {
            std::mt19937 random(t);
            for (int i = 0; i < 20; ++i) {
                const BrickId id = random_brick(bricks->desc(), random);
                const Box box = bricks->desc().box_of(id);
                Buffer out(box.voxels() * bricks->desc().volume.voxel_bytes());
                read_region(bricks, id.level, box, out.bytes(), cache);
            }
        });
    threads.clear();
    EXPECT_LE(cache.counters().peak_bytes, cache.byte_limit());
}

TEST(BrickCache, CancellingAtRandomLeavesNothingBehind) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(40, 36, 33));
    bricks->on_refine = [](BrickId, const std::stop_token& stop) {
        std::this_thread::yield();
        check_stop(stop);
    };
    BrickCache cache(30 * bricks->brick_bytes());
    std::vector<std::stop_source> stops(6);
    std::atomic<int> running{6};
    std::vector<std::jthread> threads;
    for (unsigned t = 0; t < 6; ++t)
        threads.emplace_back([&, t] {
            std::mt19937 random(t);
            try {
                for (;;) cache.get(bricks, random_brick(bricks->desc(), random), stops[t].get_token());
            } catch (const Cancelled&) {
            }
            --running;
        });
    for (unsigned t = 0; t < 6; ++t) {
        wait_for([&] { return cache.counters().families_decoded > 40 * (t + 1); });
        stops[t].request_stop();
    }
    threads.clear();
    EXPECT_EQ(running, 0);
    bricks->on_refine = nullptr;
    EXPECT_LE(cache.counters().peak_bytes, cache.byte_limit());
    cache.drop(bricks->identity());
    EXPECT_EQ(cache.counters().bytes, 0u);
    bricks->expect_right({0, {1, 1, 1}}, *cache.get(bricks, {0, {1, 1, 1}}));
}

// A decoder with loops of its own, read from a loop: a thread that waits for tasks of the decoder must
// not be handed the outer loop's next iteration, which would wait for that decoder.
TEST(BrickCache, LoopsInsideDecodersInsideLoopsDoNotWaitForThemselves) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(33, 33, 33));
    bricks->on_refine = [](BrickId, const std::stop_token&) {
        tbb::parallel_for(0, 64, [](int) { std::this_thread::yield(); });
    };
    for (int threads : {1, 2, 4}) {
        tbb::global_control control(tbb::global_control::max_allowed_parallelism, std::size_t(threads));
        BrickCache cache(1 << 20);
        auto read_one = [&](int i) {
            tsan::InTask in_task;
            std::mt19937 random(static_cast<unsigned>(i / 2));
            const BrickId id = random_brick(bricks->desc(), random);
            bricks->expect_right(id, *cache.get(bricks, id));
        };
        tsan::before_tasks();
        tbb::parallel_for(0, 200, read_one);
        tsan::after_tasks();
    }
}

// Level 0 of one pyramid is a level of another one, read through the same cache from inside the decoder.
class BricksOverBricks final : public FormulaBricks {
  public:
    BricksOverBricks(FormulaPtr inner, BrickCache& cache)
        : FormulaBricks(inner->desc().volume.dims), inner_(std::move(inner)), cache_(cache) {}
    std::vector<DecodedBrick> refine(BrickId id, const BrickVoxels* above,
                                     const std::stop_token& stop) const override {
        const Box box = inner_->desc().box_of({id.level, id.index});
        Buffer out(box.voxels() * inner_->desc().volume.voxel_bytes());
        read_region(inner_, id.level, box, out.bytes(), cache_, stop);
        return FormulaBricks::refine(id, above, stop);
    }

  private:
    FormulaPtr inner_;
    BrickCache& cache_;
};

TEST(BrickCache, DecodersMayReadOtherBricksThroughTheSameCache) {
    auto inner = std::make_shared<FormulaBricks>(Index3(33, 33, 33));
    BrickCache cache(200 * inner->brick_bytes());
    auto outer = std::make_shared<BricksOverBricks>(inner, cache);
    std::vector<std::jthread> threads;
    for (unsigned t = 0; t < 4; ++t)
        threads.emplace_back([&, t] {
            std::mt19937 random(t);
            for (int i = 0; i < 60; ++i) {
                const BrickId id = random_brick(outer->desc(), random);
                outer->expect_right(id, *cache.get(outer, id));
            }
        });
    threads.clear();
    EXPECT_LE(cache.counters().peak_bytes, cache.byte_limit());
}

TEST(BrickCache, NestedDecodersWithoutMemoryFailButNeverHang) {
    auto inner = std::make_shared<FormulaBricks>(Index3(33, 33, 33));
    BrickCache cache(20 * inner->brick_bytes());  // one thread needs 9 + 9
    auto outer = std::make_shared<BricksOverBricks>(inner, cache);
    std::atomic<int> good{0}, bad{0};
    std::vector<std::jthread> threads;
    for (unsigned t = 0; t < 4; ++t)
        threads.emplace_back([&, t] {
            std::mt19937 random(t);
            for (int i = 0; i < 40; ++i) try {
                    cache.get(outer, random_brick(outer->desc(), random));
                    ++good;
                } catch (const Error&) {
                    ++bad;
                }
        });
    threads.clear();
    EXPECT_EQ(good + bad, 160);
    EXPECT_GT(good, 0);
    EXPECT_LE(cache.counters().peak_bytes, cache.byte_limit());
    EXPECT_NO_THROW(cache.get(outer, {0, {1, 1, 1}}));  // alone it fits
}

// --- regions -------------------------------------------------------------------------------------

double delivered(const Bricks& bricks, int level, Index3 i) {
    const Index3 dims = bricks.desc().levels[std::size_t(level)].dims;
    const double tree = FormulaBricks::value(level, glm::clamp(i, Index3(0), dims - Index3(1)));
    const double v = is_float(bricks.desc().tree_type) ? tree : std::trunc(tree);
    auto [lo, hi] = limits_of(bricks.desc().volume.type);
    return is_float(bricks.desc().volume.type) ? v : std::clamp(std::nearbyint(v), lo, hi);
}

template <class T>
void expect_region(const BricksPtr& bricks, int level, const Box& box, BrickCache& cache) {
    Buffer out(box.voxels() * sizeof(T));
    read_region(bricks, level, box, out.bytes(), cache);
    const T* v = out.as<T>().data();
    for (std::int64_t z = box.lo.z; z < box.hi.z; ++z)
        for (std::int64_t y = box.lo.y; y < box.hi.y; ++y)
            for (std::int64_t x = box.lo.x; x < box.hi.x; ++x)
                ASSERT_EQ(double(*v++), double(T(delivered(*bricks, level, {x, y, z}))))
                    << level << ": " << x << " " << y << " " << z;
}

TEST(ReadRegion, AnyBoxOfAnyLevelIsRightInsideAndReplicatedOutside) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(21, 14, 9));
    BrickCache cache(1 << 20);
    std::mt19937 random(3);
    for (int i = 0; i < 300; ++i) {
        const int level = int(random() % bricks->desc().levels.size());
        Box box;
        for (int a = 0; a < 3; ++a) {
            box.lo[a] = std::int64_t(random() % 40) - 10;
            box.hi[a] = box.lo[a] + std::int64_t(random() % 12);
        }
        expect_region<std::uint16_t>(bricks, level, box, cache);
    }
}

TEST(ReadRegion, TreeValuesAreRoundedHalfToEvenAndClampedForEveryType) {
    BrickCache cache(8 << 20);
    for (ScalarType tree : {ScalarType::i32, ScalarType::f64, ScalarType::f32})
        for (int type = 0; type < kScalarTypes; ++type) {
            auto bricks = std::make_shared<FormulaBricks>(Index3(9, 9, 9), 4, false, true, ScalarType(type), tree);
            with_type(ScalarType(type), [&](auto t) {
                expect_region<decltype(t)>(bricks, 0, {{-1, 0, 0}, {9, 10, 9}}, cache);
            });
        }
}

TEST(ReadRegion, StopsWhenAsked) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(33, 33, 33));
    BrickCache cache(8 << 20);
    std::stop_source stop;
    stop.request_stop();
    Buffer out(33 * 33 * 33 * 2);
    EXPECT_THROW(read_region(bricks, 0, Box::of(Index3(33)), out.bytes(), cache, stop.get_token()), Cancelled);
}

TEST(ReadRegion, ALevelWithoutVoxelsGivesZeros) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(0, 5, 5));
    BrickCache cache(1 << 20);
    Buffer out(8 * 2);
    out.as<std::uint16_t>()[3] = 9;
    read_region(bricks, 0, {{-1, 0, 0}, {1, 2, 2}}, out.bytes(), cache);
    for (std::uint16_t v : out.as<std::uint16_t>()) EXPECT_EQ(v, 0);
}

TEST(ReadBrick, NeighboursOfOneLevelAgreeOnTheirSharedVoxelsBitForBit) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(21, 14, 9), 4, false, true, ScalarType::f32, ScalarType::f64);
    BrickCache cache(1 << 20);
    const Apron apron{1, 2};
    const Index3 n = Index3(4 + apron.below + apron.above);
    for (int level = 0; level < int(bricks->desc().levels.size()); ++level) {
        // Every brick writes its voxels at their place: whoever comes second must find the same there.
        std::map<std::tuple<std::int64_t, std::int64_t, std::int64_t>, float> seen;
        const glm::ivec3 grid = bricks->desc().levels[std::size_t(level)].bricks;
        for (int z = 0; z < grid.z; ++z)
            for (int y = 0; y < grid.y; ++y)
                for (int x = 0; x < grid.x; ++x) {
                    Buffer out(Box::of(n).voxels() * sizeof(float));
                    read_brick(bricks, {level, {x, y, z}}, apron, out.bytes(), cache);
                    for (std::int64_t k = 0; k < n.z; ++k)
                        for (std::int64_t j = 0; j < n.y; ++j)
                            for (std::int64_t i = 0; i < n.x; ++i) {
                                const float v = out.as<float>()[std::size_t((k * n.y + j) * n.x + i)];
                                const std::tuple at(x * 4 + i - 1, y * 4 + j - 1, z * 4 + k - 1);
                                const auto [it, fresh] = seen.emplace(at, v);
                                ASSERT_EQ(it->second, v);
                                ASSERT_EQ(v, float(delivered(*bricks, level,
                                                             {std::get<0>(at), std::get<1>(at), std::get<2>(at)})));
                            }
                }
    }
}

TEST(LevelAsVolume, DescribesItsLevelAndReadsIt) {
    auto bricks = std::make_shared<FormulaBricks>(Index3(21, 14, 9));
    BrickCache cache(1 << 20);
    for (int level = 0; level < int(bricks->desc().levels.size()); ++level) {
        const VolumePtr volume = level_as_volume(bricks, level, cache);
        EXPECT_EQ(volume->desc().dims, bricks->desc().levels[std::size_t(level)].dims);
        EXPECT_EQ(volume->desc().index_to_world, bricks->desc().level_to_world(level));
        EXPECT_EQ(testing::voxel(*volume, volume->desc().dims - Index3(1)),
                  delivered(*bricks, level, volume->desc().dims - Index3(1)));
        EXPECT_EQ(volume->data(), nullptr);
        const VolumePtr dense = in_memory(volume);
        EXPECT_EQ(testing::voxel(*dense, {0, 0, 0}), delivered(*bricks, level, {0, 0, 0}));
    }
}

}  // namespace
}  // namespace voxloom
