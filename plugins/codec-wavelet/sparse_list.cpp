#include "plugins/codec-wavelet/sparse_list.h"

#include <array>

#include "core/base/error.h"

namespace voxloom::wavelet {

void write_sparse(const Details& d, BitWriter& bits) {
    struct Number {
        std::uint32_t gap;
        std::int32_t q;
    };
    std::vector<Number> numbers;
    std::uint64_t gaps = 0;
    std::uint32_t gap = 0;
    for_each_row(d, [&](const std::int32_t* q, std::size_t n) {
        for (std::size_t i = 0; i < n; ++i, ++gap)
            if (q[i] != 0) {
                numbers.push_back({gap, q[i]});
                gaps += gap;
                gap = ~0u;  // the next one's gap starts at 0
            }
    });
    const std::uint64_t mean = gaps / std::max<std::size_t>(numbers.size(), 1);
    const int low = mean > 0 ? std::bit_width(mean) - 1 : 0;
    bits.gamma(std::uint32_t(numbers.size()) + 1);
    bits.put(std::uint32_t(low), 5);
    for (const Number& number : numbers) {
        for (std::uint32_t i = 0; i < number.gap >> low; ++i) bits.put(1, 1);
        bits.put(0, 1);
        bits.put(number.gap & ((1u << low) - 1), low);
        bits.put(number.q < 0, 1);
        bits.gamma(number.q < 0 ? 0u - std::uint32_t(number.q) : std::uint32_t(number.q));
    }
}

void read_sparse(BitReader& bits, Details& d) {
    std::uint32_t left = bits.gamma() - 1;
    const int low = int(bits.get(5));
    std::uint64_t gap = 0;  // places to go to the next number
    const auto read_gap = [&] {
        gap = 0;
        while (bits.get(1)) gap += std::uint64_t(1) << low;
        gap += bits.get(low);
    };
    if (left > 0) read_gap();
    for_each_row(d, [&](std::int32_t* q, std::size_t n) {
        for (std::size_t i = 0; left > 0; ) {
            if (gap >= n - i) {
                gap -= n - i;
                return;
            }
            i += std::size_t(gap);
            const bool negative = bits.get(1);
            const std::uint32_t size = bits.gamma();
            q[i++] = std::int32_t(negative ? 0u - size : size);
            if (--left > 0) read_gap();
        }
    });
    if (left > 0) fail("a number stands beyond the end");
}

}  // namespace voxloom::wavelet
