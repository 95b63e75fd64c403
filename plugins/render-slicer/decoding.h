// Bricks decoded on other threads, into the cache of decoded bricks, while somebody looks at what is there.
#pragma once

#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <thread>
#include <vector>

#include "core/data/bricks.h"

namespace voxloom::slicer {

class Decoding {
  public:
    // Of `missing` and what lies within `reach` voxels of them, their ancestors first and level by level, so
    // that everything is seen coarsely before anything is fine. Of compressed bytes no more than so many a
    // second, 0: as fast as it goes. What fails, fails again where it is asked for.
    Decoding(const BricksPtr& bricks, const std::vector<BrickId>& missing, int reach, double bytes_per_second);
    ~Decoding();  // ends after the families that are just being decoded

    // Waits until everything is decoded, but not longer than `seconds`, and says whether it is. Throws
    // Cancelled when asked to stop.
    bool wait(double seconds, const std::stop_token& stop);

  private:
    void decode(const BricksPtr& bricks, const std::vector<std::vector<BrickId>>& levels, double bytes_per_second,
                const std::stop_token& stop);

    std::mutex mutex_;
    std::condition_variable_any changed_;
    bool done_ = false;
    std::jthread thread_;
};

// Whether all voxels within `reach` of a brick's own are decoded now.
bool is_decoded(const Bricks& bricks, BrickId id, int reach);

}  // namespace voxloom::slicer
