#include "plugins/codec-wavelet/parent_trend.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace voxloom::wavelet {

namespace {

// Sums wrap, for the sake of corrupt data; samples of the tree are far too small for that.
std::uint32_t bits(std::int32_t v) { return std::uint32_t(v); }
// What a straight line through b and then c has at the place after c.
std::int32_t onward(std::int32_t b, std::int32_t c) { return std::int32_t(2 * bits(c) - bits(b)); }
std::int32_t second_difference(std::int32_t a, std::int32_t b, std::int32_t c, std::int32_t d) {
    return std::int32_t(bits(a) - bits(b) - bits(c) + bits(d));
}
std::int32_t first_difference(std::int32_t b, std::int32_t c) {
    return c < b ? std::int32_t(bits(b) - bits(c)) : std::int32_t(bits(c) - bits(b));
}

}  // namespace

void ParentTrend::look_at(const Details& details) {
    for (int a = 0; a < 3; ++a)
        if (details.shape.halved[a]) differences(details, a);
}

// Lines go on straight beyond their ends.
void ParentTrend::differences(const Details& details, int axis) {
    const glm::ivec3 n = details.shape.low();
    const std::size_t width = std::size_t(n.x), plane = width * std::size_t(n.y);
    auto& second = second_[std::size_t(axis)];
    auto& first = first_[std::size_t(axis)];
    second.resize(plane * std::size_t(n.z));
    first.resize(second.size());
    before_.resize(width);
    after_.resize(width);
    for (int z = 0; z < n.z; ++z)
        for (int y = 0; y < n.y; ++y) {
            const std::size_t row = std::size_t(z) * plane + std::size_t(y) * width;
            const std::int32_t* const s = details.low + row;
            std::int32_t* const to2 = second.data() + row;
            std::int32_t* const to1 = first.data() + row;
            if (axis == 0) {
                const auto at = [&](int x) {
                    const std::int32_t b = s[x], c = x + 1 < n.x ? s[x + 1] : b;
                    to2[x] = second_difference(x > 0 ? s[x - 1] : onward(c, b), b, c, x + 2 < n.x ? s[x + 2] : onward(b, c));
                    to1[x] = first_difference(b, c);
                };
                at(0);
                for (int x = 1; x + 2 < n.x; ++x) {
                    to2[x] = second_difference(s[x - 1], s[x], s[x + 1], s[x + 2]);
                    to1[x] = first_difference(s[x], s[x + 1]);
                }
                for (int x = std::max(1, n.x - 2); x < n.x; ++x) at(x);
                continue;
            }
            const std::size_t stride = axis == 1 ? width : plane;
            const int at = axis == 1 ? y : z, last = n[axis] - 1;
            const std::int32_t* const c = at < last ? s + stride : s;
            const std::int32_t* const a = at > 0 ? s - stride : before_.data();
            const std::int32_t* const d = at + 2 <= last ? s + 2 * stride : after_.data();
            if (at == 0)
                for (int x = 0; x < n.x; ++x) before_[std::size_t(x)] = onward(c[x], s[x]);
            if (at + 2 > last)
                for (int x = 0; x < n.x; ++x) after_[std::size_t(x)] = onward(s[x], c[x]);
            for (int x = 0; x < n.x; ++x) {
                to2[x] = second_difference(a[x], s[x], c[x], d[x]);
                to1[x] = first_difference(s[x], c[x]);
            }
        }
}

void ParentTrend::look_at(const Details& details, const Band& band) {
    const glm::ivec3 n = details.shape.low();
    const std::size_t count = std::size_t(n.x) * std::size_t(n.y) * std::size_t(n.z);
    curve.assign(count, 0);
    slope.assign(count, 0);
    foretold.assign(count, 0);
    // All of it is exact in double, where it vectorises.
    constexpr double most = 1 << 24;
    const double scale = std::floor(65536.0 * 8 / std::max(1.0, details.step[std::size_t(band.mask)])) / 65536;
    const auto scaled = [=](std::int32_t v) {
        return std::int32_t(std::clamp(v * scale, -most, most) + most) - std::int32_t(most);
    };
    for (int a = 0; a < 3; ++a) {
        if (!(band.mask >> a & 1) || !details.shape.halved[a]) continue;
        const std::int32_t* const second = second_[std::size_t(a)].data();
        const std::int32_t* const first = first_[std::size_t(a)].data();
        std::int32_t* const to_curve = curve.data();
        std::int32_t* const to_slope = slope.data();
        std::int32_t* const to_foretold = foretold.data();
        for (std::size_t i = 0; i < count; ++i) {
            const std::int32_t c = scaled(second[i]);
            to_curve[i] += std::abs(c);
            to_slope[i] += scaled(first[i]);
            to_foretold[i] = -c;
        }
    }
}

}  // namespace voxloom::wavelet
