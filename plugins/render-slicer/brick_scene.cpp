#include "plugins/render-slicer/brick_scene.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "core/base/text.h"
#include "core/graph/node.h"
#include "plugins/render-slicer/blocks.h"
#include "plugins/render-slicer/decoding.h"
#include "plugins/render-slicer/keep.h"
#include "plugins/render-slicer/modules.h"
#include "plugins/render-slicer/pages.h"
#include "plugins/render-slicer/tables.h"

namespace voxloom::slicer {

namespace {

// Everything in a Bricks, looked at once: constant from picture to picture, so that tables are too.
ValueRange range_of_everything(const Bricks& bricks, const std::stop_token& stop) {
    double lo = std::numeric_limits<double>::infinity(), hi = -lo;
    const BricksDesc& desc = bricks.desc();
    for (int l = 0; l < int(desc.levels.size()); ++l) {
        const glm::ivec3 n = desc.levels[std::size_t(l)].bricks;
        for (int z = 0; z < n.z; ++z) {
            check_stop(stop);
            for (int y = 0; y < n.y; ++y)
                for (int x = 0; x < n.x; ++x) {
                    const ValueRange r = bricks.info({l, {x, y, z}}).range;
                    lo = std::min(lo, r.min);
                    hi = std::max(hi, r.max);
                }
        }
    }
    // Bricks are delivered in the volume's own type.
    const auto [least, most] = limits_of(desc.volume.type);
    return lo <= hi ? ValueRange{std::clamp(lo, least, most), std::clamp(hi, least, most)} : ValueRange{};
}

// Distances between slices that pages have: 1, 2, 4 ... planes.
int steps_of(const BricksDesc& desc, const std::vector<Page>& pages) {
    int steps = 1;
    for (const Page& p : pages) steps = std::max(steps, 1 + int(std::log2(step_of(desc, p.brick.level))));
    return steps;
}

// The atlas that has room for `wanted`; made anew where it is too small or its texels lack validity.
std::shared_ptr<Atlas> atlas_for(const BrickPlan& plan, const BrickRequest& request, bool validity) {
    const BricksPtr& bricks = plan.bricks;
    const std::vector<WantedBrick>& wanted = plan.wanted;
    const ValueRange range = plan.range;
    const BricksDesc& desc = bricks->desc();
    const auto need = std::int64_t(wanted.size());
    std::int64_t all = 0;
    int finest = int(desc.levels.size()) - 1;
    for (const LevelDesc& l : desc.levels) all += std::int64_t(l.bricks.x) * l.bricks.y * l.bricks.z;
    bool mixed = false;
    for (const WantedBrick& brick : wanted) {
        finest = std::min(finest, brick.id.level);
        mixed = mixed || brick.blends();
    }
    const std::uint64_t tables = request.table_bytes * std::uint64_t(steps_of(desc, plan.pages)) + table_bytes(desc, plan.grid);
    const std::uint64_t most_bytes = request.gpu_bytes - std::min(request.gpu_bytes, std::max(tables, request.gpu_bytes / 8));
    validity = validity || desc.volume.has_mask;
    bool whole = true;
    for (;;) {
        Texels texels;
        texels.mixed = mixed;
        texels.layout = gpu::texel_layout(desc.volume, request.component, range, validity, mixed);
        texels.gradient_side = request.gradient_side;
        // No difference of two values, halved, is more than half their range.
        texels.gradient_scale = float(std::max(0.5 * range.extent() / texels.layout.scale, 1e-30));
        texels.transfer = request.transfer;
        texels.slab = request.slab;
        std::optional<Places> places;
        Apron apron = request.apron;
        // A level alone is sampled without a look at its bounds: one voxel more at its beginning.
        if (whole) apron.below = std::max(apron.below, 1);
        if (whole) places = Places::whole_levels(desc, apron, texels.bytes(), most_bytes);
        whole = places && places->first_level <= finest;
        if (!whole) {
            apron = request.apron;
            const std::uint64_t each = Atlas::slot_bytes(desc, request.apron, texels.bytes());
            const auto most = std::int64_t(most_bytes / each);
            if (need > most)
                fail("gpu_memory of {} holds {} bricks of {} each beside {} of tables, but this picture needs {}; raise "
                     "gpu_memory or select fewer bricks", human_bytes(double(request.gpu_bytes)), most,
                     human_bytes(double(each)), human_bytes(double(tables)), need);
            // Room for the next pictures too, but no more than there are bricks.
            places = Places::in_slots(desc, request.apron, std::min({2 * need, most, all}));
            if (places->slots < need)
                fail("this picture needs {} bricks of {} each, but one texture of this OpenGL driver holds {}; select "
                     "fewer bricks", need, human_bytes(double(each)), places->slots);
        }
        const Hash key = Hasher().text("atlas").value(desc.volume.color ? -1 : request.component)
                             .value(apron.below).value(apron.above)
                             .value(request.gradient_side.value_or(-1))
                             .hash(request.transfer ? hash_of(*request.transfer) : Hash{}).value(request.slab)
                             .value(whole ? places->first_level : -1).value(mixed).finish();
        auto make = [&](std::uint64_t& bytes) {
            const glm::u64vec3 n(places->dims);
            Keep::instance().make_room(n.x * n.y * n.z * texels.bytes());
            auto made = std::make_shared<Atlas>(bricks, texels, apron, *places);
            bytes += made->bytes();
            return made;
        };
        std::shared_ptr<const Atlas> atlas;
        try {
            atlas = Keep::instance().get<Atlas>(bricks, key, make);
            if (!validity && atlas->texels().layout.validity) {
                validity = true;  // known from an earlier picture
                continue;
            }
            if (atlas->slots() < need || atlas->texels().layout.validity != validity) {
                Keep::instance().drop(bricks, key);
                atlas.reset();
                atlas = Keep::instance().get<Atlas>(bricks, key, make);
            }
        } catch (const Error&) {
            if (!whole) throw;
            whole = false;  // the driver has no room for all of it
            continue;
        }
        return std::const_pointer_cast<Atlas>(atlas);
    }
}

// The same pages, of bricks that are on the GPU or at least decoded. The coarsest ones are drawn in any case.
std::vector<Page> pages_of_what_is_there(const BrickPlan& plan) {
    std::unordered_map<BrickId, bool, HashOfBrickId> known;
    auto is_there = [&](BrickId id) {
        const auto [it, is_new] = known.try_emplace(id, false);
        if (is_new) it->second = plan.atlas->has({id}) || is_decoded(*plan.bricks, id, kAround);
        return it->second;
    };
    auto is_mixed = [&](const WantedBrick& brick) {
        return plan.atlas->has(brick) || (is_decoded(*plan.bricks, brick.id, kAround) &&
                                          is_decoded(*plan.bricks, *plan.bricks->desc().coarser(brick.id), kAround + 2));
    };
    std::vector<Page> pages = plan.pages;
    for (Page& p : pages) {
        const WantedBrick brick{p.brick, p.blend};
        if (p.parent ? is_there(p.brick) && is_there(*p.parent) : brick.blends() ? is_mixed(brick) : is_there(p.brick)) continue;
        p.parent.reset();
        p.blend = {};
        while (!is_there(p.brick))
            if (const auto coarser = plan.bricks->desc().coarser(p.brick))
                p.brick = *coarser;
            else
                break;
    }
    return pages;
}

void load_atlas(BrickPlan& plan, const std::vector<WantedBrick>& wanted, const BrickRequest& request, Evaluation& ev) {
    for (;;) {
        const BrickCache::Counters before = BrickCache::global().counters();
        const Atlas::Counters c = plan.atlas->load(plan.bricks, wanted, ev.stop(), [&](double f) {
            ev.progress(0.1 + 0.6 * f, "decoding and uploading bricks");
        });
        ev.count("bricks resident", double(c.hits));
        ev.count("bricks uploaded", double(c.uploaded));
        ev.count("bricks evicted", double(c.evicted));
        ev.count("bytes uploaded", double(c.bytes));
        const BrickCache::Counters after = BrickCache::global().counters();
        ev.count("families decoded", double(after.families_decoded - before.families_decoded));
        ev.count("bytes decoded", double(after.bytes_decoded - before.bytes_decoded));
        if (!c.found_invalid || plan.atlas->texels().layout.validity || plan.bricks->desc().volume.color) return;
        // Seen for the first time: all texels get a channel for it.
        plan.atlas.reset();
        plan.atlas = atlas_for(plan, request, true);
    }
}

// What find_occupancy() depends on beside the bricks themselves, whose values do not change.
Hash occupancy_key(const std::vector<Page>& pages, const Atlas& atlas, const BrickRequest& request) {
    Hasher h;
    h.text("occupancy").hash(request.visible_key).value(request.component);
    auto box = [&](auto v) { h.value(v.x).value(v.y).value(v.z); };
    box(atlas.block());
    for (const Page& p : pages) {
        h.value(p.brick.level);
        box(p.brick.index);
        box(p.cell.lo);
        box(p.cell.hi);
        h.value(p.parent ? p.parent->level : -1);
        for (float share : p.blend) h.value(share);
    }
    return h.finish();
}

BrickOccupancy find_occupancy(const BricksDesc& desc, const std::vector<Page>& pages, const Atlas& atlas,
                              const BrickRequest& request, double least) {
    BrickOccupancy out;
    // The finest page's blocks, coarser where there would be too many to leap between.
    int finest = int(desc.levels.size()) - 1;
    for (const Page& p : pages) finest = std::min(finest, p.brick.level);
    glm::i64vec3 size = glm::i64vec3(atlas.block()) * glm::i64vec3(desc.levels[std::size_t(finest)].stride);
    glm::ivec3 grid = grid_over(desc.volume.dims, size);
    while (double(grid.x) * double(grid.y) * double(grid.z) > double(kMostBlocks)) {
        size *= 2;
        grid = grid_over(desc.volume.dims, size);
    }
    std::vector<std::uint8_t> seen(std::size_t(grid.x) * std::size_t(grid.y) * std::size_t(grid.z), 0);
    bool several = false;
    for (const Page& p : pages) {
        several = several || p.brick.level != pages.front().brick.level;
        const Index3 stride(desc.levels[std::size_t(p.brick.level)].stride);
        const Index3 first = Index3(p.brick.index) * Index3(desc.brick) * stride;
        const Index3 block = Index3(atlas.block()) * stride;
        for (std::int64_t z = p.cell.lo.z / block.z * block.z; z < p.cell.hi.z; z += block.z)
            for (std::int64_t y = p.cell.lo.y / block.y * block.y; y < p.cell.hi.y; y += block.y)
                for (std::int64_t x = p.cell.lo.x / block.x * block.x; x < p.cell.hi.x; x += block.x) {
                    const Box fine = intersect({{x, y, z}, Index3(x, y, z) + block}, p.cell);
                    const glm::ivec3 at((Index3(x, y, z) - first) / stride);
                    glm::vec2 r = atlas.range_of(p.brick, at, at + atlas.block());
                    if (p.parent) {
                        const Index3 coarse(desc.levels[std::size_t(p.parent->level)].stride);
                        const Index3 origin = Index3(p.parent->index) * Index3(desc.brick) * coarse;
                        const glm::ivec3 lo((fine.lo - origin) / coarse), hi((fine.hi - origin + coarse - Index3(1)) / coarse);
                        const glm::vec2 q = atlas.range_of(*p.parent, lo, hi);
                        r = {std::min(r.x, q.x), std::max(r.y, q.y)};
                    }
                    if (r.x <= r.y && request.visible(least, r.x, r.y))
                        for_each_cell(fine, size, grid, [&](std::size_t c) { seen[c] = 1; });
                }
    }
    if (several) {
        // Rays that leap together may lie on both sides of a face between levels, whose values differ:
        // there a block is seen if one next to it is.
        std::vector<std::uint8_t> wider = seen;
        for (int axis = 0; axis < 3; ++axis) {
            const std::size_t step = axis == 0 ? 1 : axis == 1 ? std::size_t(grid.x) : std::size_t(grid.x) * std::size_t(grid.y);
            const std::vector<std::uint8_t> before = wider;
            for (const Page& p : pages) {
                Box face = p.cell;
                for (int side = 0; side < 2; ++side) {
                    face.lo = p.cell.lo;
                    face.hi = p.cell.hi;
                    if (side == 0)
                        face.hi[axis] = face.lo[axis] + 1;
                    else
                        face.lo[axis] = face.hi[axis] - 1;
                    const std::int64_t at = face.lo[axis] / size[axis];
                    const std::int64_t other = side == 0 ? at - 1 : at + 1;
                    if (other < 0 || other >= grid[axis]) continue;
                    for_each_cell(face, size, grid, [&](std::size_t c) {
                        const std::size_t n = side == 0 ? c - step : c + step;
                        if (before[n]) wider[c] = 1;
                        if (before[c]) wider[n] = 1;
                    });
                }
            }
        }
        seen = std::move(wider);
    }
    out.block_size = glm::vec3(size);
    out.blocks = grid;
    out.seen = std::size_t(std::ranges::count(seen, 1));
    if (out.seen == 0) return out;
    const std::vector<std::int8_t> distances = leaps(grid, seen);
    auto texture = std::make_shared<gpu::Texture>(
        gpu::make_texture(GL_TEXTURE_3D, GL_R8I, grid, GL_NEAREST, "the blocks of the bricks"));
    gpu::upload(*texture, {0, 0, 0}, grid, GL_RED_INTEGER, GL_BYTE, distances.data());
    out.texture = texture;
    return out;
}

}  // namespace

std::vector<BrickId> BrickPlan::missing() const {
    std::vector<BrickId> out;
    for (const WantedBrick& brick : wanted)
        if (!atlas->has(brick)) out.push_back(brick.id);
    return out;
}

BrickPlan plan_bricks(const BricksPtr& bricks, const Selection* selection, const BrickRequest& request, Evaluation& ev) {
    if (selection) check_selection(*selection, bricks->desc());
    BrickPlan plan;
    plan.bricks = bricks;
    plan.range = *Keep::instance().get<ValueRange>(bricks, Hasher().text("range").finish(), [&](std::uint64_t&) {
        return std::make_shared<ValueRange>(range_of_everything(*bricks, ev.stop()));
    });
    std::size_t transparent = 0;
    plan.pages = pages_of(*bricks, selection, [&](ValueRange r) { return request.visible(plan.range.min, r.min, r.max); }, transparent);
    ev.count("bricks skipped (transparent)", double(transparent));
    if (plan.pages.empty()) return plan;
    if (request.mix_when_loaded)
        for (Page& p : plan.pages) p.parent.reset();
    plan.wanted = bricks_of(plan.pages);
    ev.count("bricks drawn", double(plan.wanted.size()));
    plan.grid = grid_of(bricks->desc(), plan.pages);
    plan.atlas = atlas_for(plan, request, false);
    return plan;
}

BrickScene load_bricks(BrickPlan& plan, const BrickRequest& request, Evaluation& ev, bool what_is_there) {
    const BricksPtr& bricks = plan.bricks;
    const BricksDesc& desc = bricks->desc();
    BrickScene scene;
    scene.range = plan.range;
    if (plan.pages.empty()) return scene;
    const std::vector<Page> pages = what_is_there ? pages_of_what_is_there(plan) : plan.pages;
    load_atlas(plan, bricks_of(pages), request, ev);
    const std::shared_ptr<Atlas> atlas = plan.atlas;
    scene.atlas = atlas;

    // The last picture's tables make room for this one's.
    const Hash tables = Hasher().text("tables").finish();
    Keep::instance().drop(bricks, tables);
    const std::uint64_t room = table_bytes(desc, plan.grid);
    const Hash key = occupancy_key(pages, *atlas, request);
    scene.occupancy = Keep::instance().get<BrickOccupancy>(bricks, key, [&](std::uint64_t& bytes) {
        Keep::instance().make_room(room);
        auto made = std::make_shared<BrickOccupancy>(find_occupancy(desc, pages, *atlas, request, scene.range.min));
        if (made->texture) bytes += made->texture->bytes;
        ev.count("tables of blocks built");
        return made;
    });
    const glm::dvec3 blocks(scene.occupancy->blocks);
    if (!what_is_there) ev.count("blocks", blocks.x * blocks.y * blocks.z);
    if (!what_is_there) ev.count("blocks drawn", double(scene.occupancy->seen));
    if (scene.occupancy->seen == 0) return scene;
    Keep::instance().make_room(room - std::min(room, scene.occupancy->texture->bytes));

    PageGrid grid = what_is_there ? grid_of(desc, pages) : plan.grid;
    if (request.in_view && atlas->places().whole()) {
        auto is_seen = [&](BrickId id) {
            const ValueRange r = bricks->info(id).range;
            return request.visible(scene.range.min, r.min, r.max);
        };
        // Its last cells end at voxels of the bricks behind it, which something stands in for where they are drawn at
        // another level.
        auto ends_unseen = [&](BrickId id) {
            bool all = true;
            for (int o = 1; o < 8; ++o) {
                const BrickId behind{id.level, id.index + glm::ivec3(o & 1, o >> 1 & 1, o >> 2)};
                all = all && (!desc.has(behind) || atlas->is_resident(behind) || !is_seen(behind));
            }
            return all;
        };
        PageGrid joined = merged(desc, grid, [&](BrickId id) {
            if (!request.in_view(desc.fine_box_of(id))) return true;
            return !is_seen(id) && ends_unseen(id) && !atlas->may_show_mixture(id);
        });
        // Boxes of small cells may be more than the large bricks that they are of.
        if (joined.pages.size() <= grid.pages.size()) grid = std::move(joined);
    }
    if (!what_is_there) ev.count("pages drawn", double(grid.pages.size()));
    for (const Page& p : grid.pages) scene.blended = scene.blended || p.parent;
    scene.steps = steps_of(desc, grid.pages);
    scene.cell_size = glm::vec3(grid.cell);
    scene.cells = grid.cells;
    scene.brick_size = glm::vec3(desc.brick);
    scene.brick_hi = glm::vec3(desc.brick + atlas->apron().above - 1);
    scene.slot_lo = glm::vec3(float(-atlas->apron().below));

    auto field = std::make_shared<gpu::FieldSource>();
    const gpu::TexelLayout& layout = atlas->texels().layout;
    field->voxels.linear = true;
    field->voxels.color = desc.volume.color;
    field->voxels.has_validity = layout.validity;
    field->voxels.offset = layout.offset;
    field->voxels.scale = layout.scale;
    field->voxels.textures = {{"brick_dense_texture", atlas->values()}};
    if (grid.is_one_page()) {
        const int l = grid.pages.front().brick.level;
        const LevelDesc& level = desc.levels[std::size_t(l)];
        scene.one_level = true;
        scene.step = step_of(desc, l);
        scene.steps = 1;
        scene.slot_at = glm::vec3(atlas->texel_of({l, glm::ivec3(0)}));
        scene.slot_hi = glm::vec3(level.bricks * desc.brick + atlas->apron().above - 1);
        scene.scale = 1.0f / glm::vec3(level.stride);
        field->voxels.glsl = module("source-level");
    } else {
        field->voxels.glsl = module("source-bricks");
        field->voxels.textures.push_back({"page_index", page_index(grid)});
        field->voxels.textures.push_back({"page_table", page_table(desc, grid, *atlas)});
    }
    Keep::instance().get<gpu::FieldSource>(bricks, tables, [&](std::uint64_t& bytes) {
        for (std::size_t i = 1; i < field->voxels.textures.size(); ++i) bytes += field->voxels.textures[i].texture->bytes;
        return field;
    });
    scene.field = field;
    return scene;
}

void BrickScene::set(const gpu::Program& program) const {
    const glm::vec3 unit = 1.0f / glm::vec3(atlas->values()->dims);
    program.set("slot_unit", unit);
    program.set("slot_lo", slot_lo);
    if (one_level) {
        program.set("slot_at", slot_at);
        program.set("slot_base", (slot_at + 0.5f) * unit);
        program.set("slot_hi", slot_hi);
        program.set("page_scale", scale);
        return;
    }
    program.set("brick_hi", brick_hi);
    program.set("cell_size", cell_size);
    program.set("cell_last", cells - 1);
    program.set("brick_size", brick_size);
    program.set("table_layers", float(steps));
}

}  // namespace voxloom::slicer
