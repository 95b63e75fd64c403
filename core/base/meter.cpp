#include "core/base/meter.h"

#include <time.h>

namespace voxloom {

namespace {
std::int64_t clock_ns(clockid_t id) {
    timespec t{};
    clock_gettime(id, &t);
    return std::int64_t(t.tv_sec) * 1'000'000'000 + t.tv_nsec;
}
}  // namespace

std::int64_t thread_cpu_ns() { return clock_ns(CLOCK_THREAD_CPUTIME_ID); }
std::int64_t process_cpu_ns() { return clock_ns(CLOCK_PROCESS_CPUTIME_ID); }
std::int64_t wall_ns() { return clock_ns(CLOCK_MONOTONIC); }

Meter*& Meter::current() {
    thread_local Meter* meter = nullptr;
    return meter;
}

void Meter::add_bytes(std::int64_t bytes) {
    std::int64_t now = bytes_ += bytes;
    std::int64_t peak = peak_bytes_;
    while (now > peak && !peak_bytes_.compare_exchange_weak(peak, now)) {
    }
}

MeterScope::MeterScope(Meter* meter)
    : outer_(Meter::current()), mine_(meter), start_ns_(thread_cpu_ns()) {
    Meter::current() = meter;
}

MeterScope::~MeterScope() {
    std::int64_t spent = thread_cpu_ns() - start_ns_;
    if (mine_) mine_->add_cpu(spent);
    if (outer_) outer_->add_cpu(-spent);
    Meter::current() = outer_;
}

}  // namespace voxloom
