// What takes too long for a frame: made on a thread of its own, and kept as long as it may be of use.
//
// What is looked at is asked for in every frame; so what a frame has not asked for nobody waits for, and
// let_go_of_unasked() at its end forgets it, or stops it while it is being made. One such frame is enough. More would
// be no measure of time, for frames are drawn only when something changes, and what was superseded would delay what is
// looked at now and take processors from the graph; as it is, what comes back before it was made begins anew. What
// is made stays, so that what comes back with an undo is there at once, until what it is made of is gone.
#pragma once

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>

#include "core/base/priority.h"

namespace voxloom::editor {

// What something is made of: one value or two, which are not kept alive by this, and a number. The same
// values give the same thing.
struct MadeOf {
    std::weak_ptr<const void> a{}, b{};
    double number = 0;

    bool operator==(const MadeOf& o) const { return same(a, o.a) && same(b, o.b) && number == o.number; }
    // A value has ended: nobody can ask for this again.
    bool is_gone() const { return (a.expired() && !same(a, {})) || (b.expired() && !same(b, {})); }

  private:
    static bool same(const std::weak_ptr<const void>& x, const std::weak_ptr<const void>& y) {
        return !x.owner_before(y) && !y.owner_before(x);
    }
};

// Of one thread, but for what is handed to it: `changed` and `make` are called from another, one at a time, and must not
// call this. The destructor stops what is being made and waits for that.
template <class Made>
class Background {
  public:
    using Result = std::shared_ptr<const Made>;
    using Make = std::function<Result(const std::stop_token&)>;
    struct Found {
        enum class State { pending, made, failed };
        State state = State::pending;
        Result made;          // what `make` gave; null in the other states
        std::string problem;  // the sentence of a failure

        bool pending() const { return state == State::pending; }
    };

    // `changed` is called when something was made or has failed. Of more than `most_kept` things those go that were
    // not asked for the longest.
    explicit Background(std::function<void()> changed, std::size_t most_kept = 64)
        : changed_(std::move(changed)), most_kept_(most_kept), thread_([this](const std::stop_token& ending) { loop(ending); }) {}
    Background(const Background&) = delete;
    Background& operator=(const Background&) = delete;

    // Pending until it is made, which asking begins: what is asked for last is made first. Where `make` throws it
    // has failed, and is not tried again. Without `make` this is no time for making it: what is there is found,
    // and what is not is stopped, to begin anew when it is asked for with one.
    Found find(const MadeOf& of, Make make) {
        std::lock_guard lock(mutex_);
        const auto entry = std::ranges::find(entries_, of, &Entry::of);
        if (entry != entries_.end()) {
            entries_.splice(entries_.begin(), entries_, entry);
            entry->asked = true;
            if (make || !entry->found.pending()) return entry->found;
            drop(entry);
        } else if (make) {
            entries_.emplace_front(of, std::move(make));
            if (entries_.size() > most_kept_) drop(std::prev(entries_.end()));
            wake_.notify_all();
        }
        return {};
    }

    // At the end of a frame.
    void let_go_of_unasked() {
        std::lock_guard lock(mutex_);
        for (auto entry = entries_.begin(); entry != entries_.end();) {
            const auto here = entry++;
            const bool asked = std::exchange(here->asked, false);
            if (here->of.is_gone() || (!asked && here->found.pending())) drop(here);
        }
    }

    // Of everything.
    void clear() {
        std::lock_guard lock(mutex_);
        while (!entries_.empty()) drop(entries_.begin());
    }

  private:
    struct Entry {
        Entry(MadeOf what, Make how) : of(std::move(what)), make(std::move(how)) {}
        MadeOf of;
        Make make;                                // until it is begun
        std::stop_source stop{std::nostopstate};  // from then on
        Found found;
        bool asked = true;  // since the last frame ended
    };
    using Entries = std::list<Entry>;

    // With mutex_ held, as is the next. What is being made ends at its next check, and is not looked at.
    void drop(typename Entries::iterator entry) {
        entry->stop.request_stop();
        entries_.erase(entry);
    }

    typename Entries::iterator next() {
        return std::ranges::find_if(entries_, [](const Entry& entry) { return bool(entry.make); });
    }

    static Found made_or_failed(const Make& make, const std::stop_token& stop) {
        try {
            return {Found::State::made, make(stop), {}};
        } catch (const std::exception& e) {
            return {Found::State::failed, nullptr, e.what()};
        } catch (...) {
            return {Found::State::failed, nullptr, "an exception of an unknown type: a defect of a plugin"};
        }
    }

    void loop(const std::stop_token& ending) {
        give_way();
        std::unique_lock lock(mutex_);
        // A wait that is ended says whether there is a next one, too.
        while (wake_.wait(lock, ending, [&] { return next() != entries_.end(); }) && !ending.stop_requested()) {
            const auto entry = next();
            Make make = std::exchange(entry->make, nullptr);
            std::stop_source stop;
            entry->stop = stop;
            lock.unlock();
            Found found;
            {
                const std::stop_callback end_with_all(ending, [&stop] { stop.request_stop(); });
                found = made_or_failed(make, stop.get_token());
            }
            make = nullptr;  // gives back what it is made of
            lock.lock();
            // Another one may be of the same values, after this one was let go.
            const auto waiting = std::ranges::find(entries_, stop, &Entry::stop);
            if (waiting == entries_.end()) continue;
            waiting->found = std::move(found);
            if (changed_) changed_();
        }
    }

    std::function<void()> changed_;
    const std::size_t most_kept_;
    std::mutex mutex_;
    std::condition_variable_any wake_;
    Entries entries_;      // last asked for first
    std::jthread thread_;  // the last: it is told to end, and waited for, before the others go
};

}  // namespace voxloom::editor
