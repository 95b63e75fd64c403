// A file as memory: nothing is read until it is looked at.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

namespace voxloom {

// The bytes are those of the file for as long as nobody shortens it in place; OutputFile never does.
class MappedFile {
  public:
    explicit MappedFile(const std::filesystem::path& path);  // throws Error, naming the file
    // The first `size` bytes of an open file, which may be closed afterwards; `name` is for messages.
    MappedFile(int descriptor, std::uint64_t size, const std::string& name);
    ~MappedFile();
    MappedFile(const MappedFile&) = delete;
    MappedFile& operator=(const MappedFile&) = delete;

    std::span<const std::byte> bytes() const { return {data_, size_}; }
    // The process need not hold these bytes for now; looking at them reads them again. [any thread]
    void forget(std::uint64_t offset, std::uint64_t size) const;

  private:
    const std::byte* data_ = nullptr;
    std::size_t size_ = 0;
};

}  // namespace voxloom
