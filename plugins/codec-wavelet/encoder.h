// A volume to a wavelet tree.
#pragma once

#include <functional>
#include <memory>
#include <stop_token>

#include "plugins/codec-wavelet/wavelet_bricks.h"

namespace voxloom::wavelet {

enum class Target : std::uint8_t { lossless, threshold, psnr, max_error, bpv, ratio };

struct EncodeOptions {
    Target target = Target::lossless;
    double amount = 0;  // T, dB over the value range, largest error, bits a voxel or original : compressed
    CoderKind coder = CoderKind::dense;
    int brick = 16;
    Rounding rounding = Rounding::unbiased;
    Faces faces = Faces::block;
    std::string source;  // for the provenance
};

struct EncodeReport {
    double psnr = 0, rmse = 0, max_error = 0;  // of level 0, over the finite values; psnr of the range
    double bits_per_voxel = 0;                 // all of what a file holds
    std::uint64_t empty_families = 0, families = 0, patches = 0;
    int rounds = 0;                            // of the search for the step
};

// Same volume and options, same bytes, whatever the threads. The volume is read twice or more, in boxes;
// beside it, all coarser levels are held twice as 32-bit integers (2/7 of the voxels) and the
// compressed bytes. Throws Error for what cannot be encoded, Cancelled when asked to stop.
std::shared_ptr<const WaveletBricks> encode(const Volume& volume, const EncodeOptions& options, EncodeReport& report,
                                            const std::stop_token& stop = {},
                                            const std::function<void(double)>& progress = {});

// What the tree of such a volume would be, with nothing known of the values. Problems are thrown.
TreeDesc plan(const VolumeDesc& volume, const EncodeOptions& options);

}  // namespace voxloom::wavelet
