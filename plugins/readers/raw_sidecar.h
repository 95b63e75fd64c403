// Raw voxels described by a YAML file beside them: head.raw is described by head.raw.yaml.
//
//   dims: [256, 256, 128]     x y z, x fastest; a fourth number is the number of time steps
//   type: u16                 u8 i8 u16 i16 u32 i32 f32 f64
//   endianness: little        or big; may be left out for one-byte types
//   components: 1             1 to 4, interleaved
//   color: false              3 or 4 components are RGB(A)
//   spacing: [1, 1, 2.5]
//   origin: [0, 0, 0]
//   direction: [1, 0, 0,  0, 1, 0,  0, 0, 1]   of the x, the y and the z axis, in the world
//   unit: mm
//   name: head
//   significant_bits: 12
//   offset: 0                 bytes before the first voxel (of the unpacked data)
//   compression: none         or gzip
//   file: head.raw            where the name is another one than the sidecar's without .yaml
//   times: [0, 0.5, 1]        one a step
//   time_unit: s
//
// dims and type must be there, and endianness for types of more than one byte.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/data/volume.h"

namespace voxloom {

struct RawSidecar {
    VolumeDesc desc;
    std::int64_t steps = 1;
    bool big_endian = false;
    std::uint64_t offset = 0;
    bool gzip = false;
    std::string file;  // empty: the sidecar's name without .yaml
    std::vector<double> times;
    std::string time_unit;
    std::vector<std::string> warnings;
};

// Throws Error "PATH:LINE: ..." for anything that is not as above. Sizes that do not fit in 63 bits
// are refused.
RawSidecar parse_raw_sidecar(std::string_view yaml, const std::filesystem::path& path);

}  // namespace voxloom
