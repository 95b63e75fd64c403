#include "plugins/render-slicer/pages.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>
#include <unordered_set>

namespace voxloom::slicer {

std::vector<Page> pages_of(const Bricks& bricks, const Selection* selection, const IsVisible& visible, std::size_t& transparent) {
    const BricksDesc& desc = bricks.desc();
    std::vector<Page> pages;
    auto add = [&](const SelectedBrick& b) {
        const bool blends = std::ranges::any_of(b.corner_blend, [](float r) { return r > 0; });
        const std::optional<BrickId> parent = blends ? desc.coarser(b.id) : std::nullopt;
        const CornerBlend blend = parent ? b.corner_blend : CornerBlend{};
        ValueRange range = bricks.info(b.id).range;
        if (parent) {
            const ValueRange coarse = bricks.info(*parent).range;
            range = {std::min(range.min, coarse.min), std::max(range.max, coarse.max)};
        }
        if (!visible(range)) {
            ++transparent;
            return;
        }
        if (b.octants == 0xff || b.id.level == 0) {
            pages.push_back({b.id, desc.fine_box_of(b.id), b.id.level, blend, parent});
            return;
        }
        for (int o = 0; o < 8; ++o)
            if (b.octants >> o & 1)
                if (const Box cell = fine_box_of_octant(desc, b.id, o); !cell.empty())
                    pages.push_back({b.id, cell, b.id.level - 1, blend, parent});
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

std::vector<WantedBrick> bricks_of(const std::vector<Page>& pages) {
    std::vector<WantedBrick> all;
    std::unordered_set<BrickId, HashOfBrickId> known;
    auto add = [&](const WantedBrick& brick) {
        if (known.insert(brick.id).second) all.push_back(brick);
    };
    for (const Page& p : pages) {
        if (p.parent) {
            add({p.brick});
            add({*p.parent});
        } else {
            add({p.brick, p.blend});
        }
    }
    return all;
}

PageGrid grid_of(const BricksDesc& desc, std::vector<Page> pages) {
    PageGrid grid;
    grid.cell = glm::i64vec3(std::numeric_limits<std::int64_t>::max());
    for (const Page& p : pages) {
        const LevelDesc& level = desc.levels[std::size_t(p.cell_level)];
        grid.cell = glm::min(grid.cell, glm::i64vec3(desc.brick) * glm::i64vec3(level.stride));
    }
    grid.cells = grid_over(desc.volume.dims, grid.cell);
    grid.page.assign(std::size_t(grid.cells.x) * std::size_t(grid.cells.y) * std::size_t(grid.cells.z), -1);
    for (std::size_t i = 0; i < pages.size(); ++i)
        for_each_cell(pages[i].cell, grid.cell, grid.cells, [&](std::size_t c) { grid.page[c] = std::int32_t(i); });
    grid.pages = std::move(pages);
    return grid;
}

namespace {

constexpr int kBlends = -1, kNothing = -2, kDone = -3;

// The level that each cell is drawn at, or why it is not joined with others.
std::vector<int> levels_of(const BricksDesc& desc, const PageGrid& grid, const std::function<bool(BrickId)>& nothing_at) {
    std::vector<int> level;
    std::vector<std::int64_t> count(desc.levels.size(), 0);
    for (const std::int32_t page : grid.page) {
        const Page* p = page < 0 ? nullptr : &grid.pages[std::size_t(page)];
        level.push_back(!p ? kNothing : p->parent ? kBlends : p->brick.level);
        if (level.back() >= 0) ++count[std::size_t(level.back())];
    }
    // What nothing is seen of counts as one more cell of the level that most cells are of.
    const int most = int(std::ranges::max_element(count) - count.begin());
    if (count[std::size_t(most)] == 0) return level;
    const Index3 size = Index3(desc.brick) * Index3(desc.levels[std::size_t(most)].stride);
    std::map<std::tuple<int, int, int>, bool> known;
    std::size_t c = 0;
    for (int z = 0; z < grid.cells.z; ++z)
        for (int y = 0; y < grid.cells.y; ++y)
            for (int x = 0; x < grid.cells.x; ++x, ++c) {
                if (level[c] != kNothing) continue;
                const glm::ivec3 at(Index3(x, y, z) * Index3(grid.cell) / size);
                const auto [it, is_new] = known.try_emplace({at.x, at.y, at.z}, false);
                if (is_new) it->second = nothing_at({most, at});
                if (it->second) level[c] = most;
            }
    return level;
}

}  // namespace

PageGrid merged(const BricksDesc& desc, const PageGrid& grid, const std::function<bool(BrickId)>& nothing_at) {
    PageGrid out{.cell = grid.cell, .cells = grid.cells, .pages = {}, .page = grid.page};
    std::vector<int> level = levels_of(desc, grid, nothing_at);
    const glm::ivec3 n = grid.cells;
    auto at = [&](glm::ivec3 p) { return (std::size_t(p.z) * std::size_t(n.y) + std::size_t(p.y)) * std::size_t(n.x) + std::size_t(p.x); };
    std::vector<std::int32_t> renumbered(grid.pages.size(), -1);
    for (int z = 0; z < n.z; ++z)
        for (int y = 0; y < n.y; ++y)
            for (int x = 0; x < n.x; ++x) {
                const glm::ivec3 lo(x, y, z);
                const int l = level[at(lo)];
                if (l == kBlends) {
                    std::int32_t& page = renumbered[std::size_t(grid.page[at(lo)])];
                    if (page < 0) {
                        page = std::int32_t(out.pages.size());
                        out.pages.push_back(grid.pages[std::size_t(grid.page[at(lo)])]);
                    }
                    out.page[at(lo)] = page;
                }
                if (l < 0) continue;
                // As far along x as the level goes, then as many such rows, then as many such layers.
                glm::ivec3 hi = lo + 1;
                for (int a = 0; a < 3; ++a)
                    for (bool grows = true; grows && hi[a] < n[a]; hi[a] += grows) {
                        glm::ivec3 from = lo, to = hi;
                        from[a] = hi[a];
                        to[a] = hi[a] + 1;
                        for (int k = from.z; k < to.z; ++k)
                            for (int j = from.y; j < to.y; ++j)
                                for (int i = from.x; i < to.x; ++i) grows = grows && level[at({i, j, k})] == l;
                    }
                const Index3 size = Index3(desc.brick) * Index3(desc.levels[std::size_t(l)].stride);
                Page page;
                page.cell = intersect({Index3(lo) * Index3(grid.cell), Index3(hi) * Index3(grid.cell)}, Box::of(desc.volume.dims));
                page.brick = {l, glm::ivec3(page.cell.lo / size)};
                page.merged = true;
                for (int k = lo.z; k < hi.z; ++k)
                    for (int j = lo.y; j < hi.y; ++j)
                        for (int i = lo.x; i < hi.x; ++i) {
                            level[at({i, j, k})] = kDone;
                            out.page[at({i, j, k})] = std::int32_t(out.pages.size());
                        }
                out.pages.push_back(page);
            }
    return out;
}

int step_of(const BricksDesc& desc, int level) {
    const glm::dvec3 s = desc.volume.spacing(), c = s * glm::dvec3(desc.levels[std::size_t(level)].stride);
    const double ratio = std::min({c.x, c.y, c.z}) / std::min({s.x, s.y, s.z});
    return ratio >= 2 ? 1 << std::min(int(std::log2(ratio * (1 + 1e-9))), 12) : 1;
}

namespace {

constexpr int kTexels = 12, kColumn = 4096;
glm::ivec3 table_dims(std::size_t pages) {
    return {kTexels * int((pages + kColumn - 1) / kColumn), std::min<std::size_t>(pages, kColumn), 1};
}

}  // namespace

std::uint64_t table_bytes(const BricksDesc& bricks, const PageGrid& grid) {
    const glm::ivec3 dims = table_dims(grid.pages.size());
    std::uint64_t blocks = grid.page.size();  // as Atlas::block() cuts bricks
    for (int a = 0; a < 3; ++a) blocks *= std::uint64_t(bricks.brick[a] % 4 == 0 ? bricks.brick[a] / 4 : 1);
    return std::uint64_t(dims.x) * std::uint64_t(dims.y) * sizeof(glm::vec4) + grid.page.size() * sizeof(float) +
           std::min(blocks, std::uint64_t(kMostBlocks));
}

gpu::TexturePtr page_table(const BricksDesc& desc, const PageGrid& grid, const Atlas& atlas) {
    const std::vector<Page>& pages = grid.pages;
    const glm::ivec3 dims = table_dims(pages.size());
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
        // Voxels that the page's bricks have in the texture, from its first one on.
        glm::ivec3 voxels = desc.brick;
        if (p.merged) {
            const Index3 size = Index3(desc.brick) * Index3(stride);
            voxels = (glm::ivec3((p.cell.hi + size - Index3(1)) / size) - p.brick.index) * desc.brick;
        }
        t[0] = glm::vec4(lo, float(step));
        t[1] = glm::vec4(hi, std::log2(float(step)));
        t[2] = glm::vec4(glm::vec3(p.brick.index * desc.brick * stride), p.parent ? 1.0f : 0.0f);
        t[3] = glm::vec4(glm::vec3(atlas.texel_of(p.brick)), float(p.brick.level));
        t[4] = glm::vec4(1.0f / glm::vec3(stride), 0.0f);
        t[5] = glm::vec4(glm::vec3(voxels + atlas.apron().above - 1), 0.0f);
        if (!p.parent) {  // looked up all the same, with no share
            t[6] = t[3];
            t[8] = t[4];
            continue;
        }
        const glm::ivec3 coarse = desc.levels[std::size_t(p.parent->level)].stride;
        t[6] = glm::vec4(glm::vec3(atlas.texel_of(*p.parent)), 0.0f);
        // Where in the parent, in its voxels, the brick begins.
        t[7] = glm::vec4(glm::vec3((p.brick.index * stride - p.parent->index * coarse) * desc.brick) / glm::vec3(coarse), 0.0f);
        t[8] = glm::vec4(1.0f / glm::vec3(coarse), 0.0f);
        for (int c = 0; c < 4; ++c) {
            t[9][c] = p.blend[std::size_t(c)];
            t[10][c] = p.blend[std::size_t(c) + 4];
        }
    }
    auto texture = std::make_shared<gpu::Texture>(
        gpu::make_texture(GL_TEXTURE_2D, GL_RGBA32F, dims, GL_NEAREST, "the table of bricks"));
    gpu::upload(*texture, {0, 0, 0}, dims, GL_RGBA, GL_FLOAT, texels.data());
    return texture;
}

gpu::TexturePtr page_index(const PageGrid& grid) {
    const std::vector<float> index(grid.page.begin(), grid.page.end());
    auto texture = std::make_shared<gpu::Texture>(
        gpu::make_texture(GL_TEXTURE_3D, GL_R32F, grid.cells, GL_NEAREST, "the cells of the bricks"));
    gpu::upload(*texture, {0, 0, 0}, grid.cells, GL_RED, GL_FLOAT, index.data());
    return texture;
}

}  // namespace voxloom::slicer
