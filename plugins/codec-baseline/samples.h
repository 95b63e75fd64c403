// Voxels for codecs of pictures: integers of up to 16 bits, counted from the smallest value of the volume.
#pragma once

#include <string>
#include <vector>

#include "plugins/codec-baseline/codec.h"

namespace voxloom::baseline {

inline constexpr int kSampleBits = 16;

// Why the volume's voxels cannot be such samples, or empty.
std::string problem_with_samples(const VolumeDesc& volume);

// Samples in planes: x, y, z, then components.
std::vector<std::uint16_t> samples_of(const Form& form, std::span<const std::byte> voxels);
// The reverse; samples beyond the volume's range are cut off. Throws Error where form has more bits.
void voxels_of(const Form& form, std::span<const std::uint16_t> samples, std::span<std::byte> voxels);

}  // namespace voxloom::baseline
