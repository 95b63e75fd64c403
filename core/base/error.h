// Errors that a user can act on: one sentence that says what, where, and how to mend it.
#pragma once

#include <fmt/core.h>

#include <exception>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <utility>

namespace voxloom {

// Anything wrong with what came from outside: a file, a graph, a parameter. The message is one
// sentence for the user. Programming mistakes are asserts, never Errors.
class Error : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

// Thrown by work that noticed its stop token; never shown as a failure.
class Cancelled : public std::exception {
  public:
    const char* what() const noexcept override { return "cancelled"; }
};

template <class... Args>
[[noreturn]] void fail(fmt::format_string<Args...> format, Args&&... args) {
    throw Error(fmt::format(format, std::forward<Args>(args)...));
}

// Long loops call this at least every few milliseconds.
inline void check_stop(const std::stop_token& stop) {
    if (stop.stop_requested()) throw Cancelled();
}

}  // namespace voxloom
