#include "plugins/codec-wavelet/lane_tables.h"

#include <algorithm>
#include <numeric>

#include "core/base/error.h"
#include "plugins/codec-wavelet/adaptive_number.h"

namespace voxloom::wavelet {

namespace {

using Weights = std::array<std::uint64_t, kSymbols>;
using Row = std::array<std::uint16_t, kSymbols>;

bool any(const Weights& counts) {
    return std::any_of(counts.begin(), counts.end(), [](std::uint64_t c) { return c > 0; });
}

// A rarely met context leans on those beside it.
Weights smoothed(const std::array<Weights, kContexts>& counts, int context) {
    Weights sum{};
    for (int c = std::max(context - 1, 0); c <= std::min(context + 1, kContexts - 1); ++c)
        for (std::size_t s = 0; s < kSymbols; ++s) sum[s] += (c == context ? 16 : 1) * counts[std::size_t(c)][s];
    return sum;
}

// What was never met gets nothing, the escape at least 1, so that whatever comes can be written. The sum is kTotal.
Row normalised(const Weights& counts) {
    const std::uint64_t sum = std::accumulate(counts.begin(), counts.end(), std::uint64_t(0));
    Row row{};
    int left = kTotal;
    std::size_t largest = 0;
    for (std::size_t s = 0; s < kSymbols; ++s) {
        if (counts[s] == 0 && s != kEscape) continue;
        row[s] = std::uint16_t(std::max<std::uint64_t>(1, counts[s] * (kTotal - kSymbols) / sum));
        left -= row[s];
        if (counts[s] > counts[largest]) largest = s;
    }
    row[largest] = std::uint16_t(row[largest] + left);
    if (row[kEscape] == kTotal) {  // a slot has no room for the frequency of a symbol that is alone
        row[0] = 1;
        --row[kEscape];
    }
    return row;
}

constexpr Row kAlike = [] {
    Row row{};
    for (auto& f : row) f = kTotal / kSymbols;
    return row;
}();

}  // namespace

LaneTables::LaneTables() {
    for (auto& set : frequencies_) set.fill(kAlike);
    build();
}

LaneTables::LaneTables(const Counts& counts, Bases bases) : bases_(bases) {
    for (std::size_t set = 0; set < kTableSets; ++set)
        for (int c = 0; c < kContexts; ++c) {
            const Weights weights = smoothed(counts[set], c);
            frequencies_[set][std::size_t(c)] = any(weights) ? normalised(weights) : kAlike;
        }
    build();
}

// Each table is a flag, and, where it is 1, the frequencies of all symbols but the escape, which gets the rest.
LaneTables::LaneTables(std::span<const std::byte> bytes) {
    RangeDecoder decoder(bytes);
    AdaptiveNumber model;
    const auto next = [&] { return int(model.code(decoder, std::uint16_t(0))); };
    for (int& base : bases_) {
        base = next();
        if (base > kMostBase) fail("the coder's tables are corrupt");
    }
    for (auto& set : frequencies_)
        for (Row& row : set) {
            row = kAlike;
            if (next() == 0) continue;
            int left = kTotal;
            for (int s = 0; s < kEscape; ++s) {
                const int f = next();
                row[std::size_t(s)] = std::uint16_t(f);
                left -= f;
                if (left < 1) fail("the coder's tables are corrupt");
            }
            row[kEscape] = std::uint16_t(left);
            if (left == kTotal) fail("the coder's tables are corrupt");
        }
    build();
}

Bytes LaneTables::write() const {
    Bytes bytes;
    RangeEncoder encoder(bytes);
    AdaptiveNumber model;
    const auto put = [&](int v) { model.code(encoder, std::uint16_t(v)); };
    for (const int base : bases_) put(base);
    for (const auto& set : frequencies_)
        for (const Row& row : set) {
            put(row != kAlike);
            if (row == kAlike) continue;
            for (int s = 0; s < kEscape; ++s) put(row[std::size_t(s)]);
        }
    encoder.finish();
    return bytes;
}

void LaneTables::build() {
    slots_.reserve(std::size_t(kTableSets) * kContexts * kTotal);
    for (std::size_t set = 0; set < kTableSets; ++set)
        for (std::uint32_t c = 0; c < kContexts; ++c) {
            const Row& row = frequencies_[set][c];
            const std::uint32_t off = (std::max(c, 15u) - 15) / 2;  // as the kernels' bits_off()
            std::uint32_t first = 0;
            for (std::uint32_t s = 0; s < kSymbols; ++s) {
                symbols_[set][c * kSymbols + s] = row[s] | first << 16;
                first += row[s];
                if (row[s] > 0 && s != kEscape) usable_[set][c] |= 1u << s;
                for (std::uint32_t i = 0; i < row[s]; ++i)
                    slots_.push_back(s | off << 4 | i << 8 | std::uint32_t(row[s]) << (8 + kPrecision));
            }
        }
}

}  // namespace voxloom::wavelet
