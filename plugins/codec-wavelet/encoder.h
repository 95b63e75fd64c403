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
    std::uint64_t memory = 0;  // bytes that the encoder may take beside the volume's own; 0: a quarter of the machine's
    std::string source;        // for the provenance
};

struct EncodeReport {
    double psnr = 0, rmse = 0, max_error = 0;  // of level 0, over the finite values; psnr of the range
    double bits_per_voxel = 0;                 // all of what a file holds
    std::uint64_t empty_families = 0, families = 0, patches = 0;
    int rounds = 0;                            // of the search for the step
    double codec_seconds = 0;                  // CPU time of one pass of transform, quantiser and coder
};

// Same volume and options, same bytes, whatever the threads and the memory. The volume is read slab by slab, once
// for the levels and once for every step that is tried on all of it; floats and 32-bit integers whose range
// is not known once more. What goes beyond options.memory, coarse levels and compressed bytes, waits in temporary
// files without a name. `progress` may be called from any thread. Throws Error for what cannot be
// encoded, when the disk is full, or when the memory cannot do; Cancelled when asked to stop.
std::shared_ptr<const WaveletBricks> encode(const Volume& volume, const EncodeOptions& options, EncodeReport& report,
                                            const std::stop_token& stop = {},
                                            const std::function<void(double)>& progress = {});

// What the tree of such a volume would be, with nothing known of the values. Problems are thrown.
TreeDesc plan(const VolumeDesc& volume, const EncodeOptions& options);

}  // namespace voxloom::wavelet
