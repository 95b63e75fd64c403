// A file as memory: nothing is read until it is looked at.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>

namespace voxloom {

// The bytes are those of the file for as long as nobody shortens it in place; OutputFile never does.
class MappedFile {
  public:
    explicit MappedFile(const std::filesystem::path& path);  // throws Error, naming the file
    ~MappedFile();
    MappedFile(const MappedFile&) = delete;
    MappedFile& operator=(const MappedFile&) = delete;

    std::span<const std::byte> bytes() const { return {data_, size_}; }

  private:
    const std::byte* data_ = nullptr;
    std::size_t size_ = 0;
};

}  // namespace voxloom
