#include "core/base/mapped_file.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "core/base/error.h"

namespace voxloom {

MappedFile::MappedFile(const std::filesystem::path& path) {
    const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor < 0) fail("{}: cannot be opened ({})", path.string(), std::strerror(errno));
    struct stat status {};
    const bool known = ::fstat(descriptor, &status) == 0;
    const bool is_file = known && S_ISREG(status.st_mode);
    void* memory = nullptr;
    if (is_file && status.st_size > 0)
        memory = ::mmap(nullptr, std::size_t(status.st_size), PROT_READ, MAP_PRIVATE, descriptor, 0);
    const int error = errno;
    ::close(descriptor);  // the mapping stays
    if (!known || memory == MAP_FAILED) fail("{}: cannot be mapped ({})", path.string(), std::strerror(error));
    if (!is_file) fail("{}: is not a file", path.string());
    data_ = static_cast<const std::byte*>(memory);
    size_ = std::size_t(status.st_size);
}

MappedFile::MappedFile(int descriptor, std::uint64_t size, const std::string& name) {
    if (size == 0) return;  // nothing cannot be mapped
    void* memory = ::mmap(nullptr, std::size_t(size), PROT_READ, MAP_SHARED, descriptor, 0);
    if (memory == MAP_FAILED) fail("{}: cannot be mapped ({})", name, std::strerror(errno));
    data_ = static_cast<const std::byte*>(memory);
    size_ = std::size_t(size);
}

MappedFile::~MappedFile() {
    if (data_) ::munmap(const_cast<std::byte*>(data_), size_);
}

void MappedFile::forget(std::uint64_t offset, std::uint64_t size) const {
    const auto page = std::uint64_t(::sysconf(_SC_PAGESIZE));
    const std::uint64_t first = (offset + page - 1) / page * page, last = std::min<std::uint64_t>(offset + size, size_);
    if (first < last) ::madvise(const_cast<std::byte*>(data_) + first, std::size_t(last - first), MADV_DONTNEED);
}

}  // namespace voxloom
