// Details of which few are not zero, as a list: where tables and states would cost more than what they say.
#pragma once

#include "plugins/codec-wavelet/bit_io.h"

namespace voxloom::wavelet {

// Gaps between places (band by band, x fastest) in a Rice code whose parameter fits their mean, signs, sizes.
void write_sparse(const Details& details, BitWriter& bits);
// Into bands that are zero. Throws Error where a place is beyond the end.
void read_sparse(BitReader& bits, Details& details);

}  // namespace voxloom::wavelet
