// How far one volume is from another.
//
// Definitions. Over the N samples (voxels times components) that are finite in both:
//   RMSE = sqrt(sum (v - r)^2 / N),   PSNR = 20 log10(peak / RMSE) dB,
// with two peaks: `nominal`, the largest value of the reference's significant bits, 2^b - 1 (integers
// only), and `range`, the difference of the reference's largest and smallest value. A PSNR is
// infinite where the RMSE is 0, and NaN where there is nothing to compare.
//
// Samples that are not finite, and voxels that a mask declares invalid, never enter a sum. Where both
// sides agree in that (both NaN, both invalid, the same infinity) the sample is skipped; where only
// one side has it, it is a mismatch. Both are counted.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>

#include "core/data/volume.h"

namespace voxloom {

struct VolumeError {
    std::uint64_t compared = 0;    // samples that enter the sums
    std::uint64_t skipped = 0;     // not finite on both sides alike
    std::uint64_t mismatched = 0;  // not finite, or not valid, on one side alone
    std::uint64_t different = 0;   // compared samples that are not equal, and mismatched ones
    double rmse = 0;
    double mean_error = 0;         // mean of v - r: a bias
    double max_error = 0;          // largest |v - r|
    Index3 max_error_at{0};        // the first voxel in which it is met
    double correlation = 0;        // Pearson's; NaN where one side is constant
    ValueRange reference_range;    // of the compared samples
    double psnr_range = 0;
    std::optional<double> nominal_peak;
    std::optional<double> psnr_nominal;

    bool identical() const { return different == 0; }
};

struct CompareOptions {
    // Voxels compared at a time; 0 along an axis: as fits the cache. Bricks are read fastest in
    // multiples of their own size. The result depends on it in the last bits only, and never on the
    // number of threads.
    Index3 tile{0};
    std::stop_token stop;
    std::function<void(double)> progress;  // fraction done [any thread]
};

// Compares tile by tile, so neither volume needs to fit in memory. The scalar types may differ.
// Throws Error where dims or components differ.
VolumeError compare_volumes(const VolumePtr& volume, const VolumePtr& reference,
                            const CompareOptions& options = {});

// Tiles for volumes that are read from bricks of this size: whole bricks, so that none is decoded for two of them.
Index3 tile_of_bricks(glm::ivec3 brick);

// Why the two cannot be compared, or empty.
std::string problem_with_comparison(const VolumeDesc& volume, const VolumeDesc& reference);

// 20 log10(peak / rmse): infinite for rmse 0, NaN for a peak that is not above 0 unless so.
double psnr(double peak, double rmse);
// 2^b - 1 for the significant bits of an integer type; nothing for floats.
std::optional<double> nominal_peak(const VolumeDesc& desc);

}  // namespace voxloom
