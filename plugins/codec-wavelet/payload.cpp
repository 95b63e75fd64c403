#include "plugins/codec-wavelet/payload.h"

namespace voxloom::wavelet {

void PayloadWriter::append(std::span<const std::byte> bytes) {
    held_->insert(held_->end(), bytes.begin(), bytes.end());
    if (held_->capacity() > most_memory_) spill();
}

void PayloadWriter::spill() {
    if (!file_) file_ = std::make_unique<ScratchFile>();
    file_->write(written_, *held_);
    written_ += held_->size();
    held_->clear();
    if (held_->capacity() > most_memory_) *held_ = Bytes();
}

Payload PayloadWriter::finish() {
    if (!file_) {
        held_->shrink_to_fit();
        return {*held_, held_, held_->size()};
    }
    spill();
    const auto file = file_->map(written_);
    return {file->bytes(), file, 0, file.get()};
}

}  // namespace voxloom::wavelet
