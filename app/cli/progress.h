// Progress on standard error: one line that renews itself on a terminal, a line now and then in a log.
#pragma once

#include <atomic>
#include <string>

#include "core/graph/evaluate.h"

namespace voxloom::cli {

// Silent for the first second of a run.
class ProgressLine final : public RunObserver {
  public:
    explicit ProgressLine(bool quiet);
    ~ProgressLine() override;  // wipes the line
    void state_changed(int node, const NodeReport& report) override;
    void progress(int node, double fraction, std::string_view what, double seconds_left) override;

  private:
    void show(const std::string& line);
    bool quiet_, terminal_, shown_ = false;
    std::int64_t begun_ns_, last_ns_ = 0;
    std::vector<std::string> ids_;  // of the nodes seen so far, by index
};

}  // namespace voxloom::cli
