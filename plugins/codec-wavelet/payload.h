// The compressed bytes of all families, as they come: in memory while they are few, else in a temporary
// file, which the finished tree maps.
#pragma once

#include <memory>
#include <span>

#include "core/base/scratch_file.h"
#include "plugins/codec-wavelet/coder.h"

namespace voxloom::wavelet {

struct Payload {
    std::span<const std::byte> bytes;
    std::shared_ptr<const void> keeper;  // of the bytes
    std::uint64_t resident = 0;          // memory that is theirs alone
    // Where the bytes are a part of a mapped file.
    const MappedFile* file = nullptr;
    std::uint64_t offset = 0;

    void forget(std::uint64_t at, std::uint64_t size) const {
        if (file) file->forget(offset + at, size);
    }
};

class PayloadWriter {
  public:
    explicit PayloadWriter(std::uint64_t most_memory) : most_memory_(most_memory), held_(std::make_shared<Bytes>()) {}
    void append(std::span<const std::byte> bytes);
    std::uint64_t size() const { return written_ + held_->size(); }
    Payload finish();

  private:
    void spill();
    std::uint64_t most_memory_, written_ = 0;
    std::shared_ptr<Bytes> held_;  // those after the first written_
    std::unique_ptr<ScratchFile> file_;
};

}  // namespace voxloom::wavelet
