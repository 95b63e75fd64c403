// A volume to flat bricks by one of the codecs, aimed at a target.
#pragma once

#include <functional>
#include <stop_token>

#include "plugins/codec-baseline/flat_bricks.h"

namespace voxloom::baseline {

struct EncodeOptions {
    Target target = Target::lossless;
    double amount = 0;  // dB over the value range, largest error, bits a voxel, original : compressed, or the codec's own
    glm::ivec3 brick{64};
    Setting::Options codec;
};

struct EncodeReport {
    double psnr = 0, rmse = 0, max_error = 0;  // over the finite values; psnr of the volume's range
    double bits_per_voxel = 0;                 // all of what a file holds
    std::uint64_t lossless_bricks = 0, raw_bricks = 0;  // kept so because the setting did not do
    int rounds = 0;                            // of the search for the setting
    double codec_seconds = 0;                  // CPU time of encoding every brick once, no search, no check
};

// Same volume and options, same bytes, whatever the threads. The volume is read once, and some of it again for each round
// of a search; memory is that of the compressed bytes and of a few bricks a thread. `psnr` is reached by the cheapest
// setting of the codec that does, `bpv` and `ratio` by the best one within the budget; `max-error` holds for every
// value. One setting serves all bricks. Throws Error for what cannot be encoded, Cancelled when asked to stop.
FlatBricksPtr encode(const Volume& volume, const Codec& codec, const EncodeOptions& options, EncodeReport& report,
                     const std::stop_token& stop = {}, const std::function<void(double)>& progress = {});

// What the bricks of such a volume would be. Problems are thrown.
BricksDesc plan(const VolumeDesc& volume, const Codec& codec, const EncodeOptions& options);

}  // namespace voxloom::baseline
