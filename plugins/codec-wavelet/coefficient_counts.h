// How many details of each size there are: from that follow, for any step, the squared error and the bits
// of all families, without a look at them again. Both are estimates, good to some per cent; what makes
// them exact is measured on a sample.
#pragma once

#include <array>
#include <vector>

#include "plugins/codec-wavelet/tree.h"

namespace voxloom::wavelet {

class CoefficientCounts {
  public:
    // Sizes below 64 one by one, above it eight to the octave.
    static constexpr int kExact = 64, kBins = kExact + 8 * 26;
    struct Bands {
        std::array<std::array<std::uint32_t, kBins>, 8> count{};  // of each mask
        std::uint64_t voxels = 0;
        // The details of a box that was split.
        void add(const Shape& shape, const std::int32_t* box);
    };

    CoefficientCounts() = default;
    explicit CoefficientCounts(const TreeDesc& tree) : levels_(std::size_t(tree.top())) {}
    // A family stands for `weight` of them.
    void add(int level, const Bands& bands, double weight = 1);
    bool empty() const;

    // Means over the voxels of level 0, under tree.quantiser.
    double squares(const TreeDesc& tree) const;
    double bits(const TreeDesc& tree) const;

  private:
    struct Level {
        std::array<std::array<double, kBins>, 8> count{};
        double voxels = 0;
    };
    template <class OfBand>
    double sum(const TreeDesc& tree, const OfBand& of_band) const;
    std::vector<Level> levels_;  // without the root's
};

}  // namespace voxloom::wavelet
