// Numbers stand in lanes (lane_layout.h); what a number's neighbours let expect of its size chooses the table of
// its symbol (lane_kernels.h). Nothing adapts, so 32 numbers are decoded at once, by 32 interleaved rANS states
// (Duda 2013; Giesen 2014) that take 16-bit words from one stream, in the order of the lanes. Signs and low bits,
// which no context foretells, stand as they are in a stream of their own.
//
// 32 states would cost much for a family of a few hundred bytes, so they start as the first 64 bytes of
// that stream: when all symbols are decoded, the states are these bytes.
//
// Bytes: flags; bit i: band i of kBandOrder has numbers; bit 7: the rest is a sparse list (sparse_list.h). Then
//   4 bits a lane: length of its state less 17; as many bits of each state below its leading one
//   varint number of words, words
//   varint bytes of signs and low bits beyond the first 64, these bytes
//   escapes: numbers that are no symbol, in gamma code
#include "plugins/codec-wavelet/fast_coder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <random>

#include "core/base/error.h"
#include "core/base/byte_io.h"
#include "plugins/codec-wavelet/bit_io.h"
#include "plugins/codec-wavelet/lane_tables.h"
#include "plugins/codec-wavelet/lane_workspace.h"
#include "plugins/codec-wavelet/sparse_list.h"

namespace voxloom::wavelet {

namespace {

constexpr int kSparse = 128;
constexpr std::size_t kInStates = 2 * kLanes;        // bytes of raw bits that the states start as
constexpr std::size_t kSparseNumbers = 1000;         // more are never shorter as a list
constexpr std::size_t kWordsBeyond = 64, kRawBeyond = 128;  // what the kernels may read past the end

thread_local LaneWorkspace workspace;

std::uint32_t folded(std::int32_t q) { return std::uint32_t(q) << 1 ^ (q < 0 ? ~0u : 0u); }
std::int32_t unfolded(std::uint32_t v) { return std::int32_t(v >> 1 ^ (0u - (v & 1))); }
std::uint32_t size_of(std::int32_t q) { return q < 0 ? 0u - std::uint32_t(q) : std::uint32_t(q); }

bool all_zero(const std::uint8_t* tokens) {
    std::array<std::uint64_t, 4> parts;
    static_assert(sizeof parts == kLanes);
    std::memcpy(&parts, tokens, sizeof parts);
    return (parts[0] | parts[1] | parts[2] | parts[3]) == 0;
}

// Has one of 32 tokens the symbol kEscape, whose four bits are all set?
bool any_escape(const std::uint8_t* tokens) {
    static_assert(kEscape == 15);
    std::array<std::uint64_t, kLanes / 8> parts;
    std::memcpy(parts.data(), tokens, sizeof parts);
    std::uint64_t any = 0;
    for (const std::uint64_t p : parts) any |= (p & 0x0f0f0f0f0f0f0f0f) + 0x0101010101010101;
    return (any & 0x1010101010101010) != 0;
}

// The bands that have numbers, as flags in kBandOrder, and how many numbers there are.
struct Count {
    int bands = 0;
    std::size_t numbers = 0;
};
Count count_of(const Details& d) {
    Count count;
    for (std::size_t i = 0; i < kBandOrder.size(); ++i) {
        std::size_t here = 0;
        for_each_row(d, d.shape.band(kBandOrder[i]), [&](const std::int32_t* q, std::size_t n) {
            for (std::size_t x = 0; x < n; ++x) here += q[x] != 0;
        });
        count.numbers += here;
        if (here > 0) count.bands |= 1 << i;
    }
    return count;
}

template <class Use>
void each_coded_band(const Details& d, int flags, const Use& use) {
    for (std::size_t i = 0; i < kBandOrder.size(); ++i)
        if (flags >> i & 1) use(d.shape.band(kBandOrder[i]));
}

// A band's numbers as the kernels want them: tokens and contexts appended to the workspace's.
void choose_band(LaneWorkspace& w, const Details& d, const Band& band, int base, const std::uint32_t* usable) {
    const LaneLayout& layout = w.layout();
    const std::size_t count = layout.groups(band) * kLanes, at = w.tokens.size();
    w.numbers.assign(count, 0);
    std::int32_t* group = w.numbers.data();
    layout.each_group(band, [&](int z, int panel, int row) {
        layout.each_strip(band, panel, row, [&](int lane, int x, int y, int n) {
            std::copy_n(d.q + d.shape.at(band.lo + glm::ivec3(x, y, z)), n, group + lane);
        });
        group += kLanes;
    });
    w.tokens.resize(at + count);
    w.contexts.resize(at + count);
    choose_tokens(w.pass(d, band, base, w.tokens.data() + at), w.numbers.data(), usable, w.contexts.data() + at);
}

// Calls use(lane of a group, place in the band's tokens) for the lanes that the band has, or the same backwards.
template <class Use>
void each_lane(const LaneLayout& layout, const Band& band, const Use& use) {
    std::size_t group = 0;
    layout.each_group(band, [&](int, int panel, int row) {
        layout.each_strip(band, panel, row, [&](int first, int, int, int n) {
            for (int lane = first; lane < first + n; ++lane) use(lane, group + std::size_t(lane));
        });
        group += kLanes;
    });
}

class FastCoder final : public Coder {
  public:
    explicit FastCoder(std::span<const std::byte> tables) {
        if (!tables.empty()) tables_ = LaneTables(tables);
    }

    CoderKind kind() const override { return CoderKind::fast; }
    Bytes tables() const override { return tables_.write(); }

    // Keeps some of the families, any of them with the same chance (Vitter's reservoir): a base must be known before
    // anything can be counted.
    void train(const Details& d) override {
        Sample& sample = samples_[std::size_t(d.finest)];
        const std::size_t place = sample.kept.size() < kKept ? sample.seen : std::size_t(sample.random() % (sample.seen + 1));
        ++sample.seen;
        if (place >= kKept) return;
        if (place == sample.kept.size()) sample.kept.emplace_back();
        Family& family = sample.kept[place];
        const glm::ivec3 low = d.shape.low();
        family.q.assign(d.q, d.q + d.shape.voxels());
        family.low.assign(d.low, d.low + std::size_t(low.x) * std::size_t(low.y) * std::size_t(low.z));
        family.shape = d;
    }
    void finish_training() override {
        LaneTables::Bases bases{};
        LaneTables::Counts counts{};
        for (std::size_t finest = 0; finest < 2; ++finest) {
            bases[finest] = base_of(samples_[finest]);
            for (Family& family : samples_[finest].kept) count(family, bases[finest], counts);
        }
        tables_ = LaneTables(counts, bases);
        samples_ = {};
    }

    void encode(const Details& d, Bytes& out) const override {
        const Count count = count_of(d);
        if (count.numbers == 0) return;
        BitWriter list;
        if (count.numbers <= kSparseNumbers) write_sparse(d, list);
        const std::size_t start = out.size();
        encode_lanes(d, count.bands, out);
        if (count.numbers > kSparseNumbers || (list.bits() + 7) / 8 + 1 >= out.size() - start) return;
        out.resize(start);
        ByteWriter writer(out);
        writer.number(std::uint8_t(kSparse));
        writer.bytes(list.finish());
    }

    void decode(std::span<const std::byte> in, Details& d) const override {
        if (in.empty()) return clear_bands(d);
        const int flags = std::uint8_t(in[0]);
        if (flags < kSparse) return decode_lanes(flags, in.subspan(1), d);
        clear_bands(d);
        BitReader list(in.subspan(1));
        read_sparse(list, d);
    }

  private:
    static constexpr std::size_t kKept = 40;  // families of either kind that train
    struct Family {
        Details shape;
        std::vector<std::int32_t> q, low;
        Details details() {
            Details d = shape;
            d.q = q.data();
            d.low = low.data();
            return d;
        }
    };
    struct Sample {
        std::size_t seen = 0;
        std::mt19937 random;
        std::vector<Family> kept;
    };

    // Low bits that leave sizes of 32 to 64 on the average, where contexts tell most.
    static int base_of(Sample& sample) {
        double sum = 0, count = 0;
        for (Family& family : sample.kept)
            for_each_row(family.details(), [&](const std::int32_t* q, std::size_t n) {
                for (std::size_t i = 0; i < n; ++i) sum += size_of(q[i]);
                count += double(n);
            });
        const double mean = count > 0 ? sum / count : 0;
        return mean < 64 ? 0 : std::min(std::ilogb(mean) - 5, LaneTables::kMostBase);
    }

    static void count(Family& family, int base, LaneTables::Counts& counts) {
        static constexpr auto kAllUsable = [] {
            std::array<std::uint32_t, kContexts> usable{};
            usable.fill((1u << kEscape) - 1);
            return usable;
        }();
        const Details d = family.details();
        LaneWorkspace& w = workspace;
        w.start(d);
        w.tokens.clear();
        w.contexts.clear();
        each_coded_band(d, count_of(d).bands, [&](const Band& band) {
            const std::size_t at = w.tokens.size();
            choose_band(w, d, band, base, kAllUsable.data());
            auto& set = counts[std::size_t(table_set(d.finest, band.mask))];
            each_lane(w.layout(), band, [&](int, std::size_t i) { ++set[w.contexts[at + i]][w.tokens[at + i] % kSymbols]; });
        });
    }

    void encode_lanes(const Details& d, int flags, Bytes& out) const {
        const int base = tables_.base(d.finest);
        LaneWorkspace& w = workspace;
        w.start(d);
        w.tokens.clear();
        w.contexts.clear();
        BitWriter raw, escapes;
        std::vector<std::pair<Band, std::size_t>> bands;  // and where its tokens are
        each_coded_band(d, flags, [&](const Band& band) {
            const std::size_t at = w.tokens.size();
            bands.push_back({band, at});
            choose_band(w, d, band, base, tables_.usable(table_set(d.finest, band.mask)));
            const std::uint8_t* const active = w.active_lanes(band);
            const std::size_t in_slice = std::size_t(w.layout().panels) * std::size_t(w.layout().rows);
            for (std::size_t group = 0; group < w.layout().groups(band); ++group) {
                const std::uint8_t* const tokens = w.tokens.data() + at + group * kLanes;
                if (base == 0 && all_zero(tokens)) continue;
                for (std::size_t lane = 0; lane < kLanes; ++lane)
                    if (!active || active[group % in_slice * kLanes + lane])
                        put_bits(tokens[lane], w.numbers[group * kLanes + lane], base, raw, escapes);
            }
        });
        Bytes bits = raw.finish();
        bits.resize(std::max(bits.size(), kInStates));
        w.words.resize(w.tokens.size() + kWordsBeyond);
        SymbolSink sink;
        sink.at = w.words.data();
        for (std::size_t i = 0; i < kLanes; ++i)
            sink.states[i] = kLowestState | std::uint32_t(bits[2 * i]) | std::uint32_t(bits[2 * i + 1]) << 8;
        for (auto coded = bands.rbegin(); coded != bands.rend(); ++coded) {
            const auto& [band, at] = *coded;
            encode_tokens(w.groups(band, base, w.tokens.data() + at), w.contexts.data() + at, tables_.symbols(table_set(d.finest, band.mask)), sink);
        }
        w.words.resize(std::size_t(sink.at - w.words.data()));
        std::reverse(w.words.begin(), w.words.end());
        ByteWriter writer(out);
        writer.number(std::uint8_t(flags));
        write_states(sink.states, writer);
        writer.varint(w.words.size());
        writer.bytes(std::as_bytes(std::span(w.words)));
        writer.block(std::span(bits).subspan(kInStates));
        writer.bytes(escapes.finish());
    }

    static void put_bits(std::uint8_t token, std::int32_t q, int base, BitWriter& raw, BitWriter& escapes) {
        const int symbol = token % kSymbols, low = low_bits(token, base);
        if (low > 0) {
            const std::uint32_t v = folded(q);
            raw.put(v & ((2u << low) - 1), low + 1);
            if (symbol == kEscape) escapes.gamma((v >> (low + 1)) + 1);
        } else if (symbol > 0) {
            raw.put(q < 0, 1);
            if (symbol == kEscape) escapes.gamma(size_of(q) + 1);
        }
    }

    static void write_states(std::span<const std::uint32_t, kLanes> states, ByteWriter& writer) {
        BitWriter lengths, rest;
        for (const std::uint32_t state : states) {
            const int length = std::bit_width(state) - 1;
            lengths.put(std::uint32_t(length - 16), 4);
            rest.put(state & ((1u << length) - 1), length);
        }
        writer.bytes(lengths.finish());
        writer.bytes(rest.finish());
    }
    static void read_states(ByteReader& reader, std::uint32_t* states) {
        BitReader lengths(reader.bytes(kLanes / 2));
        std::array<int, kLanes> length;
        int bits = 0;
        for (int& n : length) bits += n = 16 + int(lengths.get(4));
        BitReader rest(reader.bytes(std::uint64_t(bits + 7) / 8));
        for (std::size_t i = 0; i < kLanes; ++i) states[i] = 1u << length[i] | rest.get(length[i]);
    }

    void decode_lanes(int flags, std::span<const std::byte> in, Details& d) const {
        ByteReader reader(in);
        SymbolSource source;
        read_states(reader, source.states);
        const std::uint64_t words = reader.varint();
        if (words > reader.left() / 2) fail("the data ends too early");
        LaneWorkspace& w = workspace;
        w.words.resize(std::size_t(words) + kWordsBeyond);
        if (words > 0) std::memcpy(w.words.data(), reader.bytes(2 * words).data(), std::size_t(2 * words));
        source.at = w.words.data();
        source.end = source.at + words;

        w.start(d);
        std::size_t places = 0;
        each_coded_band(d, flags, [&](const Band& band) {
            if (!d.shape.has(band)) fail("a band is not in this family");
            places += w.layout().groups(band) * kLanes;
        });
        w.tokens.resize(places);
        std::uint8_t* tokens = w.tokens.data();
        const int base = tables_.base(d.finest);
        each_coded_band(d, flags, [&](const Band& band) {
            if (!decode_tokens(w.pass(d, band, base, tokens), tables_.slots(table_set(d.finest, band.mask)), source))
                fail("the data ends too early");
            tokens += w.layout().groups(band) * kLanes;
        });

        const auto bits = reader.block();
        w.raw.resize(kInStates + bits.size() + kRawBeyond);
        for (std::size_t i = 0; i < kLanes; ++i) {
            if (source.states[i] >> 16 != 1) fail("its symbols are corrupt");
            w.raw[2 * i] = std::uint8_t(source.states[i]);
            w.raw[2 * i + 1] = std::uint8_t(source.states[i] >> 8);
        }
        if (!bits.empty()) std::memcpy(w.raw.data() + kInStates, bits.data(), bits.size());
        BitReader escapes(reader.bytes(reader.left()));
        expand(flags, w, 8 * (kInStates + bits.size()), escapes, d);
    }

    void expand(int flags, LaneWorkspace& w, std::uint64_t limit, BitReader& escapes, Details& d) const {
        const int base = tables_.base(d.finest);
        std::uint8_t* tokens = w.tokens.data();
        std::uint64_t at = 0;
        for (std::size_t i = 0; i < kBandOrder.size(); ++i) {
            const Band band = d.shape.band(kBandOrder[i]);
            if (!(flags >> i & 1)) {
                for_each_row(d, band, [](std::int32_t* q, std::size_t n) { std::fill_n(q, n, 0); });
                continue;
            }
            const std::size_t count = w.layout().groups(band) * kLanes;
            w.numbers.resize(std::max(w.numbers.size(), count));
            if (!expand_tokens(w.groups(band, base, tokens), w.raw.data(), limit, at, w.numbers.data())) fail("the data ends too early");
            for (std::size_t group = 0; group < count; group += kLanes) {
                if (!any_escape(tokens + group)) continue;
                for (std::size_t n = group; n < group + kLanes; ++n)
                    if (tokens[n] % kSymbols == kEscape) w.numbers[n] = escaped(tokens[n], base, w.numbers[n], escapes);
            }
            spread(w.layout(), band, w.numbers.data(), d);
            tokens += count;
        }
    }

    // From lanes into the family's box.
    static void spread(const LaneLayout& layout, const Band& band, const std::int32_t* numbers, Details& d) {
        layout.each_group(band, [&](int z, int panel, int row) {
            layout.each_strip(band, panel, row, [&](int lane, int x, int y, int n) {
                std::int32_t* const to = d.q + d.shape.at(band.lo + glm::ivec3(x, y, z));
                if (n == 16)  // apart, since nearly all are such
                    std::memcpy(to, numbers + lane, 16 * sizeof *to);
                else
                    std::copy_n(numbers + lane, n, to);
            });
            numbers += kLanes;
        });
    }

    // `q` is what the token and its bits alone would be.
    static std::int32_t escaped(std::uint8_t token, int base, std::int32_t q, BitReader& escapes) {
        const std::uint32_t v = escapes.gamma() - 1;
        const int low = low_bits(token, base);
        if (low == 0) return std::int32_t(q < 0 ? 0u - v : v);
        return unfolded(v << (low + 1) | (folded(q) & ((2u << low) - 1)));
    }

    LaneTables tables_;
    std::array<Sample, 2> samples_;
};

}  // namespace

std::unique_ptr<Coder> make_fast_coder(std::span<const std::byte> tables) { return std::make_unique<FastCoder>(tables); }

}  // namespace voxloom::wavelet
