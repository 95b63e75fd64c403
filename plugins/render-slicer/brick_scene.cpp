#include "plugins/render-slicer/brick_scene.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <tuple>

#include "core/base/text.h"
#include "core/graph/node.h"
#include "plugins/render-slicer/blocks.h"
#include "plugins/render-slicer/keep.h"
#include "plugins/render-slicer/modules.h"

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

struct Page {
    BrickId brick;
    Box cell;                                // voxels of level 0
    std::array<float, 8> blend{};
    std::optional<BrickId> parent;           // where it blends
};

// What of the selection can be seen at all: bricks outside of what is visible cost nothing further.
std::vector<Page> pages_of(const Bricks& bricks, const Selection* selection, double least,
                           const BrickRequest& request, std::size_t& transparent) {
    const BricksDesc& desc = bricks.desc();
    std::vector<Page> pages;
    auto visible = [&](BrickId id) {
        const ValueRange r = bricks.info(id).range;
        return request.visible(least, r.min, r.max);
    };
    auto add = [&](const SelectedBrick& b) {
        const bool blends = std::ranges::any_of(b.corner_blend, [](float r) { return r > 0; });
        const std::optional<BrickId> parent = blends ? desc.coarser(b.id) : std::nullopt;
        if (!visible(b.id) && !(parent && visible(*parent))) {
            ++transparent;
            return;
        }
        if (b.octants == 0xff || b.id.level == 0) {
            pages.push_back({b.id, desc.fine_box_of(b.id), b.corner_blend, parent});
            return;
        }
        for (int o = 0; o < 8; ++o)
            if (b.octants >> o & 1)
                if (const Box cell = fine_box_of_octant(desc, b.id, o); !cell.empty())
                    pages.push_back({b.id, cell, b.corner_blend, parent});
    };
    if (selection) {
        for (const SelectedBrick& b : selection->bricks) add(b);
    } else {
        const glm::ivec3 n = desc.levels[0].bricks;
        for (int z = 0; z < n.z; ++z)
            for (int y = 0; y < n.y; ++y)
                for (int x = 0; x < n.x; ++x) add({.id = {0, {x, y, z}}, .octants = 0xff, .corner_blend = {}, .predicted_error = 0});
    }
    return pages;
}

std::vector<BrickId> bricks_of(const std::vector<Page>& pages) {
    std::vector<BrickId> all;
    std::set<std::tuple<int, int, int, int>> known;
    auto add = [&](BrickId id) {
        if (known.emplace(id.level, id.index.x, id.index.y, id.index.z).second) all.push_back(id);
    };
    for (const Page& p : pages) {
        add(p.brick);
        if (p.parent) add(*p.parent);
    }
    return all;
}

// The atlas with all of `wanted` in it; made anew where it is too small or its texels lack validity.
std::shared_ptr<Atlas> load_atlas(const BricksPtr& bricks, const std::vector<BrickId>& wanted, ValueRange range,
                                  const BrickRequest& request, Evaluation& ev) {
    struct Holder {
        std::shared_ptr<Atlas> atlas;
        bool validity = false;
    };
    const BricksDesc& desc = bricks->desc();
    const Hash key = Hasher().text("atlas").value(desc.volume.color ? -1 : request.component)
                         .value(request.apron.below).value(request.apron.above).finish();
    bool validity = desc.volume.has_mask;
    std::int64_t all = 0;
    for (const LevelDesc& l : desc.levels) all += std::int64_t(l.bricks.x) * l.bricks.y * l.bricks.z;
    for (;;) {
        auto make = [&](std::int64_t slots) {
            return [&, slots](std::uint64_t& bytes) {
                auto holder = std::make_shared<Holder>();
                const gpu::TexelLayout layout = gpu::texel_layout(desc.volume, request.component, range, validity);
                holder->atlas = std::make_shared<Atlas>(desc, layout, request.apron, slots);
                holder->validity = validity;
                bytes += holder->atlas->bytes();
                return holder;
            };
        };
        const std::uint64_t each =
            Atlas::slot_bytes(desc, gpu::texel_layout(desc.volume, request.component, range, validity), request.apron);
        // The rest is for tables and the like.
        const auto most = std::int64_t(request.gpu_bytes / 4 * 3 / each);
        const auto need = std::int64_t(wanted.size());
        if (need > most)
            fail("gpu_memory of {} holds {} bricks of {} each, but this picture needs {}; raise gpu_memory or select "
                 "fewer bricks", human_bytes(double(request.gpu_bytes)), most, human_bytes(double(each)), need);
        // Room for the next pictures too, but no more than there are bricks.
        const std::int64_t slots = std::min({2 * need, most, all});
        std::shared_ptr<const Holder> holder = Keep::instance().get<Holder>(bricks, key, make(slots));
        validity = validity || holder->validity;
        if (holder->atlas->slots() < need || holder->validity != validity) {
            Keep::instance().drop(bricks, key);
            holder.reset();
            holder = Keep::instance().get<Holder>(bricks, key, make(slots));
            if (holder->atlas->slots() < need)
                fail("this picture needs {} bricks of {} each, but one texture of this OpenGL driver holds {}; select "
                     "fewer bricks", need, human_bytes(double(each)), holder->atlas->slots());
        }
        const std::uint64_t families = BrickCache::global().counters().families_decoded;
        const Atlas::Counters c = holder->atlas->load(bricks, wanted, ev.stop(), [&](double f) {
            ev.progress(0.1 + 0.6 * f, "decoding and uploading bricks");
        });
        ev.count("bricks resident", double(c.hits));
        ev.count("bricks uploaded", double(c.uploaded));
        ev.count("bricks evicted", double(c.evicted));
        ev.count("bytes uploaded", double(c.bytes));
        ev.count("families decoded", double(BrickCache::global().counters().families_decoded - families));
        if (!c.found_invalid || validity || desc.volume.color) return holder->atlas;
        validity = true;  // seen for the first time: all texels get a channel for it
        Keep::instance().drop(bricks, key);
    }
}

// Planes between two slices of a level: its spacing over the finest one's, down to a power of two.
int step_of(const BricksDesc& desc, int level) {
    const glm::dvec3 s = desc.volume.spacing(), c = s * glm::dvec3(desc.levels[std::size_t(level)].stride);
    const double ratio = std::min({c.x, c.y, c.z}) / std::min({s.x, s.y, s.z});
    return ratio >= 2 ? 1 << std::min(int(std::log2(ratio * (1 + 1e-9))), 12) : 1;
}

gpu::TexturePtr page_table(const BricksDesc& desc, const std::vector<Page>& pages, const Atlas& atlas) {
    constexpr int kTexels = 10, kColumn = 4096;
    const int columns = int((pages.size() + kColumn - 1) / kColumn);
    const glm::ivec3 dims(kTexels * columns, std::min<std::size_t>(pages.size(), kColumn), 1);
    std::vector<glm::vec4> texels(std::size_t(dims.x) * std::size_t(dims.y), glm::vec4(0.0f));
    for (std::size_t i = 0; i < pages.size(); ++i) {
        const Page& p = pages[i];
        glm::vec4* t = texels.data() + (i % kColumn) * std::size_t(dims.x) + (i / kColumn) * kTexels;
        const glm::ivec3 stride = desc.levels[std::size_t(p.brick.level)].stride;
        const int step = step_of(desc, p.brick.level);
        // A cell at the volume's border reaches beyond it: there the ray ends.
        glm::vec3 lo(p.cell.lo), hi(p.cell.hi);
        for (int a = 0; a < 3; ++a) {
            if (p.cell.lo[a] == 0) lo[a] = -1e6f;
            if (p.cell.hi[a] >= desc.volume.dims[a]) hi[a] = 1e9f;
        }
        t[0] = glm::vec4(lo, float(step));
        t[1] = glm::vec4(hi, std::log2(float(step)));
        t[2] = glm::vec4(glm::vec3(p.brick.index * desc.brick * stride), p.parent ? 1.0f : 0.0f);
        t[3] = glm::vec4(glm::vec3(atlas.texel_of(p.brick)), float(p.brick.level));
        t[4] = glm::vec4(1.0f / glm::vec3(stride), 0.0f);
        if (!p.parent) continue;
        const glm::ivec3 coarse = desc.levels[std::size_t(p.parent->level)].stride;
        t[5] = glm::vec4(glm::vec3(atlas.texel_of(*p.parent)), 0.0f);
        // Where in the parent, in its voxels, the brick begins.
        t[6] = glm::vec4(glm::vec3((p.brick.index * stride - p.parent->index * coarse) * desc.brick) / glm::vec3(coarse), 0.0f);
        t[7] = glm::vec4(1.0f / glm::vec3(coarse), 0.0f);
        for (int c = 0; c < 4; ++c) {
            t[8][c] = p.blend[std::size_t(c)];
            t[9][c] = p.blend[std::size_t(c) + 4];
        }
    }
    auto texture = std::make_shared<gpu::Texture>(
        gpu::make_texture(GL_TEXTURE_2D, GL_RGBA32F, dims, GL_NEAREST, "the table of bricks"));
    gpu::upload(*texture, {0, 0, 0}, dims, GL_RGBA, GL_FLOAT, texels.data());
    return texture;
}

// Calls f(linear index) for the cells of `size` that a box of voxels of level 0 meets.
template <class F>
void for_each_cell(const Box& box, glm::i64vec3 size, glm::ivec3 grid, const F& f) {
    const glm::i64vec3 lo = box.lo / size;
    const glm::i64vec3 hi = glm::min((box.hi - Index3(1)) / size, glm::i64vec3(grid) - Index3(1));
    for (std::int64_t z = lo.z; z <= hi.z; ++z)
        for (std::int64_t y = lo.y; y <= hi.y; ++y)
            for (std::int64_t x = lo.x; x <= hi.x; ++x) f(std::size_t((z * grid.y + y) * grid.x + x));
}

glm::ivec3 grid_over(Index3 dims, glm::i64vec3 size) { return glm::ivec3((dims + size - Index3(1)) / size); }

gpu::TexturePtr page_index(const std::vector<Page>& pages, glm::i64vec3 cell, glm::ivec3 grid) {
    std::vector<float> index(std::size_t(grid.x) * std::size_t(grid.y) * std::size_t(grid.z), -1.0f);
    for (std::size_t i = 0; i < pages.size(); ++i)
        for_each_cell(pages[i].cell, cell, grid, [&](std::size_t c) { index[c] = float(i); });
    auto texture = std::make_shared<gpu::Texture>(
        gpu::make_texture(GL_TEXTURE_3D, GL_R32F, grid, GL_NEAREST, "the cells of the bricks"));
    gpu::upload(*texture, {0, 0, 0}, grid, GL_RED, GL_FLOAT, index.data());
    return texture;
}

// Which blocks of space can be seen, in the bricks that are drawn there.
void find_occupancy(const BricksDesc& desc, const std::vector<Page>& pages, const Atlas& atlas,
                    const BrickRequest& request, BrickScene& scene) {
    const double least = scene.range.min;
    // The finest page's blocks, coarser where there would be too many to leap between.
    constexpr double kMostBlocks = 1 << 19;
    int finest = int(desc.levels.size()) - 1;
    for (const Page& p : pages) finest = std::min(finest, p.brick.level);
    glm::i64vec3 size = glm::i64vec3(atlas.block()) * glm::i64vec3(desc.levels[std::size_t(finest)].stride);
    glm::ivec3 grid = grid_over(desc.volume.dims, size);
    while (double(grid.x) * double(grid.y) * double(grid.z) > kMostBlocks) {
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
    scene.block_size = glm::vec3(size);
    scene.blocks = grid;
    scene.seen = std::size_t(std::ranges::count(seen, 1));
    if (scene.seen == 0) return;
    const std::vector<std::int8_t> distances = leaps(grid, seen);
    auto texture = std::make_shared<gpu::Texture>(
        gpu::make_texture(GL_TEXTURE_3D, GL_R8I, grid, GL_NEAREST, "the blocks of the bricks"));
    gpu::upload(*texture, {0, 0, 0}, grid, GL_RED_INTEGER, GL_BYTE, distances.data());
    scene.occupancy = texture;
}

}  // namespace

BrickScene prepare_bricks(const BricksPtr& bricks, const Selection* selection, const BrickRequest& request,
                          Evaluation& ev) {
    const BricksDesc& desc = bricks->desc();
    if (selection) check_selection(*selection, desc);
    BrickScene scene;
    scene.range = *Keep::instance().get<ValueRange>(bricks, Hasher().text("range").finish(), [&](std::uint64_t&) {
        return std::make_shared<ValueRange>(range_of_everything(*bricks, ev.stop()));
    });
    std::size_t transparent = 0;
    const std::vector<Page> pages = pages_of(*bricks, selection, scene.range.min, request, transparent);
    ev.count("pages drawn", double(pages.size()));
    ev.count("bricks skipped (transparent)", double(transparent));
    if (pages.empty()) return scene;
    const std::vector<BrickId> wanted = bricks_of(pages);
    ev.count("bricks drawn", double(wanted.size()));
    const std::shared_ptr<Atlas> atlas = load_atlas(bricks, wanted, scene.range, request, ev);

    find_occupancy(desc, pages, *atlas, request, scene);
    ev.count("blocks", double(scene.blocks.x) * double(scene.blocks.y) * double(scene.blocks.z));
    ev.count("blocks drawn", double(scene.seen));
    if (scene.seen == 0) return scene;

    glm::i64vec3 cell(std::numeric_limits<std::int64_t>::max());
    for (const Page& p : pages) {
        // Octants of a partly replaced brick are as large as the bricks of the next finer level.
        const bool whole = p.cell == desc.fine_box_of(p.brick) || p.brick.level == 0;
        const LevelDesc& level = desc.levels[std::size_t(whole ? p.brick.level : p.brick.level - 1)];
        cell = glm::min(cell, glm::i64vec3(desc.brick) * glm::i64vec3(level.stride));
        scene.blended = scene.blended || p.parent;
        scene.steps = std::max(scene.steps, 1 + int(std::log2(step_of(desc, p.brick.level))));
    }
    scene.cell_size = glm::vec3(cell);
    scene.cells = grid_over(desc.volume.dims, cell);
    scene.brick_size = glm::vec3(desc.brick);
    scene.slot_lo = glm::vec3(float(-request.apron.below));
    scene.slot_hi = glm::vec3(desc.brick + request.apron.above - 1);

    auto field = std::make_shared<gpu::FieldSource>();
    field->voxels.glsl = module("source-bricks");
    field->voxels.linear = true;
    field->voxels.color = desc.volume.color;
    field->voxels.has_validity = atlas->layout().validity;
    field->voxels.offset = atlas->layout().offset;
    field->voxels.scale = atlas->layout().scale;
    field->voxels.textures = {{"brick_atlas", atlas->texture()},
                              {"page_index", page_index(pages, cell, scene.cells)},
                              {"page_table", page_table(desc, pages, *atlas)}};
    scene.field = field;
    return scene;
}

void BrickScene::set(const gpu::Program& program) const {
    const gpu::Texture& atlas = *field->voxels.textures.front().texture;
    program.set("brick_inverse_dims", 1.0f / glm::vec3(atlas.dims));
    program.set("slot_lo", slot_lo);
    program.set("slot_hi", slot_hi);
    program.set("cell_size", cell_size);
    program.set("cell_last", cells - 1);
    program.set("brick_size", brick_size);
    program.set("table_layers", float(steps));
}

}  // namespace voxloom::slicer
