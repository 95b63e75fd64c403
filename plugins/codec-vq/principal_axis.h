// Where a cloud of weighted vectors is longest.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "plugins/codec-vq/sample.h"

namespace voxloom::vq {

std::vector<double> centroid_of(const Sample& sample, std::span<const std::size_t> members);

// A unit vector along the largest eigenvector of the covariance of the members, up to what power iteration finds; of many
// members, evenly spread ones stand for all.
std::vector<double> principal_axis(const Sample& sample, std::span<const std::size_t> members, std::span<const double> centroid);

}  // namespace voxloom::vq
