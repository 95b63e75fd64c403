// What has to be known of a volume before its codebooks are trained, and the vectors to train them with.
#pragma once

#include <optional>
#include <stop_token>

#include "plugins/codec-vq/encoder.h"
#include "plugins/codec-vq/sample.h"

namespace voxloom::vq {

struct Survey {
    ValueRange range;                   // of the finite values
    std::vector<std::uint32_t> coded;   // of each brick, of each component: blocks that are neither constant nor without a number
    std::optional<int> middle;          // exponent_of() those of floats: as many are below as above
};
Survey survey(const Volume& volume, const VqIndex& index, const std::stop_token& stop,
              const std::function<void(double)>& progress);

Buffer voxels_of_brick(const Volume& volume, const Box& box, const std::stop_token& stop);

// Differences (64 numbers) of up to options.sample coded blocks of one component of the bricks, chosen evenly by the seed.
Sample sample_of(const Volume& volume, const VqIndex& index, const Survey& survey, std::span<const std::size_t> bricks,
                 int component, const EncodeOptions& options, const std::stop_token& stop);

}  // namespace voxloom::vq
