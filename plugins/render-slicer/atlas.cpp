#include "plugins/render-slicer/atlas.h"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cmath>
#include <limits>

#include "core/base/parallel.h"
#include "core/gpu/thread.h"

namespace voxloom::slicer {

namespace {

glm::ivec3 side_of(const BricksDesc& bricks, Apron apron) { return bricks.brick + apron.below + apron.above; }

std::size_t voxels_in(glm::ivec3 n) { return std::size_t(n.x) * std::size_t(n.y) * std::size_t(n.z); }

// Validity of a box that may reach outside of the level, where the border is replicated.
void read_mask_around(const Bricks& bricks, int level, const Box& box, std::span<std::uint8_t> out) {
    const Index3 last = bricks.desc().levels[std::size_t(level)].dims - Index3(1);
    const Box shown{glm::clamp(box.lo, Index3(0), last), glm::clamp(box.hi - Index3(1), Index3(0), last) + Index3(1)};
    std::vector<std::uint8_t> inside(shown.voxels());
    bricks.read_mask(level, shown, inside);
    const Index3 n = shown.dims();
    std::size_t i = 0;
    for (std::int64_t z = box.lo.z; z < box.hi.z; ++z)
        for (std::int64_t y = box.lo.y; y < box.hi.y; ++y)
            for (std::int64_t x = box.lo.x; x < box.hi.x; ++x) {
                const Index3 p = glm::clamp(Index3(x, y, z), shown.lo, shown.hi - Index3(1)) - shown.lo;
                out[i++] = inside[std::size_t((p.z * n.y + p.y) * n.x + p.x)];
            }
}

// Widens `range` by one value, rounded outwards.
void widen(glm::vec2& range, double v) {
    constexpr float inf = std::numeric_limits<float>::infinity();
    float below = float(v), above = below;
    if (double(below) > v) below = std::nextafter(below, -inf);
    if (double(above) < v) above = std::nextafter(above, inf);
    range = {std::min(range.x, below), std::max(range.y, above)};
}

}  // namespace

std::uint64_t Atlas::slot_bytes(const BricksDesc& bricks, const gpu::TexelLayout& layout, Apron apron) {
    return checked_product(Index3(side_of(bricks, apron)), layout.bytes(), "a brick");
}

Atlas::Atlas(const BricksDesc& bricks, const gpu::TexelLayout& layout, Apron apron, std::int64_t slots)
    : layout_(layout), apron_(apron), brick_(bricks.brick), side_(side_of(bricks, apron)) {
    for (int a = 0; a < 3; ++a) {
        block_[a] = brick_[a] % 8 == 0 ? 8 : brick_[a];
        blocks_[a] = brick_[a] / block_[a];
    }
    // As near to a cube as the number of slots allows, within what the driver can hold.
    const glm::ivec3 most = glm::max(gpu::context_info().max_texture_3d / side_, glm::ivec3(1));
    std::int64_t left = std::max<std::int64_t>(slots, 1);
    for (int a = 0; a < 3; ++a) {
        const double share = std::pow(double(left), 1.0 / (3 - a));
        grid_[a] = int(std::clamp<double>(std::floor(share + 1e-9), 1, most[a]));
        left = a < 2 ? std::max<std::int64_t>(left / grid_[a], 1) : left;
    }
    slots_ = std::int64_t(grid_.x) * grid_.y * grid_.z;
    texture_ = std::make_shared<gpu::Texture>(gpu::make_texture(
        GL_TEXTURE_3D, layout_.internal_format(), grid_ * side_, GL_LINEAR, "the bricks of the picture"));
    for (std::int64_t s = slots_ - 1; s >= 0; --s) free_.push_back(s);
}

glm::ivec3 Atlas::corner_of(std::int64_t slot) const {
    return glm::ivec3(slot % grid_.x, slot / grid_.x % grid_.y, slot / grid_.x / grid_.y) * side_;
}

glm::ivec3 Atlas::texel_of(BrickId id) const { return corner_of(index_.at(id)->slot) + apron_.below; }

glm::vec2 Atlas::range_of(BrickId id, glm::ivec3 lo, glm::ivec3 hi) const {
    constexpr float inf = std::numeric_limits<float>::infinity();
    const Brick& brick = *index_.at(id);
    const glm::ivec3 from = glm::clamp(lo / block_, glm::ivec3(0), blocks_ - 1);
    const glm::ivec3 to = glm::clamp((hi - 1) / block_, from, blocks_ - 1);
    glm::vec2 range(inf, -inf);
    for (int z = from.z; z <= to.z; ++z)
        for (int y = from.y; y <= to.y; ++y)
            for (int x = from.x; x <= to.x; ++x) {
                const glm::vec2 r = brick.ranges[std::size_t((z * blocks_.y + y) * blocks_.x + x)];
                range = {std::min(range.x, r.x), std::max(range.y, r.y)};
            }
    return range;
}

// Decodes one brick and its surroundings, to texels and ranges.
void Atlas::fill(const BricksPtr& bricks, Brick& brick, std::span<std::byte> texels, bool& invalid,
                 const std::stop_token& stop) const {
    const BricksDesc& desc = bricks->desc();
    const VolumeDesc& volume = desc.volume;
    const Index3 lo = Index3(brick.id.index) * Index3(brick_);
    const Box around{lo - Index3(kReach), lo + Index3(brick_) + Index3(kReach)};
    const glm::ivec3 n(around.dims());
    Buffer voxels(around.voxels() * volume.voxel_bytes(), "brick");
    read_region(bricks, brick.id.level, around, voxels.bytes(), BrickCache::global(), stop);
    std::vector<std::uint8_t> mask(volume.has_mask ? around.voxels() : 0);
    if (volume.has_mask) read_mask_around(*bricks, brick.id.level, around, mask);

    // The slot's rows.
    const std::size_t texel_bytes = layout_.bytes(), row = std::size_t(side_.x);
    std::byte* out = texels.data();
    for (int z = 0; z < side_.z; ++z)
        for (int y = 0; y < side_.y; ++y, out += row * texel_bytes) {
            const std::size_t at =
                (std::size_t(z + kReach - apron_.below) * std::size_t(n.y) + std::size_t(y + kReach - apron_.below)) *
                    std::size_t(n.x) + std::size_t(kReach - apron_.below);
            invalid = gpu::to_texels(voxels.data() + at * volume.voxel_bytes(), mask.empty() ? nullptr : mask.data() + at,
                                     volume, layout_, 0, row, out) || invalid;
        }

    constexpr float inf = std::numeric_limits<float>::infinity();
    brick.ranges.assign(voxels_in(blocks_), {inf, -inf});
    with_type(volume.type, [&](auto t) {
        using T = decltype(t);
        const T* v = reinterpret_cast<const T*>(voxels.data());
        const std::size_t c = std::size_t(volume.components);
        std::vector<glm::vec2> columns(std::size_t(n.x));  // ranges of the columns of a block's rows
        for (int bz = 0; bz < blocks_.z; ++bz)
            for (int by = 0; by < blocks_.y; ++by) {
                std::fill(columns.begin(), columns.end(), glm::vec2(inf, -inf));
                for (int z = bz * block_.z; z <= (bz + 1) * block_.z + 2 * kReach && z < n.z; ++z)
                    for (int y = by * block_.y; y <= (by + 1) * block_.y + 2 * kReach && y < n.y; ++y)
                        for (int x = 0; x < n.x; ++x) {
                            const std::size_t i = (std::size_t(z) * std::size_t(n.y) + std::size_t(y)) * std::size_t(n.x) + std::size_t(x);
                            const T* p = v + i * c;
                            const double value = volume.color
                                                     ? 0.2126 * double(p[0]) + 0.7152 * double(p[1]) + 0.0722 * double(p[2])
                                                     : double(p[layout_.from]);
                            if ((mask.empty() || mask[i]) && std::isfinite(value)) widen(columns[std::size_t(x)], value);
                        }
                for (int bx = 0; bx < blocks_.x; ++bx) {
                    glm::vec2& r = brick.ranges[std::size_t((bz * blocks_.y + by) * blocks_.x + bx)];
                    for (int x = bx * block_.x; x <= (bx + 1) * block_.x + 2 * kReach && x < n.x; ++x)
                        r = {std::min(r.x, columns[std::size_t(x)].x), std::max(r.y, columns[std::size_t(x)].y)};
                }
            }
    });
}

Atlas::Counters Atlas::load(const BricksPtr& bricks, const std::vector<BrickId>& wanted, const std::stop_token& stop,
                            const std::function<void(double)>& progress) {
    assert(std::int64_t(wanted.size()) <= slots_);
    ++picture_;
    Counters counters;
    std::vector<BrickId> missing;
    for (const BrickId& id : wanted) {
        const auto it = index_.find(id);
        if (it == index_.end()) {
            missing.push_back(id);
            continue;
        }
        it->second->picture = picture_;
        order_.splice(order_.begin(), order_, it->second);
        ++counters.hits;
    }
    // A batch is decoded on all threads, then uploaded.
    constexpr std::size_t kBatch = 64;
    const std::size_t bytes = voxels_in(side_) * layout_.bytes();
    Buffer staging(std::min(kBatch, std::max<std::size_t>(missing.size(), 1)) * bytes, "upload");
    for (std::size_t first = 0; first < missing.size(); first += kBatch) {
        check_stop(stop);
        const std::size_t count = std::min(kBatch, missing.size() - first);
        std::vector<Brick> fresh(count);
        std::atomic<bool> found_invalid = false;
        parallel_for(0, std::int64_t(count), 1, [&](std::int64_t lo, std::int64_t hi) {
            for (std::int64_t i = lo; i < hi; ++i) {
                Brick& brick = fresh[std::size_t(i)];
                brick.id = missing[first + std::size_t(i)];
                bool invalid = false;
                fill(bricks, brick, staging.bytes().subspan(std::size_t(i) * bytes, bytes), invalid, stop);
                if (invalid) found_invalid = true;
            }
        }, stop);
        counters.found_invalid = counters.found_invalid || found_invalid;
        for (std::size_t i = 0; i < count; ++i) {
            if (free_.empty()) {  // the oldest, which is none of this picture's: there are slots for all of those
                assert(order_.back().picture != picture_);
                free_.push_back(order_.back().slot);
                index_.erase(order_.back().id);
                order_.pop_back();
                ++counters.evicted;
            }
            fresh[i].slot = free_.back();
            fresh[i].picture = picture_;
            free_.pop_back();
            gpu::upload(*texture_, corner_of(fresh[i].slot), side_, layout_.format(), layout_.type(),
                        staging.data() + i * bytes);
            order_.push_front(std::move(fresh[i]));
            index_[order_.front().id] = order_.begin();
        }
        counters.uploaded += count;
        counters.bytes += count * bytes;
        progress(double(first + count) / double(missing.size()));
    }
    gpu::check_errors("uploading bricks");
    return counters;
}

}  // namespace voxloom::slicer
