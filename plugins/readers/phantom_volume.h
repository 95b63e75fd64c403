// A field sampled on a grid: a Volume of any size that computes what is read and holds nothing.
#pragma once

#include "core/data/volume.h"
#include "plugins/readers/phantom_field.h"

namespace voxloom {

enum class Special { none, nan, inf, denormal };

// What happens to the field's values on their way to voxels.
struct PhantomFinish {
    double gain = 1, offset = 0;  // stored = value * gain + offset
    double noise = 0;             // standard deviation, in the field's units
    std::uint64_t seed = 1;
    Special special = Special::none;  // floats only
    double special_share = 0;         // of the voxels, at seeded places
    double masked_share = 0;          // of the voxels marked as invalid, at seeded places
};

// Throws Error where the dense size does not fit in 63 bits. The same voxels whatever the region
// and the number of threads. closed_form() is the field, scaled; null with noise, which has none.
VolumePtr make_phantom(VolumeDesc desc, FieldPtr field, const PhantomGrid& grid,
                       PhantomFinish finish);

}  // namespace voxloom
