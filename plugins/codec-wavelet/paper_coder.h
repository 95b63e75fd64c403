// Runs of zeros and a fixed Huffman code (Guthe et al. 2002): small and fast, for mostly empty details.
#pragma once

#include "plugins/codec-wavelet/coder.h"

namespace voxloom::wavelet {

std::unique_ptr<Coder> make_paper_coder();

}  // namespace voxloom::wavelet
