// How often each value occurs in a volume, for the transfer function's editor.
#pragma once

#include <condition_variable>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <stop_token>
#include <thread>
#include <vector>

#include "core/data/volume.h"

namespace voxloom::editor {

struct Histogram {
    ValueRange range;
    std::vector<double> counts;  // of equal bins over the range; not finite values are left out
    bool sampled = false;        // of a part of the voxels alone, spread over the whole volume
};

inline constexpr std::size_t kHistogramBins = 256;

// Of the first component. Of larger volumes about `most_voxels` are read, in whole rows.
Histogram histogram_of(const Volume& volume, const std::stop_token& stop = {},
                       std::uint64_t most_voxels = std::uint64_t(4) << 20);

// Histograms made on a thread of its own. [the interface's thread]
class HistogramMaker {
  public:
    explicit HistogramMaker(std::function<void()> changed);  // called from that thread
    ~HistogramMaker();
    // The volume's histogram, or null until it is made; asking begins it.
    std::shared_ptr<const Histogram> find(const VolumePtr& volume);

  private:
    struct Entry {
        std::weak_ptr<const Volume> volume;
        std::shared_ptr<const Histogram> histogram;
    };
    void loop(const std::stop_token& stop);
    std::function<void()> changed_;
    std::mutex mutex_;
    std::condition_variable_any wake_;
    std::list<Entry> made_;       // newest first
    VolumePtr wanted_;
    std::jthread thread_;         // the last: it ends first
};

}  // namespace voxloom::editor
