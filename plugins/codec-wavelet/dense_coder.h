// The coder for the smallest files: adaptive binary range coding with mixed contexts.
#pragma once

#include "plugins/codec-wavelet/coder.h"

namespace voxloom::wavelet {

std::unique_ptr<Coder> make_dense_coder(std::span<const std::byte> tables);

}  // namespace voxloom::wavelet
