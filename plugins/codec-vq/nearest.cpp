#include "plugins/codec-vq/nearest.h"

#include <algorithm>
#include <cassert>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "plugins/codec-vq/nearest.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef VOXLOOM_VQ_NEAREST_ONCE
#define VOXLOOM_VQ_NEAREST_ONCE
namespace voxloom::vq {

inline constexpr int kGroup = 32;   // codewords that are looked at together
inline constexpr int kChunk = 8;    // components after which a group may be left

}  // namespace voxloom::vq
#endif

HWY_BEFORE_NAMESPACE();
namespace voxloom::vq::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using DF = hn::CappedTag<float, 16>;
using DI = hn::RebindToSigned<DF>;
using VF = hn::Vec<DF>;
constexpr std::size_t kLanes = hn::MaxLanes(DF());
constexpr std::size_t kVectors = 2;  // of codewords at a time: with as many vectors, accumulators stay in registers

// The distance to one codeword, summed as the lanes do it.
HWY_INLINE float distance_to(const SearchTable& table, const float* x, std::size_t word) {
    float sum = 0;
    for (int d = 0; d < table.dim; ++d) {
        const float difference = table.columns[std::size_t(d) * std::size_t(table.stride) + word] - x[d];
        sum += difference * difference;
    }
    return sum;
}

// kAtOnce vectors share the loads of the codewords. A group is left when none of its partial sums can win any more.
template <int kAtOnce>
HWY_INLINE void search(const SearchTable& table, const float* const* x, std::uint8_t* index, float* distance) {
    const DF d;
    const DI di;
    const auto stride = std::size_t(table.stride);
    VF best[kAtOnce], limit[kAtOnce];
    auto at = hn::Zero(di);
    decltype(at) winner[kAtOnce];
    for (int v = 0; v < kAtOnce; ++v) {
        const float guess = distance_to(table, x[v], index[v]);
        limit[v] = hn::Set(d, guess);
        best[v] = hn::Set(d, guess);
        winner[v] = hn::Set(di, std::int32_t(index[v]));
    }
    for (std::size_t first = 0; first < stride; first += kVectors * kLanes) {
        VF sum[kAtOnce][kVectors];
        for (int v = 0; v < kAtOnce; ++v)
            for (std::size_t k = 0; k < kVectors; ++k) sum[v][k] = hn::Zero(d);
        const float* column = table.columns.data() + first;
        bool lost = false;
        for (int c = 0; c < table.dim && !lost; c += kChunk) {
            for (int i = c; i < c + kChunk; ++i, column += stride) {
                const VF a = hn::LoadU(d, column), b = hn::LoadU(d, column + kLanes);
                for (int v = 0; v < kAtOnce; ++v) {
                    const VF own = hn::Set(d, x[v][i]);
                    const VF da = hn::Sub(a, own), db = hn::Sub(b, own);
                    sum[v][0] = hn::Add(sum[v][0], hn::Mul(da, da));
                    sum[v][1] = hn::Add(sum[v][1], hn::Mul(db, db));
                }
            }
            lost = true;
            for (int v = 0; v < kAtOnce; ++v)
                lost = lost && hn::AllTrue(d, hn::Gt(hn::Min(sum[v][0], sum[v][1]), limit[v]));
        }
        if (lost) continue;
        for (int v = 0; v < kAtOnce; ++v) {
            for (std::size_t k = 0; k < kVectors; ++k) {
                const auto here = hn::Iota(di, std::int32_t(first + k * kLanes));
                // Of equal ones the first, also where the guess is a later one.
                const auto better = hn::Or(hn::Lt(sum[v][k], best[v]),
                                           hn::And(hn::Eq(sum[v][k], best[v]), hn::RebindMask(d, hn::Lt(here, winner[v]))));
                best[v] = hn::IfThenElse(better, sum[v][k], best[v]);
                winner[v] = hn::IfThenElse(hn::RebindMask(di, better), here, winner[v]);
            }
            limit[v] = hn::MinOfLanes(d, best[v]);
        }
    }
    for (int v = 0; v < kAtOnce; ++v) {
        const auto least = hn::MinOfLanes(d, best[v]);
        const auto none = hn::Set(di, kMostCodewords);
        const auto candidates = hn::IfThenElse(hn::RebindMask(di, hn::Eq(best[v], least)), winner[v], none);
        distance[v] = hn::GetLane(least);
        index[v] = std::uint8_t(hn::GetLane(hn::MinOfLanes(di, candidates)));
    }
}

void FindNearest(const SearchTable& table, const float* vectors, std::size_t count, std::uint8_t* index, float* distance) {
    constexpr int kAtOnce = 4;
    const auto dim = std::size_t(table.dim);
    std::size_t i = 0;
    for (; i + kAtOnce <= count; i += kAtOnce) {
        const float* x[kAtOnce];
        for (std::size_t v = 0; v < kAtOnce; ++v) x[v] = vectors + (i + v) * dim;
        search<kAtOnce>(table, x, index + i, distance + i);
    }
    for (; i < count; ++i) {
        const float* x[1] = {vectors + i * dim};
        search<1>(table, x, index + i, distance + i);
    }
}

}  // namespace
}  // namespace voxloom::vq::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace voxloom::vq {

HWY_EXPORT(FindNearest);

SearchTable search_table(std::span<const float> words, int dim) {
    assert(dim % kChunk == 0 && !words.empty() && words.size() % std::size_t(dim) == 0);
    SearchTable table;
    table.dim = dim;
    table.count = int(words.size() / std::size_t(dim));
    assert(table.count <= kMostCodewords);
    table.stride = (table.count + kGroup - 1) / kGroup * kGroup;
    constexpr float far = 1e18f;  // its square is no infinity
    table.columns.assign(std::size_t(dim) * std::size_t(table.stride), far);
    for (int w = 0; w < table.count; ++w)
        for (int c = 0; c < dim; ++c)
            table.columns[std::size_t(c) * std::size_t(table.stride) + std::size_t(w)] = words[std::size_t(w) * std::size_t(dim) + std::size_t(c)];
    return table;
}

void find_nearest(const SearchTable& table, const float* vectors, std::size_t count, std::uint8_t* index, float* distance) {
    for (std::size_t i = 0; i < count; ++i)
        if (index[i] >= table.count) index[i] = 0;
    HWY_DYNAMIC_DISPATCH(FindNearest)(table, vectors, count, index, distance);
}

}  // namespace voxloom::vq
#endif
