// Where the numbers of a family stand in the fast coder: 32 side by side, in lanes that are decoded at once.
//
// All bands share one grid, that of the largest. A group holds 32 places of one slice: `width` neighbours along x,
// and as many strips of the y axis as make up 32. Groups that follow each other step along y, each lane within
// its strip, so the group before holds every lane's neighbour at y - 1, and the slice before that at
// z - 1: sizes of neighbours are loads, never shuffles. A grid wider than 32 has several panels a slice.
#pragma once

#include <algorithm>
#include <bit>

#include "plugins/codec-wavelet/family.h"
#include "plugins/codec-wavelet/lane_kernels.h"

namespace voxloom::wavelet {

struct LaneLayout {
    glm::ivec3 grid{0};
    int width = 1;
    int rows = 1;    // groups of a panel
    int panels = 1;

    LaneLayout() = default;
    explicit LaneLayout(const Shape& shape)
        : grid(low_dims(shape.dims, glm::bvec3(glm::ivec3(shape.halved) | glm::ivec3(shape.split)))),
          width(std::min(kLanes, int(std::bit_ceil(unsigned(grid.x))))), rows((grid.y + strips() - 1) / strips()),
          panels((grid.x + width - 1) / width) {}
    friend bool operator==(const LaneLayout&, const LaneLayout&) = default;

    int strips() const { return kLanes / width; }
    // Panels have an empty group before and after, and an empty slice before all, so that no neighbour
    // needs a test. Places of the lanes of one group are consecutive.
    std::size_t panel_places() const { return std::size_t(rows + 2) * kLanes; }
    std::size_t slice_places() const { return std::size_t(panels) * panel_places(); }
    std::size_t places() const { return std::size_t(grid.z + 1) * slice_places(); }
    std::size_t at(int z, int panel, int row) const {
        return std::size_t(z + 1) * slice_places() + std::size_t(panel) * panel_places() + std::size_t(row + 1) * kLanes;
    }
    std::size_t groups(const Band& band) const { return std::size_t(band.dims.z) * std::size_t(panels) * std::size_t(rows); }
    bool fills(const Band& band) const { return band.dims.x == width * panels && band.dims.y == rows * strips(); }

    // Calls use(first lane, x, y, count) for the strips of a group that the band has.
    template <class Use>
    void each_strip(const Band& band, int panel, int row, const Use& use) const {
        const int x = panel * width, count = std::min(width, band.dims.x - x);
        if (count <= 0) return;
        for (int lane = 0, y = row; lane < kLanes && y < band.dims.y; lane += width, y += rows) use(lane, x, y, count);
    }
    // Calls use(z, panel, row) for all groups of a band, in the order in which they are coded.
    template <class Use>
    void each_group(const Band& band, const Use& use) const {
        for (int z = 0; z < band.dims.z; ++z)
            for (int panel = 0; panel < panels; ++panel)
                for (int row = 0; row < rows; ++row) use(z, panel, row);
    }
};

}  // namespace voxloom::wavelet
