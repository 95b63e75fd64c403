#include "plugins/codec-wavelet/lane_kernels.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "plugins/codec-wavelet/lane_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef VOXLOOM_LANE_KERNELS_ONCE
#define VOXLOOM_LANE_KERNELS_ONCE
namespace voxloom::wavelet {

// Of eight lanes that a mask names, how many named ones stand before each.
inline constexpr auto kRanks = [] {
    std::array<std::array<std::uint8_t, 8>, 256> ranks{};
    for (unsigned mask = 0; mask < 256; ++mask)
        for (unsigned lane = 0; lane < 8; ++lane)
            ranks[mask][lane] = std::uint8_t(std::popcount(mask & ((1u << lane) - 1)));
    return ranks;
}();

// The named lanes themselves, the last one first.
inline constexpr auto kBackwards = [] {
    std::array<std::array<std::uint8_t, 8>, 256> lanes{};
    for (unsigned mask = 0; mask < 256; ++mask)
        for (unsigned lane = 8, at = 0; lane-- > 0;)
            if (mask >> lane & 1) lanes[mask][at++] = std::uint8_t(lane);
    return lanes;
}();

}  // namespace voxloom::wavelet
#endif

HWY_BEFORE_NAMESPACE();
namespace voxloom::wavelet::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kLaneCount = kLanes;

using D32 = hn::CappedTag<std::uint32_t, 8>;
using DI32 = hn::RebindToSigned<D32>;
using DF32 = hn::Rebind<float, D32>;
using DBytes = hn::Rebind<std::uint8_t, D32>;   // as many bytes as D32 has lanes
using DWords = hn::Rebind<std::uint16_t, D32>;
using V = hn::Vec<D32>;
constexpr std::size_t kEach = hn::MaxLanes(D32());
constexpr std::size_t kVectors = kLaneCount / kEach;

using D16 = hn::CappedTag<std::uint16_t, 16>;
using D16Bytes = hn::Rebind<std::uint8_t, D16>;
constexpr std::size_t kEach16 = hn::MaxLanes(D16());

HWY_INLINE V bytes_at(const std::uint8_t* p) { return hn::PromoteTo(D32(), hn::LoadU(DBytes(), p)); }
HWY_INLINE void store_bytes(V v, std::uint8_t* p) { hn::StoreU(hn::DemoteTo(DBytes(), hn::BitCast(DI32(), v)), DBytes(), p); }

// What neighbours outside of the group add to the contexts of its lanes.
HWY_INLINE void far_sizes(const BandPass& b, std::ptrdiff_t here, std::uint16_t* out) {
    const D16 d;
    const D16Bytes bytes;
    const std::uint8_t* above = b.sizes + here - b.slice_places;
    const auto weighted = [&](auto size, std::uint16_t weight) HWY_ATTR { return hn::Mul(hn::PromoteTo(d, size), hn::Set(d, weight)); };
    for (std::size_t i = 0; i < kLaneCount; i += kEach16) {
        const std::uint8_t* up = above + i;
        auto sum = weighted(hn::LoadU(bytes, up), b.weights.above);
        sum = hn::Add(sum, weighted(hn::SaturatedAdd(hn::LoadU(bytes, up - 1), hn::LoadU(bytes, up + 1)), b.weights.above_sides));
        sum = hn::Add(sum, weighted(hn::SaturatedAdd(hn::LoadU(bytes, up - kLaneCount), hn::LoadU(bytes, up + kLaneCount)), b.weights.above_ends));
        sum = hn::Add(sum, weighted(hn::LoadU(bytes, b.first + here + i), b.weights.first));
        sum = hn::Add(sum, weighted(hn::LoadU(bytes, b.second + here + i), b.weights.second));
        sum = hn::Add(sum, weighted(hn::LoadU(bytes, b.edge + here + i), b.weights.edge));
        hn::StoreU(sum, d, out + i);
    }
}

// Left and right neighbours, as far as they stand in the same four lanes.
HWY_INLINE V sides(const V* near, std::size_t i) {
#if HWY_TARGET == HWY_SCALAR
    V sum = hn::Zero(D32());
    if (i % 4 != 0) sum = hn::Add(sum, near[i - 1]);
    if (i % 4 != 3) sum = hn::Add(sum, near[i + 1]);
    return sum;
#else
    return hn::Add(hn::ShiftLeftLanes<1>(D32(), near[i]), hn::ShiftRightLanes<1>(D32(), near[i]));
#endif
}

// 0 for nothing expected, then half octaves of 1/64: the exponent and first bit of a float.
HWY_INLINE V context_of(V expected) {
    const DI32 di;
    const auto exponent = hn::ShiftRight<22>(hn::BitCast(di, hn::ConvertTo(DF32(), hn::BitCast(di, expected))));
    return hn::BitCast(D32(), hn::Max(hn::Sub(exponent, hn::Set(di, 2 * 127 - 1)), hn::Zero(di)));
}
// Bits that a context takes off: numbers of 4 and more on the average.
HWY_INLINE V bits_off(V context) {
    const D32 d;
    return hn::ShiftRight<1>(hn::Sub(hn::Max(context, hn::Set(d, 15)), hn::Set(d, 15)));
}

HWY_INLINE V sizes_of(V token) {
    const D32 d;
    const V symbol = hn::And(token, hn::Set(d, 15)), off = hn::ShiftRight<4>(token);
    const V doubled = hn::Add(hn::Add(symbol, symbol), hn::Min(off, hn::Set(d, 1)));
    return hn::Min(hn::ShiftRight<1>(hn::Shl(doubled, off)), hn::Set(d, 255));
}

// Goes through a band in the order of its groups. coding.tokens(i, contexts, active) gives the tokens of the lanes
// from kEach * i on, coding.next_group() is false where the end was reached too early.
template <bool kRagged, class Coding>
HWY_INLINE bool walk(const BandPass& b, Coding& coding) {
    const D32 d;
    const V before = hn::Set(d, b.weights.before), before_sides = hn::Set(d, b.weights.before_sides);
    std::uint8_t* out = b.tokens;
    for (int slice = 0; slice < b.slices; ++slice)
        for (int panel = 0; panel < b.panels; ++panel) {
            V near[kVectors];
            for (V& v : near) v = hn::Zero(d);
            std::ptrdiff_t here = slice * b.slice_places + panel * b.panel_places;
            for (int row = 0; row < b.rows; ++row, here += kLaneCount, out += kLaneCount) {
                alignas(64) std::uint16_t far[kLaneCount];
                far_sizes(b, here, far);
                const std::uint8_t* active = b.active + (kRagged ? std::size_t(panel * b.rows + row) * kLaneCount : 0);
                V tokens[kVectors];
                for (std::size_t i = 0; i < kVectors; ++i) {
                    V expected = hn::PromoteTo(d, hn::LoadU(DWords(), far + i * kEach));
                    expected = hn::Add(expected, hn::Add(hn::Mul(near[i], before), hn::Mul(sides(near, i), before_sides)));
                    const V on = kRagged ? bytes_at(active + i * kEach) : expected;
                    tokens[i] = coding.template tokens<kRagged>(i, context_of(expected), on);
                }
                for (std::size_t i = 0; i < kVectors; ++i) {
                    near[i] = sizes_of(tokens[i]);
                    store_bytes(tokens[i], out + i * kEach);
                    store_bytes(near[i], b.sizes + here + std::ptrdiff_t(i * kEach));
                }
                if (!coding.next_group()) return false;
            }
        }
    return true;
}

class Decoding {
  public:
    Decoding(const std::uint32_t* slots, SymbolSource& source) : slots_(slots), source_(source), at_(source.at) {
        for (std::size_t i = 0; i < kVectors; ++i) states_[i] = hn::LoadU(D32(), source.states + i * kEach);
    }
    void finish() {
        for (std::size_t i = 0; i < kVectors; ++i) hn::StoreU(states_[i], D32(), source_.states + i * kEach);
        source_.at = at_;
    }
    template <bool kRagged>
    HWY_INLINE V tokens(std::size_t i, V context, V active) {
        const D32 d;
        const V state = states_[i], place = hn::Set(d, kTotal - 1);
        const V index = hn::Or(hn::ShiftLeft<kPrecision>(context), hn::And(state, place));
        const V slot = hn::GatherIndex(d, slots_, hn::BitCast(DI32(), index));
        V next = hn::Add(hn::Mul(hn::ShiftRight<8 + kPrecision>(slot), hn::ShiftRight<kPrecision>(state)),
                         hn::And(hn::ShiftRight<8>(slot), place));
        V token = hn::And(slot, hn::Set(d, 255));
        if (kRagged) {
            const auto off = hn::Eq(active, hn::Zero(d));
            next = hn::IfThenElse(off, state, next);
            token = hn::IfThenZeroElse(off, token);
        }
        // Lanes that fell below 2^16 take a word each, in their order.
        const auto low = hn::Eq(hn::ShiftRight<16>(next), hn::Zero(d));
        std::uint8_t bits[8] = {};
        hn::StoreMaskBits(d, low, bits);
        const V words = hn::PromoteTo(d, hn::LoadU(DWords(), at_));
        const V mine = hn::TableLookupLanes(words, hn::IndicesFromVec(d, bytes_at(kRanks[bits[0]].data())));
        states_[i] = hn::IfThenElse(low, hn::Or(hn::ShiftLeft<16>(next), mine), next);
        at_ += std::popcount(bits[0]);
        return token;
    }
    HWY_INLINE bool next_group() const { return at_ <= source_.end; }

  private:
    V states_[kVectors];
    const std::uint32_t* slots_;
    SymbolSource& source_;
    const std::uint16_t* at_;
};

class Choosing {
  public:
    Choosing(const std::int32_t* numbers, const std::uint32_t* usable, int base, std::uint8_t* contexts)
        : numbers_(numbers), usable_(usable), base_(base), contexts_(contexts) {}
    template <bool kRagged>
    HWY_INLINE V tokens(std::size_t i, V context, V active) {
        const D32 d;
        const DI32 di;
        const auto q = hn::LoadU(di, numbers_ + i * kEach);
        const V off = bits_off(context), shift = hn::Add(off, hn::Set(d, std::uint32_t(base_)));
        const V folded = hn::BitCast(d, hn::Xor(hn::ShiftLeft<1>(q), hn::ShiftRight<31>(q)));
        const V size = hn::BitCast(d, hn::Abs(q));
        V symbol = hn::IfThenElse(hn::Eq(shift, hn::Zero(d)), size, hn::ShiftRight<1>(hn::Shr(folded, shift)));
        symbol = hn::Min(symbol, hn::Set(d, kEscape));
        const V usable = hn::Shr(hn::GatherIndex(d, usable_, hn::BitCast(di, context)), symbol);
        symbol = hn::IfThenElse(hn::Eq(hn::And(usable, hn::Set(d, 1)), hn::Zero(d)), hn::Set(d, kEscape), symbol);
        store_bytes(context, contexts_ + i * kEach);
        const V token = hn::Or(symbol, hn::ShiftLeft<4>(off));
        return kRagged ? hn::IfThenZeroElse(hn::Eq(active, hn::Zero(d)), token) : token;
    }
    HWY_INLINE bool next_group() {
        numbers_ += kLaneCount;
        contexts_ += kLaneCount;
        return true;
    }

  private:
    const std::int32_t* numbers_;
    const std::uint32_t* usable_;
    int base_;
    std::uint8_t* contexts_;
};

bool DecodeTokens(const BandPass& band, const std::uint32_t* slots, SymbolSource& source) {
    Decoding coding(slots, source);
    const bool whole = band.active ? walk<true>(band, coding) : walk<false>(band, coding);
    coding.finish();
    return whole;
}

void ChooseTokens(const BandPass& band, const std::int32_t* numbers, const std::uint32_t* usable, std::uint8_t* contexts) {
    Choosing coding(numbers, usable, band.base, contexts);
    if (band.active)
        walk<true>(band, coding);
    else
        walk<false>(band, coding);
}

// Quotients below 2^31 of a state by a frequency of 11 bits. They stand at least 2^-11 below the next integer, so that
// double precision never rounds up to it.
HWY_INLINE V quotients(V states, V frequencies) {
    const D32 d;
#if HWY_TARGET == HWY_SCALAR
    return hn::Set(d, hn::GetLane(states) / std::max(hn::GetLane(frequencies), 1u));
#else
    const hn::Half<D32> half;
    const hn::RepartitionToWide<D32> wide;
    const hn::Rebind<double, decltype(wide)> real;
    const auto real_of = [&](auto v) HWY_ATTR {  // 2^52 + v has the bits of v below
        return hn::Sub(hn::BitCast(real, hn::Or(hn::PromoteTo(wide, v), hn::Set(wide, 0x4330000000000000u))), hn::Set(real, 0x1p52));
    };
    const auto divided = [&](auto a, auto b) HWY_ATTR {
        return hn::BitCast(half, hn::DemoteTo(hn::RebindToSigned<decltype(half)>(), hn::Div(real_of(a), real_of(b))));
    };
    return hn::Combine(d, divided(hn::UpperHalf(half, states), hn::UpperHalf(half, frequencies)),
                       divided(hn::LowerHalf(half, states), hn::LowerHalf(half, frequencies)));
#endif
}

template <bool kRagged>
HWY_INLINE void encode_groups(const BandPass& b, const std::uint8_t* contexts, const std::uint32_t* symbols, SymbolSink& sink) {
    const D32 d;
    const DI32 di;
    V states[kVectors];
    for (std::size_t i = 0; i < kVectors; ++i) states[i] = hn::LoadU(d, sink.states + i * kEach);
    std::uint16_t* at = sink.at;
    const std::size_t in_slice = std::size_t(b.panels) * std::size_t(b.rows);
    for (std::size_t group = std::size_t(b.slices) * in_slice; group-- > 0;)
        for (std::size_t i = kVectors; i-- > 0;) {
            const std::size_t lane = group * kLaneCount + i * kEach;
            const V symbol = hn::And(bytes_at(b.tokens + lane), hn::Set(d, kSymbols - 1));
            const V entry = hn::GatherIndex(d, symbols, hn::BitCast(di, hn::Add(hn::ShiftLeft<4>(bytes_at(contexts + lane)), symbol)));
            const V frequency = hn::And(entry, hn::Set(d, 0xffff)), first = hn::ShiftRight<16>(entry);
            // A state that would grow beyond 32 bits gives off a word.
            V full = hn::VecFromMask(d, hn::Not(hn::RebindMask(d, hn::Lt(hn::BitCast(di, hn::ShiftRight<32 - kPrecision>(states[i])),
                                                                         hn::BitCast(di, frequency)))));
            const V on = kRagged ? bytes_at(b.active + group % in_slice * kLaneCount + i * kEach) : full;
            if (kRagged) full = hn::IfThenZeroElse(hn::Eq(on, hn::Zero(d)), full);
            std::uint8_t bits[8] = {};
            hn::StoreMaskBits(d, hn::MaskFromVec(full), bits);
            const V words = hn::TableLookupLanes(hn::And(states[i], hn::Set(d, 0xffff)),
                                                 hn::IndicesFromVec(d, bytes_at(kBackwards[bits[0]].data())));
            hn::StoreU(hn::DemoteTo(DWords(), hn::BitCast(di, words)), DWords(), at);
            at += std::popcount(bits[0]);
            const V state = hn::IfThenElse(hn::MaskFromVec(full), hn::ShiftRight<16>(states[i]), states[i]);
            const V next = hn::Add(hn::Add(state, first),
                                   hn::Mul(quotients(state, frequency), hn::Sub(hn::Set(d, kTotal), frequency)));
            states[i] = kRagged ? hn::IfThenElse(hn::Eq(on, hn::Zero(d)), state, next) : next;
        }
    for (std::size_t i = 0; i < kVectors; ++i) hn::StoreU(states[i], d, sink.states + i * kEach);
    sink.at = at;
}

void EncodeTokens(const BandPass& band, const std::uint8_t* contexts, const std::uint32_t* symbols, SymbolSink& sink) {
    if (band.active)
        encode_groups<true>(band, contexts, symbols, sink);
    else
        encode_groups<false>(band, contexts, symbols, sink);
}

// Sums of all lanes before each.
HWY_INLINE V sums_before(V v) {
#if HWY_TARGET == HWY_SCALAR
    return hn::Sub(v, v);
#else
    const D32 d;
    V sum = hn::Add(v, hn::ShiftLeftLanes<1>(d, v));
    sum = hn::Add(sum, hn::ShiftLeftLanes<2>(d, sum));
    if constexpr (kEach == 8) {
        alignas(32) static constexpr std::uint32_t kLast[8] = {3, 3, 3, 3, 3, 3, 3, 3};
        const V half = hn::TableLookupLanes(sum, hn::SetTableIndices(d, kLast));
        sum = hn::Add(sum, hn::IfThenZeroElse(hn::FirstN(d, 4), half));
    }
    return hn::Sub(sum, v);
#endif
}

// 32 bits from each lane's bit on; at least 25 of them are good.
HWY_INLINE V bits_at(const std::uint8_t* raw, V bit) {
    const D32 d;
    const V byte = hn::ShiftRight<3>(bit);
#if HWY_TARGET <= HWY_AVX2
    const V words = hn::GatherOffset(d, reinterpret_cast<const std::uint32_t*>(raw), hn::BitCast(DI32(), byte));
#else
    alignas(32) std::uint32_t offsets[kEach], loaded[kEach];
    hn::StoreU(byte, d, offsets);
    for (std::size_t i = 0; i < kEach; ++i) std::memcpy(&loaded[i], raw + offsets[i], 4);
    const V words = hn::LoadU(d, loaded);
#endif
    return hn::Shr(words, hn::And(bit, hn::Set(d, 7)));
}

template <bool kRagged>
HWY_INLINE void expand_group(const std::uint8_t* tokens, const std::uint8_t* active, int base, const std::uint8_t* raw,
                             std::uint64_t& at, std::int32_t* numbers) {
    const D32 d;
    const DI32 di;
    const V one = hn::Set(d, 1), zero = hn::Zero(d);
    for (std::size_t i = 0; i < kLaneCount; i += kEach) {
        const V token = bytes_at(tokens + i);
        const V symbol = hn::And(token, hn::Set(d, 15)), shift = hn::Add(hn::ShiftRight<4>(token), hn::Set(d, std::uint32_t(base)));
        const auto plain = hn::Eq(shift, zero);
        V count = hn::IfThenElse(plain, hn::Min(symbol, one), hn::Add(shift, one));
        if (kRagged) count = hn::IfThenZeroElse(hn::Eq(bytes_at(active + i), zero), count);
        const V before = sums_before(count);
        const V bits = hn::And(bits_at(raw + at / 8, hn::Add(before, hn::Set(d, std::uint32_t(at % 8)))),
                               hn::Sub(hn::Shl(one, count), one));
        // In both cases the last bit is the sign: of a magnitude, or of a folded number.
        const auto negative = hn::BitCast(di, hn::Sub(zero, hn::And(bits, one)));
        const V folded = hn::Or(hn::Shl(symbol, hn::Add(shift, one)), bits);
        const V size = hn::IfThenElse(plain, hn::Sub(symbol, hn::And(bits, one)), hn::ShiftRight<1>(folded));
        hn::StoreU(hn::Xor(hn::BitCast(di, size), negative), di, numbers + i);
        at += hn::ExtractLane(before, kEach - 1) + hn::ExtractLane(count, kEach - 1);
    }
}

template <bool kRagged>
HWY_INLINE bool expand_groups(const BandPass& b, const std::uint8_t* raw, std::uint64_t limit, std::uint64_t& at, std::int32_t* numbers) {
    const std::size_t in_slice = std::size_t(b.panels) * std::size_t(b.rows), groups = std::size_t(b.slices) * in_slice;
    std::uint64_t bit = at;
    for (std::size_t group = 0, row = 0; group < groups; ++group, row = row + 1 == in_slice ? 0 : row + 1) {
        const std::uint8_t* const tokens = b.tokens + group * kLaneCount;
        std::array<std::uint64_t, kLaneCount / 8> parts;
        std::memcpy(parts.data(), tokens, sizeof parts);
        if (b.base == 0 && (parts[0] | parts[1] | parts[2] | parts[3]) == 0)
            std::fill_n(numbers + group * kLaneCount, kLaneCount, 0);
        else
            expand_group<kRagged>(tokens, kRagged ? b.active + row * kLaneCount : nullptr, b.base, raw, bit, numbers + group * kLaneCount);
        if (bit > limit) return false;
    }
    at = bit;
    return true;
}

bool ExpandTokens(const BandPass& band, const std::uint8_t* raw, std::uint64_t limit, std::uint64_t& at, std::int32_t* numbers) {
    return band.active ? expand_groups<true>(band, raw, limit, at, numbers) : expand_groups<false>(band, raw, limit, at, numbers);
}

// No more than 2^26, so that sums stay within 32 bits, whatever a corrupt file holds.
HWY_INLINE std::uint32_t slope_size(std::uint32_t slope) {
    const std::uint32_t size = slope < 0u - slope ? slope : 0u - slope;
    return size < 1u << 26 ? size : 1u << 26;
}
HWY_INLINE std::uint8_t edge(const EdgeRow& s, int i, float scale) {
    const std::uint32_t sum = 4 * slope_size(s.own[i]) + slope_size(s.other[i]) + slope_size(s.third[i]) + slope_size(s.right[i] - s.left[i]) / 2;
    const float scaled = float(std::int32_t(sum)) * scale;
    return std::uint8_t(std::int32_t(scaled < 255.0f ? scaled : 255.0f));
}
void FindEdges(const EdgeRow& slopes, int count, int every, float scale, std::uint8_t* HWY_RESTRICT edges) {
    if (every == 1)  // apart, for the compiler's sake
        for (int i = 0; i < count; ++i) edges[i] = edge(slopes, i, scale);
    else
        for (int i = 0; i < count; ++i) edges[i] = edge(slopes, i * every, scale);
}

}  // namespace
}  // namespace voxloom::wavelet::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace voxloom::wavelet {

HWY_EXPORT(DecodeTokens);
HWY_EXPORT(ChooseTokens);
HWY_EXPORT(EncodeTokens);
HWY_EXPORT(ExpandTokens);
HWY_EXPORT(FindEdges);

bool decode_tokens(const BandPass& band, const std::uint32_t* slots, SymbolSource& source) {
    return HWY_DYNAMIC_DISPATCH(DecodeTokens)(band, slots, source);
}
void choose_tokens(const BandPass& band, const std::int32_t* numbers, const std::uint32_t* usable, std::uint8_t* contexts) {
    HWY_DYNAMIC_DISPATCH(ChooseTokens)(band, numbers, usable, contexts);
}
void encode_tokens(const BandPass& band, const std::uint8_t* contexts, const std::uint32_t* symbols, SymbolSink& sink) {
    HWY_DYNAMIC_DISPATCH(EncodeTokens)(band, contexts, symbols, sink);
}
bool expand_tokens(const BandPass& band, const std::uint8_t* raw, std::uint64_t limit, std::uint64_t& at, std::int32_t* numbers) {
    return HWY_DYNAMIC_DISPATCH(ExpandTokens)(band, raw, limit, at, numbers);
}
void find_edges(const EdgeRow& slopes, int count, int every, float scale, std::uint8_t* edges) {
    HWY_DYNAMIC_DISPATCH(FindEdges)(slopes, count, every, scale, edges);
}

}  // namespace voxloom::wavelet
#endif
