// Each band is cut into blocks of 4^3. A block's class, the bits of its largest magnitude, is coded in the context
// of its neighbours' classes, and chooses the table for its numbers; so nothing adapts, and no number
// waits for the one before. Where numbers are small several make one symbol:
//   class 0     nothing; most blocks at low rates
//   class 1     16 symbols, each which of four numbers along x are not zero
//   class 2     32 symbols, each two magnitudes
//   class 3, 4  64 symbols, each a magnitude
//   above       64 tokens (token.h), their low bits apart
// Symbols go through four interleaved rANS coders (Duda 2013; Giesen 2014) with frequencies of 11 bits,
// collected once for the volume; signs and low bits stand in a plain bit stream of their own.
//
// Bytes: varint length of the symbols' part; four 32-bit states and 16-bit words; the bit stream.
#include "plugins/codec-wavelet/block_coder.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <cstring>

#include "core/base/error.h"
#include "plugins/codec-wavelet/adaptive_number.h"
#include "plugins/codec-wavelet/bit_io.h"
#include "core/base/byte_io.h"
#include "plugins/codec-wavelet/token.h"

namespace voxloom::wavelet {

namespace {

constexpr int kBlock = 4, kNumbers = 64;
constexpr int kPrecision = 11, kTotal = 1 << kPrecision;
constexpr int kLanes = 4;
constexpr std::uint32_t kLowest = 1u << 16;  // states stand in [2^16, 2^32)
constexpr int kAlphabet = 64;
constexpr int kTables = 16;                  // of either kind, for either kind of family

int table_of_class(bool finest, int context) { return (finest ? 2 * kTables : 0) + std::min(context, kTables - 1); }
int table_of_numbers(bool finest, int block_class) { return (finest ? 3 : 1) * kTables + std::min(block_class, kTables - 1); }
// Symbols of a table.
int alphabet_of(int table) {
    const int number_class = table % kTables;
    if (table / kTables % 2 == 0) return 32;  // classes
    return number_class <= 2 || number_class == 4 ? 16 : number_class == 3 ? 8 : kMaxToken + 1;
}
constexpr int kAllTables = 4 * kTables;

struct Frequencies {
    std::array<std::uint16_t, kAlphabet> count{}, first{};
};
struct Slot {
    std::uint16_t count, first;
    std::uint8_t symbol;
};
using Slots = std::array<Slot, kTotal>;

// Every symbol gets at least 1, so that whatever comes can be written; the sum is kTotal.
Frequencies normalised(std::span<const std::uint64_t> counts) {
    Frequencies f;
    std::uint64_t sum = 0;
    for (const std::uint64_t c : counts) sum += c;
    const int n = int(counts.size());
    int left = kTotal - n, largest = 0;
    for (int s = 0; s < n; ++s) {
        const int share = sum ? int(counts[std::size_t(s)] * std::uint64_t(kTotal - n) / sum) : (kTotal - n) / n;
        f.count[std::size_t(s)] = std::uint16_t(1 + share);
        left -= share;
        if (counts[std::size_t(s)] > counts[std::size_t(largest)]) largest = s;
    }
    f.count[std::size_t(largest)] = std::uint16_t(f.count[std::size_t(largest)] + left);
    for (int s = 1; s < n; ++s) f.first[std::size_t(s)] = std::uint16_t(f.first[std::size_t(s) - 1] + f.count[std::size_t(s) - 1]);
    return f;
}

// Four decoders that take turns.
class Symbols {
  public:
    explicit Symbols(std::span<const std::byte> in) {
        ByteReader reader(in);
        for (auto& state : states_) state = reader.number<std::uint32_t>();
        in_ = reader.bytes(reader.left());
    }
    template <int kLane>
    int next(const Slots& slots) {
        std::uint32_t& x = states_[kLane];
        const Slot& slot = slots[x & (kTotal - 1)];
        x = slot.count * (x >> kPrecision) + (x & (kTotal - 1)) - slot.first;
        if (x < kLowest && in_.size() >= 2) {
            std::uint16_t word;
            std::memcpy(&word, in_.data(), 2);
            x = x << 16 | word;
            in_ = in_.subspan(2);
        }
        return slot.symbol;
    }
    // Symbol i of a run goes to lane i % 4; runs are multiples of four.
    template <class Use>
    void run(const Slots& slots, int count, const Use& use) {
        for (int i = 0; i < count; i += 4) {
            use(i, next<0>(slots));
            use(i + 1, next<1>(slots));
            use(i + 2, next<2>(slots));
            use(i + 3, next<3>(slots));
        }
    }

  private:
    std::array<std::uint32_t, kLanes> states_{};
    std::span<const std::byte> in_;
};

// The blocks of a band and their neighbours' classes.
struct Blocks {
    explicit Blocks(glm::ivec3 band) : n((band + kBlock - 1) / kBlock), classes(std::size_t(n.x) * std::size_t(n.y) * std::size_t(n.z)) {}
    std::size_t at(int x, int y, int z) const { return (std::size_t(z) * std::size_t(n.y) + std::size_t(y)) * std::size_t(n.x) + std::size_t(x); }
    int context(int x, int y, int z) const {
        const int a = x > 0 ? classes[at(x - 1, y, z)] : 0, b = y > 0 ? classes[at(x, y - 1, z)] : 0,
                  c = z > 0 ? classes[at(x, y, z - 1)] : 0;
        return a + b + c > 0 ? 1 + (2 * (a + b + c) + 2) / 3 : 0;
    }
    template <class Visit>
    void each(const Visit& visit) {
        for (int z = 0; z < n.z; ++z)
            for (int y = 0; y < n.y; ++y)
                for (int x = 0; x < n.x; ++x) visit(x, y, z);
    }
    glm::ivec3 n;
    std::vector<std::uint8_t> classes;
};

// Calls row(start in q, place in the block, count) for the rows of a block that exist.
template <class Row>
void each_row(const Details& d, const Band& b, int x, int y, int z, const Row& row) {
    const glm::ivec3 lo = glm::ivec3(x, y, z) * kBlock, hi = glm::min(lo + kBlock, b.dims);
    for (int k = lo.z; k < hi.z; ++k)
        for (int j = lo.y; j < hi.y; ++j)
            row(d.q + d.shape.at(b.lo + glm::ivec3(lo.x, j, k)), ((k - lo.z) * kBlock + j - lo.y) * kBlock, hi.x - lo.x);
}

class BlockCoder final : public Coder {
  public:
    explicit BlockCoder(std::span<const std::byte> tables) {
        for (int t = 0; t < kAllTables; ++t) counts_[std::size_t(t)].resize(std::size_t(alphabet_of(t)));
        if (!tables.empty()) {
            RangeDecoder decoder(tables);
            AdaptiveNumber model;
            for (auto& table : counts_)
                for (std::uint64_t& count : table) count = model.code(decoder, std::uint16_t(0));
        }
        build();
    }

    CoderKind kind() const override { return CoderKind::blocks; }

    void encode(const Details&, Bytes&) const override { fail("the coder blocks only reads; choose fast"); }

    void decode(std::span<const std::byte> in, Details& d) const override {
        clear_bands(d);
        if (in.empty()) return;
        ByteReader reader(in);
        Symbols symbols(reader.block());
        BitReader bits(reader.bytes(reader.left()));
        for (int mask : kBandOrder) {
            const Band b = d.shape.band(mask);
            if (!d.shape.has(b)) continue;
            Blocks blocks(b.dims);
            blocks.each([&](int x, int y, int z) {
                blocks.classes[blocks.at(x, y, z)] =
                    std::uint8_t(symbols.next<0>(*slots_[std::size_t(table_of_class(d.finest, blocks.context(x, y, z)))]));
            });
            blocks.each([&](int x, int y, int z) {
                const int c = blocks.classes[blocks.at(x, y, z)];
                if (c > 0) decode_block(symbols, bits, d, b, x, y, z, c);
            });
        }
    }

  private:
    void decode_block(Symbols& symbols, BitReader& bits, Details& d, const Band& b, int x, int y, int z, int c) const {
        std::array<std::int32_t, kNumbers> numbers;
        const Slots& slots = *slots_[std::size_t(table_of_numbers(d.finest, c))];
        if (c == 1)
            symbols.run(slots, 16, [&](int i, int s) {
                for (int k = 0; k < 4; ++k) numbers[std::size_t(4 * i + k)] = s >> k & 1;
            });
        else if (c == 2)
            symbols.run(slots, 32, [&](int i, int s) {
                numbers[std::size_t(2 * i)] = s & 3;
                numbers[std::size_t(2 * i + 1)] = s >> 2;
            });
        else
            symbols.run(slots, 64, [&](int i, int s) { numbers[std::size_t(i)] = s; });
        for (std::int32_t& v : numbers) {
            if (v == 0) continue;
            const bool negative = bits.get(1);
            if (c > 4) v = std::int32_t(first_of(v) + bits.get(low_bits_of(v)));
            if (negative) v = -v;
        }
        each_row(d, b, x, y, z, [&](std::int32_t* q, int at, int n) { std::copy_n(&numbers[std::size_t(at)], n, q); });
    }

    void build() {
        for (std::size_t t = 0; t < std::size_t(kAllTables); ++t) {
            frequencies_[t] = normalised(counts_[t]);
            slots_[t] = std::make_unique<Slots>();
            std::size_t at = 0;
            for (std::size_t s = 0; s < counts_[t].size(); ++s)
                for (int i = 0; i < frequencies_[t].count[s]; ++i)
                    (*slots_[t])[at++] = {frequencies_[t].count[s], frequencies_[t].first[s], std::uint8_t(s)};
        }
    }

    std::array<std::vector<std::uint64_t>, kAllTables> counts_;
    std::array<Frequencies, kAllTables> frequencies_;
    std::array<std::unique_ptr<Slots>, kAllTables> slots_;
};

}  // namespace

std::unique_ptr<Coder> make_block_coder(std::span<const std::byte> tables) { return std::make_unique<BlockCoder>(tables); }

}  // namespace voxloom::wavelet
