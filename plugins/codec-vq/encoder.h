// A volume to vector-quantised bricks.
#pragma once

#include <functional>
#include <stop_token>

#include "plugins/codec-vq/vq_bricks.h"

namespace voxloom::vq {

struct EncodeOptions {
    int codewords = 256;            // of each codebook, 2 to 256
    Loop loop = Loop::closed;
    glm::ivec3 macroblocks{1};      // along each axis, at most as many as bricks
    int sweeps = 20;                // over the sample, at most, of each codebook
    std::uint32_t sample = 1 << 16; // blocks of each macroblock that its codebooks are trained with, at most
    std::uint64_t seed = 1;         // of the choice of those
    int brick = 32;                 // voxels a side, a multiple of 4
};

struct EncodeReport {
    double psnr = 0, rmse = 0, max_error = 0;  // over the finite values; psnr of the volume's range
    double bits_per_voxel = 0;                 // all of what a file holds
    std::uint64_t constant_blocks = 0, raw_blocks = 0;  // of all components
    std::uint64_t sampled = 0;                 // vectors that took part in training
    int sweeps = 0;                            // of the codebook that took the most
    double distortion = 0;                     // RMS of what training left between its vectors and their codewords
    double training_seconds = 0;               // from the first to the last codebook, by the clock
    double codec_seconds = 0;                  // CPU time of encoding every brick, codebooks given
};

// Same volume and options, same bytes, whatever the threads and the processor. The volume is read twice, and once more
// for each component, brick by brick; memory is that of the compressed bytes, of the codebooks, and 600 bytes for each block
// of one macroblock's sample.
// Throws Error for what cannot be encoded, Cancelled when asked to stop.
VqBricksPtr encode(const Volume& volume, const EncodeOptions& options, EncodeReport& report,
                   const std::stop_token& stop = {}, const std::function<void(double)>& progress = {});

// What the bricks of such a volume would be. Problems are thrown.
BricksDesc plan(const VolumeDesc& volume, const EncodeOptions& options);

}  // namespace voxloom::vq
