#include "core/data/brick_cache.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <cassert>
#include <condition_variable>
#include <cstring>
#include <exception>
#include <list>
#include <mutex>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/base/text.h"
#include "core/data/convert.h"

namespace voxloom {

namespace {

struct Entry {
    std::uint64_t identity = 0;
    BrickId id;
    BrickVoxelsPtr voxels;
    std::uint64_t bytes = 0;
    int users = 0;         // leases out; 0: stands in the idle list
    bool dropped = false;  // no longer found, counted until the last lease is back
    std::list<Entry*>::iterator idle;
};
using EntryPtr = std::shared_ptr<Entry>;

// A family being decoded. Its error is kept as text: one exception object shared by threads that
// wait would be freed by whichever comes last.
struct Flight {
    bool done = false;
    std::optional<std::string> error;
};

}  // namespace

// How it all stays free of deadlock:
//  - A thread decodes outside of the lock, isolated from foreign TBB tasks, so that it never comes to
//    wait for itself.
//  - A thread waits for a family only while another one decodes it, and holds only what the outer
//    decode on its own stack holds. Who decodes whose data is a tree, so these waits end.
//  - A thread that finds no memory gives back the ancestor that it had, and waits. One of them has
//    the turn: it keeps what it has, and what becomes free goes to it alone.
//  - `active` counts the threads that are at work here and not asleep. The last one awake, if it
//    needs memory, knows that none will come, and fails.
//  - A thread that is woken and falls asleep again takes nothing in between, since giving it back
//    would wake the others: two such threads would keep each other up, and nobody would be the last.
struct BrickCache::State : std::enable_shared_from_this<BrickCache::State> {
    class Lease;
    class Working;
    using OneBricks = std::unordered_map<BrickId, EntryPtr, HashOfBrickId>;
    struct FamilyKey {
        std::uint64_t identity;
        BrickId id;   // the parent, or the brick itself where there is none
        bool orphan;  // ... which of the two
        friend bool operator==(const FamilyKey&, const FamilyKey&) = default;
    };
    struct HashOfFamily {
        std::size_t operator()(const FamilyKey& k) const {
            return HashOfBrickId()(k.id) * 3 + k.identity * 0x9e3779b97f4a7c15u + k.orphan;
        }
    };

    mutable std::mutex mutex;
    std::condition_variable_any changed;
    std::uint64_t limit = 0;
    std::uint64_t idle_bytes = 0;  // of counters.bytes: nobody holds them
    std::list<Entry*> idle;        // most recently used first
    std::unordered_map<std::uint64_t, OneBricks> bricks;
    std::unordered_map<FamilyKey, std::shared_ptr<Flight>, HashOfFamily> flights;
    Counters counters;

    std::size_t active = 0, asleep = 0;
    std::uint64_t generation = 0;  // of wake-ups
    bool stuck = false;            // the last wake-up came from the last thread to fall asleep
    const Working* turn = nullptr;

    // All of these with the mutex held.
    Entry* find(std::uint64_t identity, BrickId id);
    Lease lease(Entry& entry);
    void give_back(Entry& entry);
    void insert(std::uint64_t identity, DecodedBrick brick);
    void evict_down_to(std::uint64_t bytes);
    bool reserve(std::uint64_t bytes);
    void wake(bool because_stuck = false);
    void sleep(std::unique_lock<std::mutex>& lock, const std::stop_token& stop);

    Lease acquire(const BricksPtr& source, BrickId id, const std::stop_token& stop, Working& me);
    void drop(std::uint64_t identity);
};

// Keeps a brick; gives it back at the end of its scope.
class BrickCache::State::Lease {
  public:
    Lease() = default;
    Lease(std::shared_ptr<State> state, EntryPtr entry)
        : state_(std::move(state)), entry_(std::move(entry)) {}
    Lease(Lease&&) = default;
    Lease& operator=(Lease&& other) noexcept {
        std::swap(state_, other.state_);
        std::swap(entry_, other.entry_);
        return *this;
    }
    ~Lease() {
        if (!entry_) return;
        std::lock_guard lock(state_->mutex);
        state_->give_back(*entry_);
    }
    // The same with the mutex held.
    void give_back() {
        if (entry_) state_->give_back(*entry_);
        entry_.reset();
    }
    const BrickVoxels* voxels() const { return entry_ ? entry_->voxels.get() : nullptr; }

  private:
    std::shared_ptr<State> state_;
    EntryPtr entry_;
};

// This thread is at work in the cache, and not asleep, for as long as the scope lives. Scopes nest
// where a decoder reads other Bricks; a thread counts once.
class BrickCache::State::Working {
  public:
    explicit Working(State& state) : state_(state), outer_(innermost()) {
        for (const Working* w = outer_; w; w = w->outer_) counted_ = counted_ && &w->state_ != &state;
        innermost() = this;
        if (!counted_) return;
        std::lock_guard lock(state.mutex);
        ++state.active;
    }
    ~Working() {
        innermost() = outer_;
        std::lock_guard lock(state_.mutex);
        if (state_.turn == this) state_.turn = nullptr;
        if (counted_) --state_.active;
        state_.wake();
    }
    Working(const Working&) = delete;
    Working& operator=(const Working&) = delete;

    bool decoding = false;
    // What a decoder asks for cannot wait for others to finish first: the decoder's own memory may
    // be what they wait for.
    bool inside_decoder() const {
        for (const Working* w = outer_; w; w = w->outer_)
            if (&w->state_ == &state_ && w->decoding) return true;
        return false;
    }
    static bool in_any_decoder() {
        for (const Working* w = innermost(); w; w = w->outer_)
            if (w->decoding) return true;
        return false;
    }

  private:
    static Working*& innermost() {
        thread_local Working* scope = nullptr;
        return scope;
    }
    State& state_;
    Working* outer_;
    bool counted_ = true;
};

Entry* BrickCache::State::find(std::uint64_t identity, BrickId id) {
    const auto one = bricks.find(identity);
    if (one == bricks.end()) return nullptr;
    const auto it = one->second.find(id);
    return it == one->second.end() ? nullptr : it->second.get();
}

BrickCache::State::Lease BrickCache::State::lease(Entry& entry) {
    if (entry.users++ == 0) {
        idle.erase(entry.idle);
        idle_bytes -= entry.bytes;
    }
    return {shared_from_this(), bricks.at(entry.identity).at(entry.id)};
}

void BrickCache::State::give_back(Entry& entry) {
    if (--entry.users > 0) return;
    if (entry.dropped) {
        counters.bytes -= entry.bytes;
        entry.voxels.reset();
    } else {
        idle.push_front(&entry);
        entry.idle = idle.begin();
        idle_bytes += entry.bytes;
        evict_down_to(limit);  // the limit may have been lowered meanwhile
    }
    wake();
}

void BrickCache::State::insert(std::uint64_t identity, DecodedBrick brick) {
    OneBricks& one = bricks[identity];
    // Of a family that was evicted in part, those that stayed are the ones that others hold.
    if (one.contains(brick.id)) return;
    auto entry = std::make_shared<Entry>();
    entry->identity = identity;
    entry->id = brick.id;
    entry->bytes = brick.voxels->bytes();
    entry->voxels = std::move(brick.voxels);
    idle.push_front(entry.get());
    entry->idle = idle.begin();
    counters.bytes += entry->bytes;
    idle_bytes += entry->bytes;
    one.emplace(brick.id, std::move(entry));
}

void BrickCache::State::evict_down_to(std::uint64_t bytes) {
    while (counters.bytes > bytes && !idle.empty()) {
        const Entry* entry = idle.back();
        idle.pop_back();
        idle_bytes -= entry->bytes;
        counters.bytes -= entry->bytes;
        ++counters.bricks_evicted;
        const auto one = bricks.find(entry->identity);
        one->second.erase(entry->id);
        if (one->second.empty()) bricks.erase(one);
    }
}

bool BrickCache::State::reserve(std::uint64_t bytes) {
    if (bytes > limit || counters.bytes - idle_bytes > limit - bytes) return false;
    evict_down_to(limit - bytes);
    counters.bytes += bytes;
    counters.peak_bytes = std::max(counters.peak_bytes, counters.bytes);
    return true;
}

void BrickCache::State::wake(bool because_stuck) {
    stuck = because_stuck;
    if (asleep == 0) return;
    active += asleep;
    asleep = 0;
    ++generation;
    changed.notify_all();
}

void BrickCache::State::sleep(std::unique_lock<std::mutex>& lock, const std::stop_token& stop) {
    if (active == 1) wake(true);  // the others sleep; one of them must give up
    --active;
    ++asleep;
    const std::uint64_t mine = generation;
    changed.wait(lock, stop, [&] { return generation != mine; });
    if (generation == mine) {  // woken by the stop token: nobody has counted this thread
        --asleep;
        ++active;
    }
    check_stop(stop);
}

// Goes from the nearest ancestor that is there to the brick, one family at a time, and looks again
// after each wait, since anything may have come or gone.
BrickCache::State::Lease BrickCache::State::acquire(const BricksPtr& source, BrickId id,
                                                    const std::stop_token& stop, Working& me) {
    const std::uint64_t identity = source->identity();
    assert(source->desc().has(id));
    std::vector<BrickId> path{id};  // the brick, its parent, ... up to what needs no parent
    while (auto above = source->parent(path.back())) path.push_back(*above);
    const bool nested = me.inside_decoder();

    Lease ancestor;
    bool first_look = true;
    std::unique_lock lock(mutex);
    for (;; first_look = false) {
        check_stop(stop);
        std::size_t there = 0;
        Entry* found = nullptr;
        while (there < path.size() && !(found = find(identity, path[there]))) ++there;
        if (first_look) ++(found && there == 0 ? counters.hits : counters.misses);
        if (found && there == 0) {
            Lease wanted = lease(*found);
            ancestor.give_back();
            return wanted;
        }

        const BrickId next = path[there - 1];
        const FamilyKey family{identity, found ? path[there] : next, !found};
        if (const auto it = flights.find(family); it != flights.end()) {
            const std::shared_ptr<Flight> flight = it->second;
            if (first_look) ++counters.waits;
            ancestor.give_back();
            while (!flight->done) sleep(lock, stop);
            if (flight->error) throw Error(*flight->error);
            continue;
        }
        const bool may_take = nested || turn == nullptr || turn == &me;
        if (!may_take) {
            ancestor.give_back();
            sleep(lock, stop);
            continue;
        }
        Lease before = std::exchange(ancestor, found ? lease(*found) : Lease());
        before.give_back();

        const std::uint64_t bytes = source->family_bytes(next);
        if (!reserve(bytes)) {
            if (!nested) turn = &me;
            if (active == 1 || stuck) {
                stuck = false;
                fail("brick cache: {} of its {} are in use, too much for decoding {} more of {}; "
                     "raise the limit of the brick cache, or hold fewer bricks at a time",
                     human_bytes(double(counters.bytes - idle_bytes)), human_bytes(double(limit)),
                     human_bytes(double(bytes)),
                     source->desc().volume.name.empty() ? "a volume" : source->desc().volume.name);
            }
            sleep(lock, stop);
            continue;
        }

        auto flight = std::make_shared<Flight>();
        flights.emplace(family, flight);
        lock.unlock();
        std::vector<DecodedBrick> decoded;
        std::exception_ptr failure;
        try {
            me.decoding = true;
            tbb::this_task_arena::isolate(
                [&] { decoded = source->refine(next, ancestor.voxels(), stop); });
        } catch (const Error& error) {
            flight->error = error.what();
            failure = std::current_exception();
        } catch (...) {  // cancelled, or out of memory: another thread may have more luck
            failure = std::current_exception();
        }
        me.decoding = false;
        lock.lock();
        counters.bytes -= bytes;
        flight->done = true;
        flights.erase(family);
        if (!failure) {
            ++counters.families_decoded;
            [[maybe_unused]] const std::uint64_t others = counters.bytes;
            for (DecodedBrick& brick : decoded) {
                counters.bytes_decoded += brick.voxels->bytes();
                insert(identity, std::move(brick));
            }
            assert(find(identity, next) && "refine() returns the brick it was asked for");
            assert(counters.bytes - others <= bytes && "family_bytes() is a bound");
        }
        wake();
        if (failure) {
            lock.unlock();
            std::rethrow_exception(failure);
        }
    }
}

void BrickCache::State::drop(std::uint64_t identity) {
    std::lock_guard lock(mutex);
    const auto one = bricks.find(identity);
    if (one == bricks.end()) return;
    for (auto& [id, entry] : one->second) {
        entry->dropped = true;
        if (entry->users > 0) continue;
        idle.erase(entry->idle);
        idle_bytes -= entry->bytes;
        counters.bytes -= entry->bytes;
    }
    bricks.erase(one);
    wake();
}

namespace {

// The lease lives as long as anyone holds the voxels.
BrickVoxelsPtr hand_out(BrickCache::State::Lease lease) {
    const BrickVoxels* voxels = lease.voxels();
    return {std::make_shared<BrickCache::State::Lease>(std::move(lease)), voxels};
}

// Every cache there is. Never destroyed: Bricks may die after everything else.
struct AllCaches {
    std::mutex mutex;
    std::vector<BrickCache*> caches;
    static AllCaches& get() {
        static AllCaches& all = *new AllCaches;
        return all;
    }
};

}  // namespace

BrickCache::BrickCache(std::uint64_t byte_limit) : state_(std::make_shared<State>()) {
    state_->limit = byte_limit;
    AllCaches& all = AllCaches::get();
    std::lock_guard lock(all.mutex);
    all.caches.push_back(this);
}

BrickCache::~BrickCache() {
    {
        AllCaches& all = AllCaches::get();
        std::lock_guard lock(all.mutex);
        std::erase(all.caches, this);
    }
    set_byte_limit(0);
}

BrickCache& BrickCache::global() {
    static BrickCache& cache = *new BrickCache(std::uint64_t(1) << 30);
    return cache;
}

void BrickCache::set_byte_limit(std::uint64_t bytes) {
    std::lock_guard lock(state_->mutex);
    state_->limit = bytes;
    state_->evict_down_to(bytes);
    state_->wake();
}

std::uint64_t BrickCache::byte_limit() const {
    std::lock_guard lock(state_->mutex);
    return state_->limit;
}

BrickCache::Counters BrickCache::counters() const {
    std::lock_guard lock(state_->mutex);
    return state_->counters;
}

BrickVoxelsPtr BrickCache::get(const BricksPtr& bricks, BrickId id, const std::stop_token& stop) {
    {
        std::unique_lock lock(state_->mutex);
        if (Entry* entry = state_->find(bricks->identity(), id)) {
            ++state_->counters.hits;
            State::Lease lease = state_->lease(*entry);
            lock.unlock();
            return hand_out(std::move(lease));
        }
    }
    State::Working working(*state_);
    return hand_out(state_->acquire(bricks, id, stop, working));
}

BrickVoxelsPtr BrickCache::peek(const Bricks& bricks, BrickId id) {
    std::unique_lock lock(state_->mutex);
    Entry* entry = state_->find(bricks.identity(), id);
    ++(entry ? state_->counters.hits : state_->counters.misses);
    if (!entry) return nullptr;
    State::Lease lease = state_->lease(*entry);
    lock.unlock();
    return hand_out(std::move(lease));
}

BrickCache::Nearest BrickCache::nearest(const Bricks& bricks, BrickId id) {
    BrickVoxelsPtr voxels = peek(bricks, id);
    while (!voxels) {
        const std::optional<BrickId> above = bricks.desc().coarser(id);
        if (!above) break;
        id = *above;
        std::unique_lock lock(state_->mutex);
        Entry* entry = state_->find(bricks.identity(), id);
        if (!entry) continue;
        State::Lease lease = state_->lease(*entry);
        lock.unlock();
        voxels = hand_out(std::move(lease));
    }
    return {id, std::move(voxels)};
}

void BrickCache::drop(std::uint64_t identity) { state_->drop(identity); }

void BrickCache::drop_everywhere(std::uint64_t identity) {
    AllCaches& all = AllCaches::get();
    std::lock_guard lock(all.mutex);
    for (BrickCache* cache : all.caches) cache->drop(identity);
}

// --- reading through the cache -------------------------------------------------------------------

namespace {

// The part of `box` (in the level) that one brick holds.
void read_from_brick(const BricksPtr& bricks, BrickId id, const Box& box, std::span<std::byte> out,
                     BrickCache::State& state, const std::stop_token& stop) {
    const BricksDesc& desc = bricks->desc();
    BrickCache::State::Working working(state);
    const BrickCache::State::Lease lease = state.acquire(bricks, id, stop, working);
    const Box own = desc.box_of(id);
    convert_box(intersect(own, box), desc.tree_type, lease.voxels()->voxels.data(),
                {own.lo, own.lo + lease.voxels()->stored}, desc.volume.type, out.data(), box,
                desc.volume.components);
}

// A box inside of the level. Families are read in parallel, the bricks of one by one thread, so that
// no thread waits for another one's decoding.
void read_inside(const BricksPtr& bricks, int level, const Box& box, std::span<std::byte> out,
                 BrickCache::State& state, const std::stop_token& stop) {
    const BricksDesc& desc = bricks->desc();
    const LevelDesc& here = desc.levels[std::size_t(level)];
    if (const std::byte* data = bricks->level_data(level)) {
        check_stop(stop);
        convert_box(box, desc.tree_type, data, Box::of(here.dims), desc.volume.type, out.data(), box,
                    desc.volume.components);
        return;
    }
    const glm::ivec3 first(box.lo / Index3(desc.brick));
    const glm::ivec3 last((box.hi - Index3(1)) / Index3(desc.brick));
    glm::ivec3 shift(0);  // a family is 1 << shift bricks along each axis
    if (bricks->parent({level, first}))
        shift = glm::ivec3(glm::notEqual(here.stride, desc.levels[std::size_t(level) + 1].stride));
    const glm::ivec3 first_family = first >> shift;
    const Index3 families((last >> shift) - first_family + 1);
    auto read_family = [&](std::int64_t i) {
        const glm::ivec3 family =
            first_family + glm::ivec3(i % families.x, i / families.x % families.y,
                                      i / (families.x * families.y));
        const glm::ivec3 lo = glm::max(first, family << shift);
        const glm::ivec3 hi = glm::min(last, ((family + 1) << shift) - 1);
        for (int z = lo.z; z <= hi.z; ++z)
            for (int y = lo.y; y <= hi.y; ++y)
                for (int x = lo.x; x <= hi.x; ++x)
                    read_from_brick(bricks, {level, {x, y, z}}, box, out, state, stop);
    };
    const std::int64_t count = families.x * families.y * families.z;
    if (BrickCache::State::Working::in_any_decoder()) {  // see Bricks::refine
        for (std::int64_t i = 0; i < count; ++i) read_family(i);
        return;
    }
    parallel_for(0, count, 1, [&](std::int64_t lo, std::int64_t hi) {
        for (std::int64_t i = lo; i < hi; ++i) read_family(i);
    }, stop);
}

}  // namespace

void read_region(const BricksPtr& bricks, int level, const Box& box, std::span<std::byte> out,
                 BrickCache& cache, const std::stop_token& stop) {
    const BricksDesc& desc = bricks->desc();
    assert(level >= 0 && std::size_t(level) < desc.levels.size());
    const std::size_t voxel_bytes = desc.volume.voxel_bytes();
    assert(out.size() == box.voxels() * voxel_bytes);
    if (box.empty()) return;
    const Index3 dims = desc.levels[std::size_t(level)].dims;
    if (Box::of(dims).empty()) {
        std::fill(out.begin(), out.end(), std::byte(0));
        return;
    }
    // What the box shows of the level: its voxels, those of the border standing for all outside.
    const Index3 end = dims - Index3(1);
    const Box shown{glm::clamp(box.lo, Index3(0), end),
                    glm::clamp(box.hi - Index3(1), Index3(0), end) + Index3(1)};
    if (shown == box) {
        read_inside(bricks, level, box, out, *cache.state_, stop);
        return;
    }
    Buffer inside(shown.voxels() * voxel_bytes, "region");
    read_inside(bricks, level, shown, inside.bytes(), *cache.state_, stop);
    const Index3 n = shown.dims();
    std::byte* to = out.data();
    for (std::int64_t z = box.lo.z; z < box.hi.z; ++z)
        for (std::int64_t y = box.lo.y; y < box.hi.y; ++y) {
            const std::int64_t row = (std::clamp<std::int64_t>(z, 0, end.z) - shown.lo.z) * n.y +
                                     std::clamp<std::int64_t>(y, 0, end.y) - shown.lo.y;
            const std::byte* from = inside.data() + std::size_t(row * n.x) * voxel_bytes;
            auto copy = [&](std::int64_t x, std::int64_t count) {
                std::memcpy(to, from + std::size_t(x) * voxel_bytes, std::size_t(count) * voxel_bytes);
                to += std::size_t(count) * voxel_bytes;
            };
            const std::int64_t before = std::min(box.hi.x, shown.lo.x) - box.lo.x;
            const std::int64_t after = box.hi.x - std::max(box.lo.x, shown.hi.x);
            for (std::int64_t i = 0; i < before; ++i) copy(0, 1);
            if (const std::int64_t middle = box.dims().x - std::max<std::int64_t>(before, 0) -
                                            std::max<std::int64_t>(after, 0);
                middle > 0)
                copy(0, middle);
            for (std::int64_t i = 0; i < after; ++i) copy(n.x - 1, 1);
        }
}

void read_brick(const BricksPtr& bricks, BrickId id, Apron apron, std::span<std::byte> out,
                BrickCache& cache, const std::stop_token& stop) {
    const BricksDesc& desc = bricks->desc();
    assert(desc.has(id) && apron.below >= 0 && apron.above >= 0);
    const Index3 lo = Index3(id.index) * Index3(desc.brick);
    read_region(bricks, id.level,
                {lo - Index3(apron.below), lo + Index3(desc.brick) + Index3(apron.above)}, out, cache,
                stop);
}

VolumeDesc level_volume_desc(const BricksDesc& bricks, int level) {
    VolumeDesc desc = bricks.volume;
    desc.dims = bricks.levels[std::size_t(level)].dims;
    desc.index_to_world = bricks.level_to_world(level);
    if (level > 0) desc.range.reset();
    return desc;
}

namespace {

class LevelVolume final : public Volume {
  public:
    LevelVolume(BricksPtr bricks, int level, BrickCache& cache)
        : Volume(level_volume_desc(bricks->desc(), level)), bricks_(std::move(bricks)), level_(level),
          cache_(cache) {}
    void read(const Box& box, std::span<std::byte> out, const std::stop_token& stop) const override {
        read_region(bricks_, level_, box, out, cache_, stop);
    }
    void read_mask(const Box& box, std::span<std::uint8_t> out) const override {
        bricks_->read_mask(level_, box, out);
    }
    const std::byte* data() const override {
        return bricks_->desc().tree_type == desc().type ? bricks_->level_data(level_) : nullptr;
    }
    std::uint64_t resident_bytes() const override { return bricks_->resident_bytes(); }

  private:
    BricksPtr bricks_;
    int level_;
    BrickCache& cache_;
};

}  // namespace

VolumePtr level_as_volume(BricksPtr bricks, int level, BrickCache& cache) {
    assert(level >= 0 && std::size_t(level) < bricks->desc().levels.size());
    return std::make_shared<LevelVolume>(std::move(bricks), level, cache);
}

}  // namespace voxloom
