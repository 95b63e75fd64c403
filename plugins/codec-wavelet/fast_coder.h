// Static interleaved rANS over blocks: most of the adaptive coder's gain at several times its speed.
#pragma once

#include "plugins/codec-wavelet/coder.h"

namespace voxloom::wavelet {

std::unique_ptr<Coder> make_fast_coder(std::span<const std::byte> tables);

}  // namespace voxloom::wavelet
