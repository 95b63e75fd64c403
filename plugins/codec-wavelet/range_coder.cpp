#include "plugins/codec-wavelet/range_coder.h"

#include <cmath>

namespace voxloom::wavelet {

Logistic::Logistic() {
    // 65536 / (1 + exp(-x)) at x = -8, -7.5, ... 8, linear between: tables made of integers are the
    // same everywhere, std::exp is not.
    constexpr int kAt[33] = {22,    36,    60,    98,    162,   267,   439,   720,   1179,  1921,  3108,
                             4971,  7812,  11955, 17625, 24743, 32768, 40793, 47911, 53581, 57724, 60565,
                             62428, 63615, 64357, 64816, 65097, 65269, 65374, 65438, 65476, 65500, 65514};
    for (int x = -2048; x < 2048; ++x) {
        const int cell = (x + 2048) >> 7, part = (x + 2048) & 127;
        squashed[std::size_t(x + 2048)] = std::uint16_t((kAt[cell] * (128 - part) + kAt[cell + 1] * part) >> 7);
    }
    int next = 0;
    for (int x = -2047; x <= 2047; ++x)
        for (const int p = squashed[std::size_t(x + 2048)] >> 4; next <= p; ++next)
            stretched[std::size_t(next)] = std::int16_t(x);
    while (next < 4096) stretched[std::size_t(next++)] = 2047;
}

const Logistic kLogistic;

bool RangeCounter::code(bool bit, std::uint32_t p1) {
    static const std::array<float, 4096> kBits = [] {
        std::array<float, 4096> bits{};
        for (int i = 0; i < 4096; ++i) bits[std::size_t(i)] = float(-std::log2((i + 0.5) / 4096));
        return bits;
    }();
    bits_ += double(kBits[(bit ? p1 : 65536 - p1) * 4095 / 65536]);
    return bit;
}

const std::array<int, 1024> Chance::kRate = [] {
    std::array<int, 1024> rate{};
    for (int i = 0; i < 1024; ++i) rate[std::size_t(i)] = 131072 / (2 * i + 3);
    return rate;
}();

}  // namespace voxloom::wavelet
