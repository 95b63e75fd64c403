#include "app/cli/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

#include "core/base/meter.h"
#include "core/base/text.h"

namespace voxloom::cli {

ProgressLine::ProgressLine(bool quiet)
    : quiet_(quiet), terminal_(isatty(STDERR_FILENO)), begun_ns_(wall_ns()) {}

ProgressLine::~ProgressLine() {
    if (shown_ && terminal_) fmt::print(stderr, "\r\033[K");
}

void ProgressLine::state_changed(int node, const NodeReport& report) {
    if (ids_.size() <= std::size_t(node)) ids_.resize(std::size_t(node) + 1);
    ids_[std::size_t(node)] = report.id;
    if (report.state == NodeState::running) show(fmt::format("{}: running", report.id));
}

void ProgressLine::progress(int node, double fraction, std::string_view what, double seconds_left) {
    constexpr int kWidth = 24;
    int filled = int(fraction * kWidth + 0.5);
    std::string line = fmt::format("{} [{:#<{}}{:.<{}}] {:3.0f} %", ids_[std::size_t(node)], "", filled,
                                   "", kWidth - filled, fraction * 100);
    if (seconds_left >= 0) line += ", " + human_seconds(seconds_left) + " left";
    if (!what.empty()) line += fmt::format(" ({})", what);
    show(line);
}

void ProgressLine::show(const std::string& line) {
    const std::int64_t now = wall_ns();
    if (quiet_ || now - begun_ns_ < 1'000'000'000) return;
    if (now - last_ns_ < (terminal_ ? 50'000'000 : 5'000'000'000)) return;
    last_ns_ = now;
    shown_ = true;
    fmt::print(stderr, "{}{}{}", terminal_ ? "\r\033[K" : "", line, terminal_ ? "" : "\n");
    std::fflush(stderr);
}

}  // namespace voxloom::cli
