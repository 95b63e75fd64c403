// The coder of numbers in blocks of 4^3 with four interleaved rANS states: files written before the
// fast coder took its place are read by it.
#pragma once

#include "plugins/codec-wavelet/coder.h"

namespace voxloom::wavelet {

std::unique_ptr<Coder> make_block_coder(std::span<const std::byte> tables);

}  // namespace voxloom::wavelet
