// Loops run along the rows of a band, over as many blocks as stand side by side, so that wide registers are full: block
// by block the same took five times as long.
#include "plugins/codec-wavelet/quantiser.h"

#include <algorithm>
#include <cmath>

#include "core/base/wide.h"

namespace voxloom::wavelet {

namespace {

// Rows that share blocks: `slices` times `rows` of them, `count` numbers each.
struct Strip {
    std::int32_t* q;
    std::size_t row_stride, slice_stride;
    int rows, slices;
    std::size_t count;
};

// Selections among doubles, so that compilers make vectors of them.
inline std::int32_t size_of(std::int32_t c, double scale, double zone) {
    const double size = std::abs(double(c)) * scale;
    const double up = size + kRoundUp < 1 ? 1 : size + kRoundUp;
    return std::int32_t(size < zone ? 0 : up);
}

// Sums of the numbers of each column, as far as it matters. False where all are zero.
VOXLOOM_WIDE bool add_columns(const Strip& s, double scale, std::int32_t* __restrict sums) {
    std::fill_n(sums, s.count, 0);
    for (int z = 0; z < s.slices; ++z)
        for (int y = 0; y < s.rows; ++y) {
            const std::int32_t* __restrict q = s.q + std::size_t(z) * s.slice_stride + std::size_t(y) * s.row_stride;
            for (std::size_t x = 0; x < s.count; ++x) {
                const std::int32_t number = size_of(q[x], scale, kDeadZone);
                sums[x] += number < 8 ? number : 8;
            }
        }
    std::int32_t any = 0;
    for (std::size_t x = 0; x < s.count; ++x) any |= sums[x];
    return any != 0;
}

VOXLOOM_WIDE void quantise_rows(const Strip& s, double scale, const double* __restrict zones) {
    for (int z = 0; z < s.slices; ++z)
        for (int y = 0; y < s.rows; ++y) {
            std::int32_t* __restrict q = s.q + std::size_t(z) * s.slice_stride + std::size_t(y) * s.row_stride;
            for (std::size_t x = 0; x < s.count; ++x) {
                const std::int32_t number = size_of(q[x], scale, zones[x]);
                q[x] = q[x] < 0 ? -number : number;
            }
        }
}

VOXLOOM_WIDE void dequantise_row(std::int32_t* q, std::size_t count, double step, double one, double more) {
    for (std::size_t x = 0; x < count; ++x) {
        const double magnitude = std::abs(double(q[x]));
        double size = magnitude * step + (magnitude == 1 ? one : more);
        size = size < 2147483647.0 ? size : 2147483647.0;
        const std::int32_t value = std::int32_t(magnitude == 0 ? 0 : size);
        q[x] = q[x] < 0 ? -value : value;
    }
}

double zone_of(std::int32_t sum) {
    return sum == 1 ? kDeadZoneOfOne : sum == 2 ? kDeadZoneOfTwo : sum > 0 && sum <= 4 ? kDeadZoneOfFour : kDeadZone;
}

void quantise_band(Details& d, const Band& band, double scale) {
    const auto cuts_along = [&](int a) {
        const bool low = !(band.mask >> a & 1);
        return cuts(band.dims[a], low && d.shape.shared.lo[a], low && d.shape.shared.hi[a], kQuantBlock);
    };
    const auto x = cuts_along(0), y = cuts_along(1), z = cuts_along(2);
    const auto count = std::size_t(band.dims.x);
    thread_local std::vector<std::int32_t> sums;
    thread_local std::vector<double> zones;
    sums.resize(count);
    zones.resize(count);
    for (std::size_t k = 0; k + 1 < z.size(); ++k)
        for (std::size_t j = 0; j + 1 < y.size(); ++j) {
            const Strip strip{d.q + d.shape.at(band.lo + glm::ivec3(0, y[j], z[k])), std::size_t(d.shape.dims.x),
                              std::size_t(d.shape.dims.x) * std::size_t(d.shape.dims.y), y[j + 1] - y[j], z[k + 1] - z[k], count};
            if (!add_columns(strip, scale, sums.data())) {
                for (int s = 0; s < strip.slices; ++s)
                    for (int r = 0; r < strip.rows; ++r)
                        std::fill_n(strip.q + std::size_t(s) * strip.slice_stride + std::size_t(r) * strip.row_stride, count, 0);
                continue;
            }
            for (std::size_t i = 0; i + 1 < x.size(); ++i) {
                std::int32_t sum = 0;
                for (int c = x[i]; c < x[i + 1]; ++c) sum += sums[std::size_t(c)];
                std::fill(zones.begin() + x[i], zones.begin() + x[i + 1], zone_of(sum));
            }
            quantise_rows(strip, scale, zones.data());
        }
}

}  // namespace

void quantise(Details& d, const Quantiser& quantiser) {
    if (quantiser.threshold > 0)
        for_each_row(d, [&](std::int32_t* q, std::size_t n) {
            for (std::size_t x = 0; x < n; ++x)
                if (std::abs(double(q[x])) < quantiser.threshold) q[x] = 0;
        });
    for (const int mask : kBandOrder) {
        const Band band = d.shape.band(mask);
        const double scale = 1 / d.step[std::size_t(mask)];
        if (d.shape.has(band) && scale < 1) quantise_band(d, band, scale);
    }
}

void dequantise(Details& d, const Quantiser& quantiser) {
    for (const int mask : kBandOrder) {
        const double step = d.step[std::size_t(mask)];
        if (step <= 1) continue;
        const double one = quantiser.centre_one * step + 0.5, more = quantiser.centre_more * step + 0.5;
        for_each_row(d, d.shape.band(mask), [&](std::int32_t* q, std::size_t n) {
            std::int32_t any = 0;  // most rows are empty
            for (std::size_t x = 0; x < n; ++x) any |= q[x];
            if (any != 0) dequantise_row(q, n, step, one, more);
        });
    }
}

}  // namespace voxloom::wavelet
