// What the formats that ITK reads have in common. Included only where ITK is there.
#pragma once

#include <itkImageIOBase.h>

#include <filesystem>
#include <mutex>
#include <string>
#include <vector>

#include "volume_file.h"

namespace voxloom {

// teem, niftilib and MetaIO keep global state, so one thread at a time calls into ITK.
std::mutex& itk_mutex();

// An ITK exception as the one sentence that says what is wrong, without its stack and places.
std::string sentence_of(const itk::ExceptionObject& e);

// Runs f() under the mutex with ITK quiet; its exceptions become "PATH: sentence" Errors.
void with_itk(const std::filesystem::path& path, const std::function<void()>& f);

// What an image IO said after ReadImageInformation, as a description. Axes beyond the third are
// `outer`: their extents. Throws Error for what a volume cannot be (5 components, complex 5-D).
struct ItkImage {
    VolumeDesc desc;
    std::vector<std::int64_t> outer;
    double outer_spacing = 1, outer_origin = 0;  // of the first of them
    Samples samples;                             // 64-bit integers
    std::vector<std::string> warnings;
};
ItkImage image_of(const itk::ImageIOBase& io, const std::filesystem::path& path);

// Reads everything that `io` has (information was read) into `out`, of exactly that size.
void read_all(itk::ImageIOBase& io, std::span<std::byte> out, const std::filesystem::path& path);

}  // namespace voxloom
