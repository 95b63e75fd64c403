// What takes too long for a frame: made on a thread of its own, and kept as long as it may be of use.
#pragma once

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
// values give the same thing, so what comes back with an undo is there at once.
struct MadeOf {
    std::weak_ptr<const void> a{}, b{};
    double number = 0;

    bool operator==(const MadeOf& o) const {
        auto same = [](const auto& x, const auto& y) { return !x.owner_before(y) && !y.owner_before(x); };
        return same(a, o.a) && same(b, o.b) && number == o.number;
    }
};

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

    // `changed` is called from the thread when something was made.
    explicit Background(std::function<void()> changed, std::size_t most_kept = 64)
        : changed_(std::move(changed)), most_kept_(most_kept), thread_([this](const std::stop_token& stop) { loop(stop); }) {}
    ~Background() {
        thread_.request_stop();
        wake_.notify_all();
    }
    Background(const Background&) = delete;
    Background& operator=(const Background&) = delete;

    // Pending until it is made, which asking begins: what is asked for last is made first. Where `make` throws it
    // has failed, and is not tried again. Without `make` nothing begins, and what is there is found.
    Found find(const MadeOf& of, Make make) {
        std::lock_guard lock(mutex_);
        for (auto entry = entries_.begin(); entry != entries_.end(); ++entry) {
            if (!(entry->of == of)) continue;
            entries_.splice(entries_.begin(), entries_, entry);
            return entry->found;
        }
        if (!make) return {};
        // What is made of something that is gone will not be asked for again.
        std::erase_if(entries_, [](const Entry& entry) { return !entry.make && entry.of.a.expired(); });
        entries_.push_front({of, std::move(make), {}});
        if (entries_.size() > most_kept_) entries_.pop_back();
        wake_.notify_all();
        return {};
    }

  private:
    struct Entry {
        MadeOf of;
        Make make;  // empty once it was called
        Found found;
    };

    static Found made_or_failed(const Make& make, const std::stop_token& stop) {
        try {
            return {Found::State::made, make(stop), {}};
        } catch (const std::exception& e) {
            return {Found::State::failed, nullptr, e.what()};
        } catch (...) {
            return {Found::State::failed, nullptr, "an exception of an unknown type: a defect of a plugin"};
        }
    }

    Entry* next() {
        for (Entry& entry : entries_)
            if (entry.make) return &entry;
        return nullptr;
    }

    void loop(const std::stop_token& stop) {
        give_way();
        std::unique_lock lock(mutex_);
        while (wake_.wait(lock, stop, [&] { return next() != nullptr; })) {
            const MadeOf of = next()->of;
            Make make = std::exchange(next()->make, nullptr);
            lock.unlock();
            Found found = made_or_failed(make, stop);
            if (stop.stop_requested()) return;
            make = nullptr;  // gives back what it is made of
            lock.lock();
            for (Entry& entry : entries_)
                if (entry.of == of) entry.found = std::move(found);
            if (changed_) changed_();
        }
    }

    std::function<void()> changed_;
    const std::size_t most_kept_;
    std::mutex mutex_;
    std::condition_variable_any wake_;
    std::list<Entry> entries_;  // last asked for first
    std::jthread thread_;       // the last: it ends first
};

}  // namespace voxloom::editor
