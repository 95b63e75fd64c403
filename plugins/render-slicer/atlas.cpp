#include "plugins/render-slicer/atlas.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "core/base/morton.h"
#include "core/base/parallel.h"
#include "core/gpu/thread.h"

namespace voxloom::slicer {

namespace {

glm::ivec3 side_of(const BricksDesc& bricks, Apron apron) { return bricks.brick + apron.below + apron.above; }

std::size_t voxels_in(glm::ivec3 n) { return std::size_t(n.x) * std::size_t(n.y) * std::size_t(n.z); }

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
        block_[a] = brick_[a] % 4 == 0 ? 4 : brick_[a];
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
    if (places_.whole()) return places_.origin[std::size_t(brick.wanted.id.level)] + brick.wanted.id.index * brick_;
    const glm::ivec3 n = places_.grid;
    return glm::ivec3(brick.slot % n.x, brick.slot / n.x % n.y, brick.slot / n.x / n.y) * side_;
}

glm::ivec3 Atlas::texel_of(BrickId id) const {
    return corner_of(places_.whole() ? Brick{.wanted = {id}, .ranges = {}} : *index_.at(id)) + apron_.below;
}

// Where a level lies in the texture as a whole, bricks that nobody asks for are there too, as one of the
// values that they can have: a ray that strays into one from a neighbour then meets nothing that is not in
// the brick, so a brick that cannot be seen is not seen. Where a neighbour blends that does not hold for the
// voxels that they share: may_show_mixture().
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

bool Atlas::has(const WantedBrick& brick) const {
    const auto it = index_.find(brick.id);
    return it != index_.end() && !it->second->spoilt && it->second->wanted.blend == brick.blend;
}

bool Atlas::may_show_mixture(BrickId id) const {
    bool may = false;
    for_each_around(id, [&](const Brick& brick) { may = may || brick.wanted.blends(); });
    return may;
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

// What is resident and can serve as it is; it counts as used.
bool Atlas::keep(const WantedBrick& brick) {
    const auto it = index_.find(brick.id);
    if (it == index_.end()) return false;
    if (!has(brick)) {  // another mixture: its place is free for the one that is wanted
        if (!places_.whole()) free_.push_back(it->second->slot);
        order_.erase(it->second);
        index_.erase(it);
        return false;
    }
    it->second->picture = picture_;
    order_.splice(order_.begin(), order_, it->second);
    return true;
}

// A slot for one more brick; true where an old brick had to go.
bool Atlas::find_slot(std::int64_t& slot) {
    if (places_.whole()) return false;
    const bool evicts = free_.empty();
    if (evicts) {  // the oldest, which is none of this picture's: there are slots for all of those
        assert(order_.back().picture != picture_);
        free_.push_back(order_.back().slot);
        index_.erase(order_.back().wanted.id);
        order_.pop_back();
    }
    slot = free_.back();
    free_.pop_back();
    return evicts;
}

// Side by side, bricks share voxels: each writes its apron too, with the mixture of those that are wanted beside
// it. So neighbours that are drawn together agree; one that nobody wants just now is spoilt.
void Atlas::spoil_neighbours(const WantedBrick& loaded) {
    for_each_around(loaded.id, [&](Brick& brick) {
        if (brick.picture != picture_ && (loaded.blends() || brick.wanted.blends())) brick.spoilt = true;
    });
}

Atlas::Counters Atlas::load(const BricksPtr& bricks, const std::vector<WantedBrick>& wanted, const std::stop_token& stop,
                            const std::function<void(double)>& progress) {
    assert(std::int64_t(wanted.size()) <= places_.slots);
    ++picture_;
    Counters counters;
    std::vector<WantedBrick> missing;
    std::unordered_map<BrickId, CornerBlend, HashOfBrickId> blend;
    for (const WantedBrick& brick : wanted) {
        if (texels_.mixed) blend[brick.id] = brick.blend;
        begin_level(*bricks, brick.id.level);
        if (keep(brick))
            ++counters.hits;
        else
            missing.push_back(brick);
    }
    // What lies near each other, on whichever level, comes one after the other: it has ancestors and neighbours in common,
    // which the cache of decoded bricks may have no room for until the end.
    std::ranges::sort(missing, {}, [&](const WantedBrick& b) {
        return std::pair(morton(b.id.index * bricks->desc().levels[std::size_t(b.id.level)].stride), -b.id.level);
    });
    // A batch is decoded on all threads, then uploaded.
    constexpr std::size_t kBatch = 64;
    const gpu::TexelLayout& l = texels_.layout;
    const std::size_t voxels = voxels_in(side_), batch = std::min(kBatch, missing.size()) * voxels;
    Buffer values(batch * l.bytes(), "upload"), gradients(gradients_ ? batch * 8 : 0, "upload"), colours(colours_ ? batch * 16 : 0, "upload");
    auto blends_about = [&](const WantedBrick& brick) {
        std::array<CornerBlend, 8> blends{};
        if (texels_.mixed)
            for (int o = 0; o < 8; ++o) {
                const auto it = blend.find({brick.id.level, brick.id.index - glm::ivec3(o & 1, o >> 1 & 1, o >> 2)});
                blends[std::size_t(o)] = it == blend.end() ? continued(brick.blend, o) : it->second;
            }
        return blends;
    };
    auto rows = [&](std::size_t i) {
        return TexelRows{values.data() + i * voxels * l.bytes(), gradients_ ? gradients.as<std::int16_t>().data() + i * voxels * 4 : nullptr,
                         colours_ ? colours.as<glm::vec4>().data() + i * voxels : nullptr};
    };
    for (std::size_t first = 0; first < missing.size(); first += kBatch) {
        check_stop(stop);
        const std::size_t count = std::min(kBatch, missing.size() - first);
        std::vector<FilledBrick> filled(count);
        parallel_for(0, std::int64_t(count), 1, [&](std::int64_t lo, std::int64_t hi) {
            for (std::int64_t i = lo; i < hi; ++i) {
                const WantedBrick& brick = missing[first + std::size_t(i)];
                filled[std::size_t(i)] = fill_texels(bricks, brick.id, blends_about(brick), texels_, apron_, block_, rows(std::size_t(i)), stop);
            }
        }, stop);
        for (std::size_t i = 0; i < count; ++i) {
            Brick brick{.wanted = missing[first + i], .picture = picture_, .ranges = std::move(filled[i].ranges)};
            counters.found_invalid = counters.found_invalid || filled[i].found_invalid;
            counters.evicted += find_slot(brick.slot);
            const glm::ivec3 corner = corner_of(brick);
            const TexelRows from = rows(i);
            gpu::upload(*values_, corner, side_, l.format(), l.type(), from.values);
            if (gradients_) gpu::upload(*gradients_, corner, side_, GL_RGBA, GL_SHORT, from.gradients);
            if (colours_) gpu::upload(*colours_, corner, side_, GL_RGBA, GL_FLOAT, from.colours);
            if (texels_.mixed && places_.whole()) spoil_neighbours(brick.wanted);
            order_.push_front(std::move(brick));
            index_[order_.front().wanted.id] = order_.begin();
        }
        counters.uploaded += count;
        counters.bytes += count * voxels * texels_.bytes();
        progress(double(first + count) / double(missing.size()));
    }
    gpu::check_errors("uploading bricks");
    return counters;
}

}  // namespace voxloom::slicer
