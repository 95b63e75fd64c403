// A value of every port type, for tests that feed any node.
#pragma once

#include <vector>

#include "core/data/value.h"

namespace voxloom::testing {

// A value of the type over a volume of `dims` voxels (u8, anisotropic, turned in the world, smooth
// but not symmetric). Pictures, tables, cameras and the like do not depend on dims.
Value sample_value(PortType type, Index3 dims);

// Everything in a value as bytes, read out: what "gives the same result" compares. Voxels of a
// volume, every step of a series, every brick's voxels, pixels, cells, numbers.
std::vector<std::byte> bytes_of_value(const Value& value);

}  // namespace voxloom::testing
