// Frequencies of the fast coder's symbols: learned once for a volume, the same for all its families.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "plugins/codec-wavelet/coder.h"
#include "plugins/codec-wavelet/lane_kernels.h"

namespace voxloom::wavelet {

// Tables for the finest level and for all others, and for bands of one, two and three high axes.
inline constexpr int kTableSets = 6;
inline int table_set(bool finest, int mask) { return (finest ? 3 : 0) + std::popcount(unsigned(mask)) - 1; }

class LaneTables {
  public:
    using Counts = std::array<std::array<std::array<std::uint64_t, kSymbols>, kContexts>, kTableSets>;

    // Low bits of every number of the finest level [1] and of the others [0].
    using Bases = std::array<int, 2>;
    static constexpr int kMostBase = 17;  // a number's raw bits fit into one load of 32

    LaneTables();  // all symbols alike
    LaneTables(const Counts& counts, Bases bases);
    // Throws Error on what write() does not write.
    explicit LaneTables(std::span<const std::byte> bytes);
    Bytes write() const;

    int base(bool finest) const { return bases_[std::size_t(finest)]; }
    const std::uint32_t* slots(int set) const { return slots_.data() + std::size_t(set) * kContexts * kTotal; }
    const std::uint32_t* usable(int set) const { return usable_[std::size_t(set)].data(); }
    const std::uint32_t* symbols(int set) const { return symbols_[std::size_t(set)].data(); }

  private:
    using Row = std::array<std::uint16_t, kSymbols>;
    void build();

    Bases bases_{};
    std::array<std::array<Row, kContexts>, kTableSets> frequencies_{};
    std::array<std::array<std::uint32_t, kContexts * kSymbols>, kTableSets> symbols_{};
    std::array<std::array<std::uint32_t, kContexts>, kTableSets> usable_{};
    std::vector<std::uint32_t> slots_;
};

}  // namespace voxloom::wavelet
