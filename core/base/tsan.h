// What ThreadSanitizer cannot see: TBB is not instrumented, so work handed over through it looks as if
// it were not synchronised at all. These say where work goes out and where it comes back, so that races
// between the tasks themselves are still found. In other builds they are nothing.
#pragma once

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>
#endif

namespace voxloom::tsan {

#if defined(__SANITIZE_THREAD__)
inline char fork_point, join_point;

inline void before_tasks() { __tsan_release(&fork_point); }
inline void after_tasks() { __tsan_acquire(&join_point); }

// Stands at the beginning of a task.
struct InTask {
    InTask() { __tsan_acquire(&fork_point); }
    ~InTask() { __tsan_release(&join_point); }
};

// The same loop on plain threads: what it finds are races of the bodies, and none of TBB's own.
template <class Task>
void parallel_for(std::int64_t begin, std::int64_t end, std::int64_t grain, const Task& task) {
    std::atomic<std::int64_t> next{begin};
    std::mutex mutex;
    std::exception_ptr failure;
    auto work = [&] {
        try {
            for (std::int64_t lo; (lo = next.fetch_add(grain)) < end;)
                task(lo, std::min(lo + grain, end));
        } catch (...) {
            next = end;
            std::lock_guard lock(mutex);
            if (!failure) failure = std::current_exception();
        }
    };
    std::vector<std::thread> threads;
    for (int i = 0; i < 2; ++i) threads.emplace_back(work);
    work();
    for (std::thread& thread : threads) thread.join();
    if (failure) std::rethrow_exception(failure);
}
#else
inline void before_tasks() {}
inline void after_tasks() {}
struct InTask {
    InTask() {}  // NOLINT: not trivial, so that an unused one is no warning
};
#endif

}  // namespace voxloom::tsan
