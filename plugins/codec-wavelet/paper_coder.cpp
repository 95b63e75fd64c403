// The paper gives zeros as a 0 and seven bits of run - 1, other numbers as "n + 1 bits", which leaves open
// how the two are told apart. The one reading that can be decoded, and is complete (its Kraft sum
// is 1), takes the positive number v = 2c - 1 or -2c with n significant bits as
//   1^n 0 b(n-2) ... b(0)    n ones, a zero, v without its leading one
// Bits go from the highest of a byte to the lowest. A last run up to the end is left out.
#include "plugins/codec-wavelet/paper_coder.h"

#include <algorithm>
#include <bit>

#include "core/base/error.h"

namespace voxloom::wavelet {

namespace {

constexpr std::size_t kLongestRun = 128;

class BitWriter {
  public:
    explicit BitWriter(Bytes& out) : out_(out) {}
    void put(std::uint64_t bits, int count) {  // up to 32
        held_ = held_ << count | bits;
        for (held_count_ += count; held_count_ >= 8; held_count_ -= 8) out_.push_back(std::byte(held_ >> (held_count_ - 8)));
    }
    void finish() {  // ones: no number and no run ends within them
        if (held_count_ > 0) put((1u << (8 - held_count_)) - 1, 8 - held_count_);
    }

  private:
    Bytes& out_;
    std::uint64_t held_ = 0;
    int held_count_ = 0;
};

class BitReader {
  public:
    explicit BitReader(std::span<const std::byte> in) : in_(in) {}
    // The next bits, ones beyond the end; at least 56 of them, from the highest.
    std::uint64_t peek() {
        while (count_ <= 56) {
            held_ |= std::uint64_t(at_ < in_.size() ? std::uint8_t(in_[at_]) : 255) << (56 - count_);
            ++at_;
            count_ += 8;
        }
        return held_;
    }
    void skip(int bits) {
        held_ <<= bits;
        count_ -= bits;
    }
    std::size_t left() const { return at_ * 8 >= in_.size() * 8 + std::size_t(count_) ? 0 : in_.size() * 8 + std::size_t(count_) - at_ * 8; }

  private:
    std::span<const std::byte> in_;
    std::size_t at_ = 0;
    std::uint64_t held_ = 0;
    int count_ = 0;
};

class PaperCoder final : public Coder {
  public:
    CoderKind kind() const override { return CoderKind::paper; }

    void encode(const Details& d, Bytes& out) const override {
        BitWriter bits(out);
        std::size_t run = 0;
        each_row(d, [&](const std::int32_t* q, int n) {
            for (int x = 0; x < n; ++x) {
                if (q[x] == 0) {
                    ++run;
                    continue;
                }
                for (; run > 0; run -= std::min(run, kLongestRun)) bits.put(std::min(run, kLongestRun) - 1, 8);
                const std::uint64_t v = q[x] > 0 ? 2 * std::uint64_t(q[x]) - 1 : 2 * std::uint64_t(-std::int64_t(q[x]));
                const int length = std::bit_width(v);
                if (length > kMostBits) fail("a coefficient of {} is too large for the paper's code", q[x]);
                bits.put((std::uint64_t(1) << (length + 1)) - 2, length + 1);
                bits.put(v - (std::uint64_t(1) << (length - 1)), length - 1);
            }
        });
        bits.finish();
    }

    void decode(std::span<const std::byte> in, Details& d) const override {
        clear_bands(d);
        BitReader bits(in);
        std::size_t run = 0;
        each_row(d, [&](std::int32_t* q, int n) {
            for (int x = 0; x < n; ++x) {
                if (run > 0) {
                    const int skip = int(std::min<std::size_t>(run, std::size_t(n - x)));
                    run -= std::size_t(skip);
                    x += skip - 1;
                    continue;
                }
                const std::uint64_t next = bits.peek();
                if (!(next >> 63)) {
                    run = (next >> 56) + 1;
                    bits.skip(8);
                    --x;
                    continue;
                }
                const int length = std::countl_one(next);
                if (std::size_t(length) >= bits.left()) {  // only padding is left: zeros to the end
                    run = ~std::size_t(0);
                    --x;
                    continue;
                }
                if (length > kMostBits) fail("a number is out of range");
                bits.skip(length + 1);
                std::uint64_t v = std::uint64_t(1) << (length - 1);
                if (length > 1) v |= bits.peek() >> (65 - length);
                bits.skip(length - 1);
                q[x] = v & 1 ? std::int32_t((v + 1) / 2) : -std::int32_t(v / 2);
            }
        });
        if (run > 0 && run <= kLongestRun) fail("a run goes beyond the end");
    }

  private:
    static constexpr int kMostBits = 31;
    template <class Row>
    static void each_row(const Details& d, const Row& row) {
        for (int mask : kBandOrder) {
            const Band b = d.shape.band(mask);
            if (!d.shape.has(b)) continue;
            for (int z = 0; z < b.dims.z; ++z)
                for (int y = 0; y < b.dims.y; ++y) row(d.q + d.shape.at(b.lo + glm::ivec3(0, y, z)), b.dims.x);
        }
    }
};

}  // namespace

std::unique_ptr<Coder> make_paper_coder() { return std::make_unique<PaperCoder>(); }

}  // namespace voxloom::wavelet
