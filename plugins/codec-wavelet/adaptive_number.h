// Unsigned numbers of any size, small ones cheap, by a range coder that learns their lengths.
#pragma once

#include <array>
#include <bit>

#include "core/base/error.h"
#include "plugins/codec-wavelet/range_coder.h"

namespace voxloom::wavelet {

// A number's length in bits goes through an adaptive tree chosen by the context, the two
// bits below the leading one are adaptive, too, the others stand as they are.
class AdaptiveNumber {
  public:
    // The last number's length is the context.
    template <class Coding, class Key>
    Key code(Coding& coding, Key number) {
        const Key got = code(coding, number, last_);
        last_ = std::bit_width(got);
        return got;
    }
    // Returns what was coded; `number` is not looked at by a decoder. Contexts are 0 to 64.
    template <class Coding, class Key>
    Key code(Coding& coding, Key number, int context) {
        const int bits = Coding::kDecodes ? 0 : std::bit_width(number);
        unsigned node = 1;
        for (int i = 6; i >= 0; --i)
            node = node << 1 | unsigned(one(coding, length_[std::size_t(context)][node], bits >> i & 1));
        const int got = int(node) - 128;
        if (got > int(8 * sizeof(Key))) fail("a number is out of range");
        if (got == 0) return 0;
        Key value = 1;
        for (int i = got - 2; i >= 0; --i) {
            const bool bit = number >> i & 1;
            const int depth = got - 2 - i;
            const std::size_t above = depth ? 1 + std::size_t(value & 1) : 0;
            const bool b = depth < 2 ? one(coding, top_[std::size_t(got)][above], bit) : coding.code(bit, 32768);
            value = Key(Key(value << 1) | Key(b));
        }
        return value;
    }

  private:
    template <class Coding>
    static bool one(Coding& coding, Chance& chance, bool bit) {
        const std::uint32_t p = chance.p < 24 ? 24 : chance.p > 65512 ? 65512 : chance.p;
        bit = coding.code(bit, p);
        chance.learn(bit, 100);
        return bit;
    }
    std::array<std::array<Chance, 128>, 65> length_;
    std::array<std::array<Chance, 3>, 65> top_;
    int last_ = 0;
};

}  // namespace voxloom::wavelet
