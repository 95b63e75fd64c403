// What a pass of the fast coder over a family needs beside its details: sizes of what is coded already, and arrays.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <vector>

#include "plugins/codec-wavelet/lane_edges.h"
#include "plugins/codec-wavelet/lane_kernels.h"
#include "plugins/codec-wavelet/lane_layout.h"

namespace voxloom::wavelet {

// Bands already coded whose sizes tell of a band's, and how much each neighbour does: fitted by least squares to two
// CT scans at 40 and 50 dB and without loss.
struct BandRole {
    int first, second;
    ContextWeights weights;
};
inline constexpr std::array<BandRole, 8> kBandRoles = {{
    {},
    {0, 0, {12, 3, 18, 2, 4, 0, 0, 6}},
    {1, 0, {7, 3, 17, 4, 1, 4, 0, 6}},
    {1, 2, {6, 3, 19, 2, 2, 5, 7, 0}},
    {1, 2, {15, 6, 5, 2, 1, 2, 3, 6}},
    {1, 4, {18, 4, 8, 2, 2, 3, 4, 0}},
    {2, 4, {10, 6, 9, 3, 2, 4, 4, 0}},
    {3, 5, {9, 4, 8, 2, 2, 4, 7, 0}},
}};

// What a pass over a family needs beside its details. Each thread keeps one, since to get it anew would cost more
// than to use it.
class LaneWorkspace {
  public:
    void start(const Details& d) {
        const LaneLayout layout(d.shape);
        if (layout != layout_) {
            layout_ = layout;
            for (auto& sizes : sizes_) sizes.assign(layout.places(), 0);
            nothing_.assign(layout.places(), 0);
        }
        edges_.start(d);
        coded_ = {};
    }
    const LaneLayout& layout() const { return layout_; }

    // A band's groups alone. `tokens_of_band` are layout().groups() times 32.
    BandPass groups(const Band& band, int base, std::uint8_t* tokens_of_band) {
        BandPass pass;
        pass.slices = band.dims.z;
        pass.panels = layout_.panels;
        pass.rows = layout_.rows;
        pass.active = active_lanes(band);
        pass.tokens = tokens_of_band;
        pass.base = base;
        return pass;
    }
    // And what the contexts of its numbers look at. Bands come in the order of kBandOrder.
    BandPass pass(const Details& d, const Band& band, int base, std::uint8_t* tokens_of_band) {
        const BandRole& role = kBandRoles[std::size_t(band.mask)];
        const std::size_t origin = layout_.at(0, 0, 0);
        auto& sizes = sizes_[std::size_t(band.mask)];
        // A smaller band leaves no sizes of another family where a larger one looks.
        std::fill(sizes.begin() + std::ptrdiff_t(layout_.at(band.dims.z - 1, 0, -1) + layout_.slice_places()), sizes.end(), std::uint8_t(0));
        const auto of = [&](int mask) { return (coded_[std::size_t(mask)] ? sizes_[std::size_t(mask)] : nothing_).data() + origin; };
        BandPass pass = groups(band, base, tokens_of_band);
        pass.panel_places = std::ptrdiff_t(layout_.panel_places());
        pass.slice_places = std::ptrdiff_t(layout_.slice_places());
        pass.sizes = sizes.data() + origin;
        pass.first = of(role.first);
        pass.second = of(role.second);
        pass.edge = role.weights.edge ? edges_.find(d, layout_, std::countr_zero(unsigned(band.mask))) + origin : nothing_.data() + origin;
        pass.weights = role.weights;
        coded_[std::size_t(band.mask)] = true;
        return pass;
    }

    std::vector<std::uint8_t> tokens, contexts, raw;
    std::vector<std::uint16_t> words;
    std::vector<std::int32_t> numbers;

    // 255 for each lane of the groups of a slice that the band has; null: all of them.
    const std::uint8_t* active_lanes(const Band& band) {
        if (layout_.fills(band)) return nullptr;
        active_.assign(std::size_t(layout_.panels) * std::size_t(layout_.rows) * kLanes, 0);
        for (int panel = 0; panel < layout_.panels; ++panel)
            for (int row = 0; row < layout_.rows; ++row)
                layout_.each_strip(band, panel, row, [&](int lane, int, int, int count) {
                    std::fill_n(active_.begin() + (panel * layout_.rows + row) * kLanes + lane, count, std::uint8_t(255));
                });
        return active_.data();
    }

  private:
    LaneLayout layout_;
    std::array<std::vector<std::uint8_t>, 8> sizes_;
    std::vector<std::uint8_t> nothing_, active_;
    LaneEdges edges_;
    std::array<bool, 8> coded_{};
};


}  // namespace voxloom::wavelet
