// How far one picture is from another.
//
// Pictures are compared as they are stored: premultiplied RGBA, linear float (8-bit pictures divided
// by 255). The peak of the PSNR is 1. Pixels that are not finite on one side alone count as off and
// as mismatched, and enter no sum; those that are not finite on both sides are skipped.
//
// SSIM after Wang, Bovik, Sheikh & Simoncelli 2004, on luma (0.2126 R + 0.7152 G + 0.0722 B, over
// black): Gaussian window 11 x 11 with sigma 1.5, K1 = 0.01, K2 = 0.03, dynamic range 1, mean over all
// positions where the window lies inside. Along an axis with fewer than 11 pixels the window is cut
// off and renormalised at every pixel instead. What is not finite counts as 0 there.
#pragma once

#include <cstdint>
#include <stop_token>
#include <string>

#include "core/data/image.h"

namespace voxloom {

struct ImageError {
    std::uint64_t pixels = 0;      // that enter the sums
    std::uint64_t mismatched = 0;  // not finite on one side alone
    double rmse = 0;               // over all four channels
    double max_error = 0;
    glm::ivec2 max_error_at{0};
    double psnr = 0;               // dB, peak 1
    double ssim = 1;
    double share_off = 0;          // of the pixels, where a channel is off by more than 1/255
};

// Throws Error where the sizes differ, and Cancelled.
ImageError compare_images(const Image& image, const Image& reference, const std::stop_token& stop = {});

// Why the two cannot be compared, or empty.
std::string problem_with_comparison(glm::ivec2 size, glm::ivec2 reference);

// |image - reference| * scale in red, green and blue, opaque; where one side alone is not finite: 1.
// Throws as compare_images().
ImagePtr difference_image(const Image& image, const Image& reference, double scale, const std::stop_token& stop = {});

}  // namespace voxloom
