// What of a selection is drawn where: pages, which are boxes of space that one brick, or several side by
// side, fill; and their table, which a shader turns.
#pragma once

#include <algorithm>
#include <functional>
#include <optional>
#include <vector>

#include "core/data/selection.h"
#include "plugins/render-slicer/atlas.h"

namespace voxloom::slicer {

struct Page {
    BrickId brick;                // that is drawn; of merged pages the first one, and its level counts
    Box cell;                     // voxels of level 0
    int cell_level = 0;           // it is as large as a brick of this one
    CornerBlend blend{};
    std::optional<BrickId> parent = std::nullopt;  // where it blends and the shader is to mix; else its texels are mixed
    bool merged = false;          // of bricks that lie side by side in the texture too
};

// Whether anything with the values of a range is seen.
using IsVisible = std::function<bool(ValueRange)>;

// What of the selection (null: of everything at level 0) can be seen at all: bricks outside of what is
// visible cost nothing further. `transparent` counts them.
std::vector<Page> pages_of(const Bricks& bricks, const Selection* selection, const IsVisible& visible, std::size_t& transparent);
// The bricks that pages need, each once.
std::vector<WantedBrick> bricks_of(const std::vector<Page>& pages);

// Space as a grid of cells as large as the smallest page; a cell is drawn by one page, or none (-1).
struct PageGrid {
    glm::i64vec3 cell{1};         // voxels of level 0
    glm::ivec3 cells{0};
    std::vector<Page> pages;
    std::vector<std::int32_t> page;  // x fastest
    bool is_one_page() const { return pages.size() == 1 && pages.front().merged && std::ranges::count(page, -1) == 0; }
};
PageGrid grid_of(const BricksDesc& bricks, std::vector<Page> pages);
// Joins pages of a level that do not blend to boxes. What nothing is drawn of, and what nothing would be
// seen of, may be joined too: where `nothing_at` says so of a brick.
PageGrid merged(const BricksDesc& bricks, const PageGrid& grid, const std::function<bool(BrickId)>& nothing_at);

// Planes between two slices of a level: its spacing over the finest one's, down to a power of two.
int step_of(const BricksDesc& bricks, int level);

// What a shader knows of a page: source-bricks.glsl.
gpu::TexturePtr page_table(const BricksDesc& bricks, const PageGrid& grid, const Atlas& atlas);
gpu::TexturePtr page_index(const PageGrid& grid);

inline constexpr std::int64_t kMostBlocks = 1 << 19;  // to leap between
// Bytes that the tables of pages and cells take at most, with the blocks to leap between.
std::uint64_t table_bytes(const BricksDesc& bricks, const PageGrid& grid);

// Calls f(linear index) for the cells of `size` that a box of voxels of level 0 meets.
template <class F>
void for_each_cell(const Box& box, glm::i64vec3 size, glm::ivec3 grid, const F& f) {
    const glm::i64vec3 lo = box.lo / size;
    const glm::i64vec3 hi = glm::min((box.hi - Index3(1)) / size, glm::i64vec3(grid) - Index3(1));
    for (std::int64_t z = lo.z; z <= hi.z; ++z)
        for (std::int64_t y = lo.y; y <= hi.y; ++y)
            for (std::int64_t x = lo.x; x <= hi.x; ++x) f(std::size_t((z * grid.y + y) * grid.x + x));
}
inline glm::ivec3 grid_over(Index3 dims, glm::i64vec3 size) { return glm::ivec3((dims + size - Index3(1)) / size); }

}  // namespace voxloom::slicer
