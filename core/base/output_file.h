// A file that is there whole or not at all: written beside its place under a temporary name, and
// renamed when everything is in it. A destructor without commit() removes what was written.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace voxloom {

class OutputFile {
  public:
    explicit OutputFile(std::filesystem::path path);  // throws Error when the folder refuses it
    ~OutputFile();
    OutputFile(const OutputFile&) = delete;
    OutputFile& operator=(const OutputFile&) = delete;

    void write(std::span<const std::byte> bytes);  // throws Error: disk full, quota, ...
    void write(std::string_view text) { write(std::as_bytes(std::span(text.data(), text.size()))); }
    std::uint64_t size() const { return size_; }
    // Closes and gives the file its name, replacing what was there.
    void commit();

  private:
    [[noreturn]] void fail_with_reason(int error) const;
    std::filesystem::path path_, temporary_;
    int descriptor_ = -1;
    std::uint64_t size_ = 0;
};

// ".png" for "Picture.PNG": the format that a path asks for.
std::string extension_of(const std::filesystem::path& path);

}  // namespace voxloom
