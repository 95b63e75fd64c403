// The coder for the fastest decoding: static rANS, 32 states side by side.
#pragma once

#include "plugins/codec-wavelet/coder.h"

namespace voxloom::wavelet {

std::unique_ptr<Coder> make_fast_coder(std::span<const std::byte> tables);

}  // namespace voxloom::wavelet
