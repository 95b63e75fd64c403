#include "plugins/codec-wavelet/lane_edges.h"

#include <algorithm>

namespace voxloom::wavelet {

void LaneEdges::start(const Details& d) {
    const glm::ivec3 n = d.shape.low();
    row_ = std::size_t(n.x) + 1;
    plane_ = row_ * std::size_t(n.y);
    nothing_.assign(row_ + 1, 0);
    const std::array<std::size_t, 3> next = {1, std::size_t(n.x), std::size_t(n.x) * std::size_t(n.y)};
    for (std::size_t a = 0; a < 3; ++a) {
        slopes_[a].assign(1 + plane_ * std::size_t(n.z), 0);  // one more before, for the left of the first
        const std::int32_t* low = d.low;
        std::uint32_t* to = slopes_[a].data() + 1;
        for (int z = 0; z < n.z; ++z)
            for (int y = 0; y < n.y; ++y, low += n.x, to += row_) {
                if ((a == 1 && y + 1 == n.y) || (a == 2 && z + 1 == n.z)) continue;
                const int count = n.x - (a == 0);
                for (int x = 0; x < count; ++x) to[x] = std::uint32_t(low[std::size_t(x) + next[a]]) - std::uint32_t(low[x]);
            }
    }
}

const std::uint8_t* LaneEdges::find(const Details& d, const LaneLayout& layout, int axis) {
    const glm::ivec3 n = d.shape.low();
    const Band band = d.shape.band(1 << axis);
    const auto a = std::size_t(axis);
    const std::size_t step = a == 0 ? 1 : a == 1 ? row_ : plane_;
    // The low band has all samples of an axis that is not halved, the others every second one.
    const glm::ivec3 every = glm::mix(glm::ivec3(1), glm::ivec3(2), d.shape.split);
    const float scale = float(1 / (4 * d.step[std::size_t(band.mask)]));
    edges_.resize(layout.places());
    layout.each_group(band, [&](int z, int panel, int row) {
        std::uint8_t* const group = edges_.data() + layout.at(z, panel, row);
        layout.each_strip(band, panel, row, [&](int lane, int x, int y, int count) {
            const glm::ivec3 p = glm::ivec3(x, y, z) * every;
            const std::size_t at = 1 + std::size_t(p.z) * plane_ + std::size_t(p.y) * row_ + std::size_t(p.x);
            const std::uint32_t* const own = slopes_[a].data() + at;
            EdgeRow slopes{own, own - 1, own + 1, slopes_[(a + 1) % 3].data() + at, slopes_[(a + 2) % 3].data() + at};
            if (axis > 0) {
                slopes.left = p[axis] > 0 ? own - step : nothing_.data();
                slopes.right = p[axis] + 1 < n[axis] ? own + step : nothing_.data();
            }
            find_edges(slopes, count, every.x, scale, group + lane);
        });
    });
    return edges_.data();
}

}  // namespace voxloom::wavelet
