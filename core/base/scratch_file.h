// A temporary file without a name: it is gone with the object, or with the process however that ends.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "core/base/mapped_file.h"

namespace voxloom {

// Stands in the folder for temporary files ($TMPDIR, else /tmp). Disjoint parts may be read and written
// from several threads. Throws Error when the disk refuses it: full, no permission.
class ScratchFile {
  public:
    ScratchFile();
    ~ScratchFile();
    ScratchFile(const ScratchFile&) = delete;
    ScratchFile& operator=(const ScratchFile&) = delete;

    void write(std::uint64_t offset, std::span<const std::byte> bytes);
    // What was never written reads as zeros up to the last byte that was; beyond it is an Error.
    void read(std::uint64_t offset, std::span<std::byte> bytes) const;
    // The file's first `size` bytes; they stay when the ScratchFile goes.
    std::shared_ptr<const MappedFile> map(std::uint64_t size) const;

  private:
    std::string folder_;
    int descriptor_ = -1;
};

}  // namespace voxloom
