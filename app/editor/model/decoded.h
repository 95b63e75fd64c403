// What bricks cost to decode, and how far they are from what they were made of, where no node of the
// graph measures it.
#pragma once

#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "core/data/value.h"

namespace voxloom::editor {

struct Decoded {
    double ratio = 0;             // bytes of the dense array for each compressed one
    double bits_per_voxel = 0;
    double cpu_seconds = 0;       // of all threads, for every voxel of level 0 once
    double bytes_per_second = 0;  // of the dense array, in this time; infinite where it is 0
    std::optional<double> psnr, max_error;  // where the original is there and has as many voxels
    std::string problem;          // why it could not be decoded; the numbers above it are then not known
};

// Reads level 0 once, through a cache of its own, so that everything is decoded whatever others have kept. The
// original is a volume, bricks, or empty. Throws Cancelled alone.
std::shared_ptr<const Decoded> decode_all(const BricksPtr& bricks, const Value& original, const std::stop_token& stop = {});

}  // namespace voxloom::editor
