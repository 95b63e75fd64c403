#include "core/base/output_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <string>

#include "core/base/error.h"

namespace voxloom {

namespace fs = std::filesystem;

std::string extension_of(const fs::path& path) {
    std::string extension = path.extension().string();
    for (char& c : extension)
        if (c >= 'A' && c <= 'Z') c = char(c + ('a' - 'A'));
    return extension;
}

OutputFile::OutputFile(fs::path path) : path_(std::move(path)) {
    if (path_.filename().empty()) fail("'{}' names no file to write", path_.string());
    if (fs::is_directory(path_)) fail("{}: cannot be written, it is a folder", path_.string());
    static std::atomic<int> number{0};
    fs::path name;
    do {
        name = path_.parent_path() / fmt::format(".voxloom-{}-{}.tmp", ::getpid(), ++number);
        descriptor_ = ::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    } while (descriptor_ < 0 && (errno == EEXIST || errno == EINTR));
    if (descriptor_ < 0) fail_with_reason(errno);
    temporary_ = name;
}

OutputFile::~OutputFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
    if (!temporary_.empty()) ::unlink(temporary_.c_str());
}

void OutputFile::write(std::span<const std::byte> bytes) {
    constexpr std::size_t most = std::size_t(1) << 30;  // the kernel writes less than 2 GiB at once
    while (!bytes.empty()) {
        ssize_t n = ::write(descriptor_, bytes.data(), std::min(bytes.size(), most));
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) fail_with_reason(n < 0 ? errno : ENOSPC);
        size_ += std::uint64_t(n);
        bytes = bytes.subspan(std::size_t(n));
    }
}

void OutputFile::commit() {
    const int closed = ::close(descriptor_);
    descriptor_ = -1;
    if (closed != 0) fail_with_reason(errno);
    if (::rename(temporary_.c_str(), path_.c_str()) != 0) fail_with_reason(errno);
    temporary_.clear();
}

void OutputFile::fail_with_reason(int error) const {
    const char* mend = error == ENOSPC || error == EDQUOT || error == EFBIG
                           ? "free some space or write to another disk"
                       : error == ENOENT ? "make the folder first"
                                         : "choose another folder or change its permissions";
    fail("{}: cannot be written ({}) after {} bytes; {}", path_.string(), std::strerror(error),
         size_, mend);
}

}  // namespace voxloom
