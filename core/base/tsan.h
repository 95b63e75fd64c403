// What ThreadSanitizer cannot see: TBB is not instrumented, so work handed over through it looks as if
// it were not synchronised at all. These say where work goes out and where it comes back, so that races
// between the tasks themselves are still found. In other builds they are nothing.
#pragma once

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
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
#else
inline void before_tasks() {}
inline void after_tasks() {}
struct InTask {
    InTask() {}  // NOLINT: not trivial, so that an unused one is no warning
};
#endif

}  // namespace voxloom::tsan
