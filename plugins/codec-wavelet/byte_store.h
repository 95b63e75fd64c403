// Bytes by offset: in memory, or, where that would be too much of it, in a temporary file.
#pragma once

#include <cstring>
#include <memory>
#include <span>
#include <string_view>

#include "core/base/buffer.h"
#include "core/base/scratch_file.h"

namespace voxloom::wavelet {

// Disjoint parts may be written from several threads.
class ByteStore {
  public:
    ByteStore() = default;
    ByteStore(std::uint64_t bytes, bool in_memory, std::string_view what) {
        if (in_memory)
            memory_ = Buffer(bytes, what);
        else
            file_ = std::make_unique<ScratchFile>();
    }
    void write(std::uint64_t offset, std::span<const std::byte> bytes) {
        if (file_)
            file_->write(offset, bytes);
        else if (!bytes.empty())
            std::memcpy(memory_.data() + offset, bytes.data(), bytes.size());
    }
    // Bytes that were written.
    void read(std::uint64_t offset, std::span<std::byte> bytes) const {
        if (file_)
            file_->read(offset, bytes);
        else if (!bytes.empty())
            std::memcpy(bytes.data(), memory_.data() + offset, bytes.size());
    }
    // The bytes at `offset` where they are in memory, else null.
    const std::byte* at(std::uint64_t offset) const { return file_ ? nullptr : memory_.data() + offset; }
    std::byte* at(std::uint64_t offset) { return file_ ? nullptr : memory_.data() + offset; }

  private:
    Buffer memory_;
    std::unique_ptr<ScratchFile> file_;
};

}  // namespace voxloom::wavelet
