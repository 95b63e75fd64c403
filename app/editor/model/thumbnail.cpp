#include "app/editor/model/thumbnail.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/error.h"

namespace voxloom::editor {

namespace {

// As large as the limit allows, and no larger than what it is of.
glm::ivec2 size_within(glm::dvec2 size) {
    const double scale = std::min(1.0, kThumbnailPixels / std::max(size.x, size.y));
    return glm::max(glm::ivec2(glm::round(size * scale)), glm::ivec2(1));
}

// A slice as doubles: one a voxel, or three where it is colour.
struct Slice {
    std::int64_t width = 0, height = 0;
    int channels = 1;
    std::vector<double> values;  // of every voxel of the rows that are shown
};

// The voxels of a plane across `axis`, at most so many rows and columns of them.
Slice read_slice(const Volume& volume, int axis, const std::stop_token& stop) {
    const VolumeDesc& desc = volume.desc();
    const int u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
    const std::int64_t step_u = std::max<std::int64_t>(1, desc.dims[u] / kThumbnailPixels),
                       step_v = std::max<std::int64_t>(1, desc.dims[v] / kThumbnailPixels);
    Slice slice;
    slice.channels = desc.color && desc.components >= 3 ? 3 : 1;
    slice.width = (desc.dims[u] + step_u - 1) / step_u;
    slice.height = (desc.dims[v] + step_v - 1) / step_v;
    slice.values.reserve(std::size_t(slice.width * slice.height * slice.channels));
    for (std::int64_t row = 0; row < slice.height; ++row) {
        check_stop(stop);
        Box box = Box::of(desc.dims);
        box.lo[axis] = desc.dims[axis] / 2;
        box.hi[axis] = box.lo[axis] + 1;
        box.lo[v] = row * step_v;
        box.hi[v] = box.lo[v] + 1;
        Buffer voxels(std::size_t(box.voxels()) * desc.voxel_bytes());
        volume.read(box, voxels.bytes(), stop);
        with_type(desc.type, [&](auto t) {
            const auto values = voxels.as<decltype(t)>();
            for (std::int64_t x = 0; x < slice.width; ++x)
                for (int c = 0; c < slice.channels; ++c)
                    slice.values.push_back(double(values[std::size_t(x * step_u * desc.components + c)]));
        });
    }
    return slice;
}

}  // namespace

glm::u8vec4 screen_pixel(const glm::vec4& color) {
    auto byte = [](float v) { return std::uint8_t(v > 0 ? std::min(v, 1.f) * 255 + 0.5f : 0.f); };
    return {byte(color.r), byte(color.g), byte(color.b), 255};
}

std::shared_ptr<const Thumbnail> thumbnail_of(const Image& image) {
    auto small = std::make_shared<Thumbnail>();
    const glm::ivec2 full = image.size();
    if (full.x < 1 || full.y < 1) return small;
    small->size = size_within(full);
    small->aspect = double(full.x) / full.y;
    for (int y = 0; y < small->size.y; ++y)
        for (int x = 0; x < small->size.x; ++x) {
            const glm::ivec2 at(x, y), lo = at * full / small->size, hi = (at + 1) * full / small->size;
            glm::vec4 sum(0);
            for (int j = lo.y; j < hi.y; ++j)
                for (int i = lo.x; i < hi.x; ++i) sum += image.at(i, j);
            small->pixels.push_back(screen_pixel(sum / float((hi.x - lo.x) * (hi.y - lo.y))));
        }
    return small;
}

std::shared_ptr<const Thumbnail> thumbnail_of(const Volume& volume, const std::stop_token& stop) {
    const VolumeDesc& desc = volume.desc();
    auto small = std::make_shared<Thumbnail>();
    if (desc.voxels() == 0) return small;
    const int axis = desc.dims.z == 1 ? 2 : desc.dims.y == 1 ? 1 : desc.dims.x == 1 ? 0 : 2;
    const Slice slice = read_slice(volume, axis, stop);
    const glm::dvec3 lengths = glm::dvec3(desc.dims) * desc.spacing();
    const double aspect = lengths[axis == 0 ? 1 : 0] / lengths[axis == 2 ? 1 : 2];
    small->aspect = std::isfinite(aspect) && aspect > 0 ? std::clamp(aspect, 0.05, 20.0) : 1;
    small->size = glm::ivec2(slice.width, slice.height);
    double lo = std::numeric_limits<double>::infinity(), hi = -lo;
    for (double v : slice.values)
        if (std::isfinite(v)) lo = std::min(lo, v), hi = std::max(hi, v);
    const double half = hi / 2 - lo / 2;  // the extent itself may overflow
    auto grey = [&](double v) {
        if (!std::isfinite(v)) return 0.f;
        return half > 0 ? float((v / 2 - lo / 2) / half) : 0.5f;
    };
    small->pixels.resize(std::size_t(slice.width * slice.height));
    for (std::int64_t y = 0; y < slice.height; ++y)
        for (std::int64_t x = 0; x < slice.width; ++x) {
            const double* v = &slice.values[std::size_t((y * slice.width + x) * slice.channels)];
            const glm::vec4 color(grey(v[0]), grey(v[slice.channels / 2]), grey(v[slice.channels - 1]), 1);
            small->pixels[std::size_t((slice.height - 1 - y) * slice.width + x)] = screen_pixel(color);
        }
    return small;
}

std::shared_ptr<const Thumbnail> thumbnail_of(const BricksPtr& bricks, BrickCache& cache, const std::stop_token& stop) {
    const std::vector<LevelDesc>& levels = bricks->desc().levels;
    const Index3 least = glm::min(levels[0].dims, Index3(kThumbnailLevelVoxels));
    std::size_t level = levels.size() - 1;
    while (level > 0 && glm::any(glm::lessThan(levels[level].dims, least))) --level;
    return thumbnail_of(*level_as_volume(bricks, int(level), cache), stop);
}

}  // namespace voxloom::editor
