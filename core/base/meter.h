// What a piece of work costs: CPU time and memory, charged to the node that runs on this thread.
#pragma once

#include <atomic>
#include <cstdint>

namespace voxloom {

// One per running node; threads that work for the node charge it. All members are atomics, so that
// any thread may charge at any time.
class Meter {
  public:
    void add_cpu(std::int64_t nanoseconds) { cpu_ns_ += nanoseconds; }
    void add_bytes(std::int64_t bytes);  // negative when memory is given back
    std::int64_t cpu_ns() const { return cpu_ns_; }
    std::int64_t peak_bytes() const { return peak_bytes_; }

    // The meter that this thread charges; null outside of any node.
    static Meter*& current();

  private:
    std::atomic<std::int64_t> cpu_ns_{0}, bytes_{0}, peak_bytes_{0};
};

// Charges this thread's CPU time and allocations to `meter` until the end of the scope.
// Scopes nest: the inner one's time is taken off the outer one's.
class MeterScope {
  public:
    explicit MeterScope(Meter* meter);
    ~MeterScope();
    MeterScope(const MeterScope&) = delete;
    MeterScope& operator=(const MeterScope&) = delete;

  private:
    Meter* outer_;
    Meter* mine_;
    std::int64_t start_ns_;
};

std::int64_t thread_cpu_ns();   // CPU time of this thread
std::int64_t process_cpu_ns();  // CPU time of all threads
std::int64_t wall_ns();         // monotonic clock

}  // namespace voxloom
