// Small pictures of what flows, for the nodes on the canvas.
#pragma once

#include <glm/glm.hpp>
#include <memory>
#include <stop_token>
#include <vector>

#include "core/data/brick_cache.h"
#include "core/data/image.h"
#include "core/data/volume.h"

namespace voxloom::editor {

struct Thumbnail {
    glm::ivec2 size{0};
    std::vector<glm::u8vec4> pixels;  // opaque; row 0 is the top row
    double aspect = 1;                // width over height of what is shown
};

inline constexpr int kThumbnailPixels = 160;  // along the longer side

// Over black where the picture is transparent; means of the pixels that fall together.
std::shared_ptr<const Thumbnail> thumbnail_of(const Image& image);
// The middle slice along z, or along the axis that has one voxel, grey from its least to its greatest
// value, or in colour where the volume is. Rows go down as they are drawn: the last one is at the top.
std::shared_ptr<const Thumbnail> thumbnail_of(const Volume& volume, const std::stop_token& stop = {});
// The same of the coarsest level that has at least so many voxels along each axis, or as many as there are; what it
// needs is decoded through `cache`.
inline constexpr std::int64_t kThumbnailLevelVoxels = 64;
std::shared_ptr<const Thumbnail> thumbnail_of(const BricksPtr& bricks, BrickCache& cache, const std::stop_token& stop = {});

// An opaque pixel of a screen, over black. Not a number is black.
glm::u8vec4 screen_pixel(const glm::vec4& color);

}  // namespace voxloom::editor
