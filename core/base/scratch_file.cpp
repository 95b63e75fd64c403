#include "core/base/scratch_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "core/base/error.h"

namespace voxloom {

namespace {
constexpr std::size_t kMost = std::size_t(1) << 30;  // the kernel moves less than 2 GiB at once
}

ScratchFile::ScratchFile() {
    std::error_code error;
    folder_ = std::filesystem::temp_directory_path(error).string();
    if (error) folder_ = "/tmp";
    std::string name = folder_ + "/voxloom-XXXXXX";
    descriptor_ = ::mkostemp(name.data(), O_CLOEXEC);
    if (descriptor_ < 0)
        fail("{}: no temporary file can be made there ({}); set TMPDIR to a folder that can be written", folder_,
             std::strerror(errno));
    ::unlink(name.c_str());
}

ScratchFile::~ScratchFile() { ::close(descriptor_); }

void ScratchFile::write(std::uint64_t offset, std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
        const ssize_t n = ::pwrite(descriptor_, bytes.data(), std::min(bytes.size(), kMost), off_t(offset));
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0)
            fail("{}: a temporary file there cannot be written ({}) after {} bytes; free some space, set TMPDIR to a folder "
                 "on another disk, or allow more memory",
                 folder_, std::strerror(n < 0 ? errno : ENOSPC), offset);
        offset += std::uint64_t(n);
        bytes = bytes.subspan(std::size_t(n));
    }
}

void ScratchFile::read(std::uint64_t offset, std::span<std::byte> bytes) const {
    while (!bytes.empty()) {
        const ssize_t n = ::pread(descriptor_, bytes.data(), std::min(bytes.size(), kMost), off_t(offset));
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0)
            fail("{}: a temporary file there cannot be read ({})", folder_, n < 0 ? std::strerror(errno) : "it is too short");
        offset += std::uint64_t(n);
        bytes = bytes.subspan(std::size_t(n));
    }
}

std::shared_ptr<const MappedFile> ScratchFile::map(std::uint64_t size) const {
    return std::make_shared<const MappedFile>(descriptor_, size, folder_);
}

}  // namespace voxloom
