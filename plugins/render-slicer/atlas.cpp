#include "plugins/render-slicer/atlas.h"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cmath>
#include <limits>

#include "core/base/parallel.h"
#include "core/gpu/thread.h"
#include "plugins/render-slicer/voxels.h"

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

std::uint64_t Atlas::slot_bytes(const BricksDesc& bricks, Apron apron, std::uint64_t texel_bytes) {
    return checked_product(Index3(side_of(bricks, apron)), texel_bytes, "a brick");
}

std::optional<Places> Places::whole_levels(const BricksDesc& bricks, Apron apron, std::uint64_t texel_bytes,
                                           std::uint64_t bytes) {
    const int levels = int(bricks.levels.size()), most = gpu::context_info().max_texture_3d;
    auto side = [&](int l) { return Index3(bricks.levels[std::size_t(l)].bricks) * Index3(bricks.brick) + Index3(apron.below + apron.above); };
    for (int first = 0; first < levels; ++first) {
        // The next coarser level beside the first one, further ones in a column: the axes that cost least.
        std::optional<Places> best;
        for (int beside = 0; beside < 3; ++beside)
            for (int column = 0; column < 3; ++column) {
                if (beside == column) continue;
                Places p;
                p.first_level = first;
                p.origin.assign(std::size_t(levels), glm::ivec3(0));
                Index3 dims = side(first), at(0);
                at[beside] = dims[beside];
                bool fits = glm::all(glm::lessThanEqual(dims, Index3(most)));
                for (int l = first + 1; l < levels && fits; ++l) {
                    p.origin[std::size_t(l)] = glm::ivec3(at);
                    dims = glm::max(dims, at + side(l));
                    at[column] += side(l)[column];
                    fits = glm::all(glm::lessThanEqual(dims, Index3(most)));
                }
                if (!fits || double(dims.x) * double(dims.y) * double(dims.z) * double(texel_bytes) > double(bytes)) continue;
                p.dims = glm::ivec3(dims);
                p.slots = std::numeric_limits<std::int64_t>::max();
                if (!best || Box::of(dims).voxels() < Box::of(Index3(best->dims)).voxels()) best = p;
            }
        if (best) return best;
    }
    return std::nullopt;
}

Places Places::in_slots(const BricksDesc& bricks, Apron apron, std::int64_t wanted) {
    // As near to a cube as the number of slots allows, within what the driver can hold.
    Places p;
    const glm::ivec3 side = side_of(bricks, apron);
    const glm::ivec3 most = glm::max(gpu::context_info().max_texture_3d / side, glm::ivec3(1));
    std::int64_t left = std::max<std::int64_t>(wanted, 1);
    for (int a = 0; a < 3; ++a) {
        const double share = std::pow(double(left), 1.0 / (3 - a));
        p.grid[a] = int(std::clamp<double>(std::floor(share + 1e-9), 1, most[a]));
        left = a < 2 ? std::max<std::int64_t>(left / p.grid[a], 1) : left;
    }
    p.slots = std::int64_t(p.grid.x) * p.grid.y * p.grid.z;
    p.dims = p.grid * side;
    return p;
}

Atlas::Atlas(const BricksPtr& bricks, const Texels& texels, Apron apron, const Places& places)
    : texels_(texels), apron_(apron), places_(places), brick_(bricks->desc().brick),
      side_(side_of(bricks->desc(), apron)), begun_(bricks->desc().levels.size(), false) {
    for (int a = 0; a < 3; ++a) {
        block_[a] = brick_[a] % 8 == 0 ? 8 : brick_[a];
        blocks_[a] = brick_[a] / block_[a];
    }
    auto make = [&](GLenum format) {
        return std::make_shared<gpu::Texture>(
            gpu::make_texture(GL_TEXTURE_3D, format, places_.dims, GL_LINEAR, "the bricks of the picture"));
    };
    values_ = make(texels_.layout.internal_format());
    if (texels_.gradient_side) gradients_ = make(GL_RGBA16_SNORM);
    if (texels_.transfer) colours_ = make(GL_RGBA32F);
    for (std::int64_t s = places_.whole() ? -1 : places_.slots - 1; s >= 0; --s) free_.push_back(s);
}

std::uint64_t Atlas::bytes() const {
    return values_->bytes + (gradients_ ? gradients_->bytes : 0) + (colours_ ? colours_->bytes : 0);
}

glm::ivec3 Atlas::corner_of(const Brick& brick) const {
    if (places_.whole()) return places_.origin[std::size_t(brick.id.level)] + brick.id.index * brick_;
    const glm::ivec3 n = places_.grid;
    return glm::ivec3(brick.slot % n.x, brick.slot / n.x % n.y, brick.slot / n.x / n.y) * side_;
}

glm::ivec3 Atlas::texel_of(BrickId id) const {
    return corner_of(places_.whole() ? Brick{.id = id, .ranges = {}} : *index_.at(id)) + apron_.below;
}

// Where a level lies in the texture as a whole, bricks that nobody asks for are there too, as one of the
// values that they can have: a ray that strays into one from a neighbour then meets nothing that is not in
// the brick, so a brick that cannot be seen is not seen.
void Atlas::begin_level(const Bricks& bricks, int level) {
    if (!places_.whole() || begun_[std::size_t(level)]) return;
    begun_[std::size_t(level)] = true;
    const gpu::TexelLayout& l = texels_.layout;
    const glm::ivec3 n = bricks.desc().levels[std::size_t(level)].bricks;
    const glm::ivec3 origin = places_.origin[std::size_t(level)];
    auto clear = [](const gpu::TexturePtr& t, glm::ivec3 lo, glm::ivec3 size, GLenum format, glm::vec4 texel) {
        glClearTexSubImage(t->name(), 0, lo.x, lo.y, lo.z, size.x, size.y, size.z, format, GL_FLOAT, &texel[0]);
    };
    for (int z = 0; z < n.z; ++z)
        for (int y = 0; y < n.y; ++y)
            for (int x = 0; x < n.x; ++x) {
                glm::vec4 texel(0.0f);  // not valid
                if (!l.validity) {
                    const ValueRange r = bricks.info({level, {x, y, z}}).range;
                    texel = glm::vec4(float((0.5 * r.min + 0.5 * r.max - l.offset) / l.scale));
                }
                clear(values_, origin + glm::ivec3(x, y, z) * brick_, side_, l.format(), texel);
            }
    const glm::ivec3 all = n * brick_ + apron_.below + apron_.above;
    if (gradients_) clear(gradients_, origin, all, GL_RGBA, glm::vec4(0.0f));
    if (colours_) clear(colours_, origin, all, GL_RGBA, glm::vec4(0.0f));
    gpu::check_errors("clearing the bricks of a level");
}

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

// Texels of a batch of bricks, one after the other.
struct Atlas::Staging {
    Buffer values, gradients, colours;
};

// Decodes one brick and its surroundings, to the texels of place `at` and to ranges.
void Atlas::fill(const BricksPtr& bricks, Brick& brick, Staging& staging, std::size_t at, bool& invalid,
                 const std::stop_token& stop) const {
    const gpu::TexelLayout& layout = texels_.layout;
    VolumeDesc volume = bricks->desc().volume;
    const Index3 lo = Index3(brick.id.index) * Index3(brick_);
    const Box around{lo - Index3(kReach), lo + Index3(brick_) + Index3(kReach)};
    const glm::ivec3 n(around.dims());
    volume.dims = around.dims();
    Buffer decoded(around.voxels() * volume.voxel_bytes(), "brick");
    read_region(bricks, brick.id.level, around, decoded.bytes(), BrickCache::global(), stop);
    Buffer valid(volume.has_mask ? around.voxels() : 0, "mask");
    if (volume.has_mask) read_mask_around(*bricks, brick.id.level, around, valid.as<std::uint8_t>());
    const DenseVolume voxels(volume, std::move(decoded), std::move(valid));
    std::vector<std::uint8_t> mask(volume.has_mask ? around.voxels() : 0);
    if (volume.has_mask) voxels.read_mask(Box::of(volume.dims), mask);

    // The place's rows.
    const std::size_t row = std::size_t(side_.x), place = at * voxels_in(side_);
    const glm::ivec3 first(kReach - apron_.below);
    std::byte* out = staging.values.data() + place * layout.bytes();
    for (int z = 0; z < side_.z; ++z)
        for (int y = 0; y < side_.y; ++y, out += row * layout.bytes()) {
            const std::size_t from = (std::size_t(z + first.z) * std::size_t(n.y) + std::size_t(y + first.y)) *
                                         std::size_t(n.x) + std::size_t(first.x);
            invalid = gpu::to_texels(voxels.data() + from * volume.voxel_bytes(), mask.empty() ? nullptr : mask.data() + from,
                                     volume, layout, 0, row, out) || invalid;
        }
    // Slice by slice, of which the place takes its part.
    std::vector<glm::vec4> slice(texels_.gradient_side || texels_.transfer ? std::size_t(n.x) * std::size_t(n.y) : 0);
    auto for_each_texel = [&](const auto& compute, const auto& store) {
        for (int z = 0; z < side_.z; ++z) {
            compute(z + first.z, slice.data());
            for (int y = 0; y < side_.y; ++y)
                for (int x = 0; x < side_.x; ++x)
                    store(place + (std::size_t(z) * std::size_t(side_.y) + std::size_t(y)) * row + std::size_t(x),
                          slice[std::size_t(y + first.y) * std::size_t(n.x) + std::size_t(x + first.x)]);
        }
    };
    if (texels_.gradient_side) {
        const Gradients gradients(voxels, layout.from, layout.offset, layout.scale, *texels_.gradient_side);
        std::int16_t* to = staging.gradients.as<std::int16_t>().data();
        for_each_texel([&](int z, glm::vec4* g) { gradients.slice(z, g); },
                       [&](std::size_t i, glm::vec4 g) {
                           for (std::size_t c = 0; c < 4; ++c)
                               to[4 * i + c] = std::int16_t(std::lrint(std::clamp(g[int(c)] / texels_.gradient_scale, -1.0f, 1.0f) * 32767.0f));
                       });
    }
    if (texels_.transfer) {
        glm::vec4* to = staging.colours.as<glm::vec4>().data();
        for_each_texel([&](int z, glm::vec4* e) { classify_slice(voxels, layout.from, texels_.transfer->one, texels_.slab, z, e); },
                       [&](std::size_t i, glm::vec4 e) { to[i] = e; });
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
                                                     : double(p[layout.from]);
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
    assert(std::int64_t(wanted.size()) <= places_.slots);
    ++picture_;
    Counters counters;
    std::vector<BrickId> missing;
    for (const BrickId& id : wanted) {
        begin_level(*bricks, id.level);
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
    const std::size_t voxels = voxels_in(side_), batch = std::min(kBatch, missing.size()) * voxels;
    Staging staging{Buffer(batch * texels_.layout.bytes(), "upload"), Buffer(gradients_ ? batch * 8 : 0, "upload"),
                    Buffer(colours_ ? batch * 16 : 0, "upload")};
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
                fill(bricks, brick, staging, std::size_t(i), invalid, stop);
                if (invalid) found_invalid = true;
            }
        }, stop);
        counters.found_invalid = counters.found_invalid || found_invalid;
        for (std::size_t i = 0; i < count; ++i) {
            if (!places_.whole()) {
                if (free_.empty()) {  // the oldest, which is none of this picture's: there are slots for all of those
                    assert(order_.back().picture != picture_);
                    free_.push_back(order_.back().slot);
                    index_.erase(order_.back().id);
                    order_.pop_back();
                    ++counters.evicted;
                }
                fresh[i].slot = free_.back();
                free_.pop_back();
            }
            fresh[i].picture = picture_;
            const glm::ivec3 corner = corner_of(fresh[i]);
            const gpu::TexelLayout& l = texels_.layout;
            gpu::upload(*values_, corner, side_, l.format(), l.type(), staging.values.data() + i * voxels * l.bytes());
            if (gradients_) gpu::upload(*gradients_, corner, side_, GL_RGBA, GL_SHORT, staging.gradients.data() + i * voxels * 8);
            if (colours_) gpu::upload(*colours_, corner, side_, GL_RGBA, GL_FLOAT, staging.colours.data() + i * voxels * 16);
            order_.push_front(std::move(fresh[i]));
            index_[order_.front().id] = order_.begin();
        }
        counters.uploaded += count;
        counters.bytes += count * voxels * texels_.bytes();
        progress(double(first + count) / double(missing.size()));
    }
    gpu::check_errors("uploading bricks");
    return counters;
}

}  // namespace voxloom::slicer
