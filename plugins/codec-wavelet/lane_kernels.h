// The loops of the fast coder over lanes, for every instruction set, chosen when they are called. All
// give the same bytes.
//
// A number's context is what its neighbours let expect of its size: a weighted sum of theirs, in half octaves. From
// the context follow the low bits that stand as they are, and the table for the symbol above them. A token is
// a symbol and, from bit 4, the low bits that its context takes off. Its size, for its neighbours' contexts, is
// the middle of the numbers that it can be.
#pragma once

#include <cstddef>
#include <cstdint>

namespace voxloom::wavelet {

inline constexpr int kLanes = 32;
inline constexpr int kContexts = 32;
inline constexpr int kSymbols = 16, kEscape = kSymbols - 1;  // the last says that the number stands elsewhere
inline constexpr int kPrecision = 11, kTotal = 1 << kPrecision;
inline constexpr std::uint32_t kLowestState = 1u << 16;      // states stand in [2^16, 2^32)

// In 1/64 of the size that is expected of a number.
struct ContextWeights {
    std::uint16_t before, before_sides;        // y - 1, and left and right of it (within four lanes)
    std::uint16_t above, above_sides, above_ends;  // z - 1, left and right, y - 1 and y + 1
    std::uint16_t first, second;               // the same place in bands already coded
    std::uint16_t edge;                        // the parent's slope there
};

// One band in the layout of lane_layout.h. Pointers are to the place of its first lane; `sizes` is written,
// and read behind itself.
struct BandPass {
    int slices = 0, panels = 0, rows = 0;
    std::ptrdiff_t panel_places = 0, slice_places = 0;
    std::uint8_t* sizes = nullptr;
    const std::uint8_t *first = nullptr, *second = nullptr, *edge = nullptr;
    ContextWeights weights{};
    const std::uint8_t* active = nullptr;  // 255 where a lane is in the band, for each panel and row; null: everywhere
    std::uint8_t* tokens = nullptr;        // group after group, without borders
    int base = 0;                          // low bits that every number has, beside those of its context
};

struct SymbolSource {
    std::uint32_t states[kLanes];
    const std::uint16_t* at;   // 64 words beyond the end can be read
    const std::uint16_t* end;
};

// Slots of a context: kTotal entries of token | place within the symbol << 8 | frequency << (8 + kPrecision).
// False: the words ended early.
bool decode_tokens(const BandPass& band, const std::uint32_t* slots, SymbolSource& source);

// The encoder's counterpart: tokens and contexts of `numbers`, which stand as the tokens do and are zero where
// lanes are not active. Bit s of usable[c]: symbol s has a frequency in context c.
void choose_tokens(const BandPass& band, const std::int32_t* numbers, const std::uint32_t* usable, std::uint8_t* contexts);

// The states of the encoder, and the words they give off: backwards, since rANS gives back last what went in first.
struct SymbolSink {
    std::uint32_t states[kLanes];
    std::uint16_t* at;         // room for a word a number, and 8 more
};
// Takes up the symbols of a band's tokens, from the last to the first. symbols[kSymbols * context + symbol]: frequency, and
// from bit 16 on the sum of those before it. Of `band` tokens, active and the number of groups are looked at.
void encode_tokens(const BandPass& band, const std::uint8_t* contexts, const std::uint32_t* symbols, SymbolSink& sink);

// Numbers of a band's tokens from raw bits that start at bit `at` of `raw` and end at bit `limit`, behind which 128 bytes
// can be read; `at` moves on. False: the bits ended early. Escapes are left with symbol kEscape. Of `band` tokens,
// active, base and the number of groups are looked at.
bool expand_tokens(const BandPass& band, const std::uint8_t* raw, std::uint64_t limit, std::uint64_t& at, std::int32_t* numbers);

// One row of lane_edges.h: slopes of the parent modulo 2^32, `every` apart, at a place, before and behind it along its
// axis, and along the other two.
struct EdgeRow {
    const std::uint32_t *own, *left, *right, *other, *third;
};
void find_edges(const EdgeRow& slopes, int count, int every, float scale, std::uint8_t* edges);

// Low bits that a token's number has beside its sign; 0: a symbol is a magnitude, and zero has no sign.
// Otherwise it is what is left of 2 q or -2 q - 1 above these bits and one more.
inline int low_bits(std::uint8_t token, int base) { return (token >> 4) + base; }

}  // namespace voxloom::wavelet
