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

inline constexpr int kGroup = 64;   // codewords that are looked at together, at most
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
constexpr std::size_t kVectors = 4;  // of codewords at a time: enough sums to hide how long an addition takes
constexpr std::size_t kWidth = kVectors * kLanes;

struct Best {
    VF distance;
    hn::Vec<DI> word;
    VF limit;  // the smallest distance in all lanes
};

// The codewords from `first` on. They are left as soon as none of their partial sums can win any more.
HWY_INLINE void look_at(const SearchTable& table, const float* x, std::size_t first, Best& best) {
    const DF d;
    const DI di;
    const auto stride = std::size_t(table.stride);
    VF sum0 = hn::Zero(d), sum1 = sum0, sum2 = sum0, sum3 = sum0;
    const float* column = table.columns.data() + first;
    for (int chunk = 0; chunk < table.dim; chunk += kChunk) {
        for (int i = chunk; i < chunk + kChunk; ++i, column += stride) {
            const VF own = hn::Set(d, x[i]);
            const auto add = [&](VF& sum, std::size_t k) HWY_ATTR {
                const VF difference = hn::Sub(hn::LoadU(d, column + k * kLanes), own);
                sum = hn::Add(sum, hn::Mul(difference, difference));
            };
            add(sum0, 0);
            add(sum1, 1);
            add(sum2, 2);
            add(sum3, 3);
        }
        if (hn::AllTrue(d, hn::Gt(hn::Min(hn::Min(sum0, sum1), hn::Min(sum2, sum3)), best.limit))) return;
    }
    const auto compare = [&](VF sum, std::size_t k) HWY_ATTR {
        const auto word = hn::Iota(di, std::int32_t(first + k * kLanes));
        // Of equal ones the first, though the search does not begin with the first ones.
        const auto is_better = hn::Or(hn::Lt(sum, best.distance),
                                      hn::And(hn::Eq(sum, best.distance), hn::RebindMask(d, hn::Lt(word, best.word))));
        best.distance = hn::IfThenElse(is_better, sum, best.distance);
        best.word = hn::IfThenElse(hn::RebindMask(di, is_better), word, best.word);
    };
    compare(sum0, 0);
    compare(sum1, 1);
    compare(sum2, 2);
    compare(sum3, 3);
    best.limit = hn::MinOfLanes(d, best.distance);
}

void FindNearest(const SearchTable& table, const float* vectors, std::size_t count, std::uint8_t* index, float* distance) {
    const DF d;
    const DI di;
    const std::size_t groups = std::size_t(table.stride) / kWidth;
    for (std::size_t i = 0; i < count; ++i) {
        const float* x = vectors + i * std::size_t(table.dim);
        const std::size_t home = index[i] / kWidth;  // where the guess is
        const auto none = hn::Set(di, kMostCodewords);
        Best best{hn::Inf(d), none, hn::Inf(d)};
        look_at(table, x, home * kWidth, best);
        for (std::size_t group = 0; group < groups; ++group)
            if (group != home) look_at(table, x, group * kWidth, best);
        const auto candidates = hn::IfThenElse(hn::RebindMask(di, hn::Eq(best.distance, best.limit)), best.word, none);
        distance[i] = hn::GetLane(best.limit);
        index[i] = std::uint8_t(hn::GetLane(hn::MinOfLanes(di, candidates)));
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
