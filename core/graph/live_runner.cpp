#include <condition_variable>
#include <optional>
#include <thread>

#include "core/base/priority.h"
#include "core/graph/evaluate.h"

namespace voxloom {

struct LiveRunner::State {
    struct Request {
        Plan plan;
        RunOptions options;
    };
    ResultCache& cache;
    RunObserver* observer;
    Done done;
    std::mutex mutex;
    std::condition_variable changed;
    std::optional<Request> next;      // the newest request; an older one that never began is dropped
    std::stop_source running_stop;    // of the run in progress
    bool running = false;
    bool ending = false;
    std::thread thread;

    State(ResultCache& c, RunObserver* o, Done d) : cache(c), observer(o), done(std::move(d)) {}

    void loop() {
        give_way();
        std::unique_lock lock(mutex);
        for (;;) {
            changed.wait(lock, [&] { return next || ending; });
            if (ending) return;
            Request request = std::move(*next);
            next.reset();
            running = true;
            running_stop = std::stop_source();
            request.options.stop = running_stop.get_token();
            request.options.observer = observer;
            lock.unlock();
            RunResult result = evaluate(request.plan, cache, request.options);
            // A run that was superseded is not shown: its pictures belong to an older document.
            if (!request.options.stop.stop_requested()) done(request.plan, result);
            lock.lock();
            running = false;
            changed.notify_all();
        }
    }
};

LiveRunner::LiveRunner(ResultCache& cache, RunObserver* observer, Done done)
    : state_(std::make_unique<State>(cache, observer, std::move(done))) {
    state_->thread = std::thread([state = state_.get()] { state->loop(); });
}

LiveRunner::~LiveRunner() {
    {
        std::lock_guard lock(state_->mutex);
        state_->ending = true;
        state_->running_stop.request_stop();
    }
    state_->changed.notify_all();
    state_->thread.join();
}

void LiveRunner::submit(Plan plan, RunOptions options) {
    std::lock_guard lock(state_->mutex);
    state_->running_stop.request_stop();
    state_->next = State::Request{std::move(plan), std::move(options)};
    state_->changed.notify_all();
}

void LiveRunner::cancel() {
    std::lock_guard lock(state_->mutex);
    state_->running_stop.request_stop();
    state_->next.reset();
}

void LiveRunner::wait_idle() {
    std::unique_lock lock(state_->mutex);
    state_->changed.wait(lock, [&] { return !state_->running && !state_->next; });
}

}  // namespace voxloom
