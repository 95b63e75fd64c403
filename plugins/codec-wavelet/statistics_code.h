// What BrickInfo says of every brick, as bytes of a file's head: docs/wavelet-format.md.
#pragma once

#include <cstdint>

#include "core/base/byte_io.h"
#include "plugins/codec-wavelet/wavelet_bricks.h"

namespace voxloom::wavelet {

void write_statistics(const TreeIndex& index, ByteWriter& writer);
// Fills index.infos, which have their sizes already. `version` is the file's.
void read_statistics(TreeIndex& index, ByteReader& reader, std::uint32_t version);

}  // namespace voxloom::wavelet
