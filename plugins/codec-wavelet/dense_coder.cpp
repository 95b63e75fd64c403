// A number is binarised as a token (its size in half octaves, coded in unary) and the bits below it; each
// decision of the unary part is predicted by several contexts at once, and a small online-trained
// mixer (logistic mixing, Mahoney 2005) weighs them. Contexts are the neighbours already coded in the same
// band, the same place in bands already coded, and, since the parent's samples are known, the
// curvature and slope of the parent there: a detail is what linear interpolation of the parent
// misses, which is about -1/16 of the parent's second difference; that foretells its sign, too.
//
// Blocks of 4^3 zeros are flagged first and skipped, and so are whole bands: most of a volume at low
// rates costs neither time nor bits.
//
// A family must decode alone, so it cannot go on learning where another one stopped. Learning from
// nothing would cost a tenth of the rate. So the state after a training run over some families is
// stored once with the file, and every family starts from there.
#include "plugins/codec-wavelet/dense_coder.h"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <cstring>

#include "core/base/error.h"
#include "plugins/codec-wavelet/range_coder.h"
#include "plugins/codec-wavelet/token.h"

namespace voxloom::wavelet {

namespace {

constexpr int kSteps = 24;                 // decisions of the unary part that have contexts of their own
constexpr int kInputs = 6;
constexpr int kMixers = 9;                 // sets of weights, chosen by the neighbours' sizes
constexpr int kBlock = 4;

// token_of() for a context: no more than `levels` classes.
int level_of(std::uint32_t m, int levels) { return std::min(token_of(m), levels - 1); }

struct Model {
    Chance near_cross[3][20][7][kSteps];
    Chance three[3][6][6][6][kSteps];
    Chance curve[3][14][12][kSteps];
    Chance slope[3][14][12][kSteps];
    Chance across[7][16][8][kSteps];
    Chance top_bit[kMaxToken + 1][3];
    Chance sign[7][9][3][3][3];
    Chance block[3][4][5][10];
    Chance band[7][2];
    std::int32_t weights[kSteps][3][kMixers][kInputs];

    Model() {
        for (auto& step : weights)
            for (auto& type : step)
                for (auto& set : type)
                    for (auto& w : set) w = 65536 * 28 / 100;
    }
};

constexpr int kLearnLimit = 250;     // of a family: changes of 1/250 at the least
constexpr int kTrainedSeen = 24;     // trust in what the tables say, as if seen so often
constexpr int kWorthStoring = 160;   // times a chance was met in training; its entry costs about six bits
constexpr int kMixerRate = 6;

std::uint32_t usable(int p16) { return std::uint32_t(std::clamp(p16, 24, 65536 - 24)); }

template <class Coding>
bool code_one(Coding& coding, Chance& chance, bool bit) {
    bit = coding.code(bit, usable(chance.p));
    chance.learn(bit, kLearnLimit);
    return bit;
}

// Arrays over the places of a band, with a border so that no neighbour needs a test.
template <class T>
class Padded {
  public:
    void reset(glm::ivec3 dims) {
        row_ = std::size_t(dims.x) + 2;
        plane_ = row_ * (std::size_t(dims.y) + 2);
        values_.assign(plane_ * (std::size_t(dims.z) + 2), T(0));
    }
    std::size_t at(int x, int y, int z) const {
        return std::size_t(z + 1) * plane_ + std::size_t(y + 1) * row_ + std::size_t(x + 1);
    }
    T& operator[](std::size_t i) { return values_[i]; }
    const T& operator[](std::size_t i) const { return values_[i]; }
    std::size_t row() const { return row_; }
    std::size_t plane() const { return plane_; }

  private:
    std::size_t row_ = 0, plane_ = 0;
    std::vector<T> values_;
};

// Everything a pass over a family needs beside the model; kept by each thread.
struct Workspace {
    std::array<Padded<std::uint16_t>, 8> size;  // |q| of each band, bands on one common grid
    Padded<std::int8_t> sign;
    std::array<std::vector<std::int32_t>, 3> curvature, slope;  // of the parent, along each axis
    std::array<std::vector<std::uint8_t>, 8> block_used;
    std::vector<std::int32_t> curve_here, slope_here, foretold;
};

// s[i-1] - s[i] - s[i+1] + s[i+2] and |s[i+1] - s[i]| along an axis, at the odd samples between.
void parent_derivatives(const Details& d, int axis, std::vector<std::int32_t>& curvature,
                        std::vector<std::int32_t>& slope) {
    const glm::ivec3 n = d.shape.low();
    const std::size_t stride = axis == 0 ? 1 : axis == 1 ? std::size_t(n.x) : std::size_t(n.x) * std::size_t(n.y);
    const std::size_t count = std::size_t(n.x) * std::size_t(n.y) * std::size_t(n.z);
    curvature.resize(count);
    slope.resize(count);
    std::size_t i = 0;
    for (int z = 0; z < n.z; ++z)
        for (int y = 0; y < n.y; ++y)
            for (int x = 0; x < n.x; ++x, ++i) {
                const int at = axis == 0 ? x : axis == 1 ? y : z, last = n[axis] - 1;
                const std::int64_t b = d.low[i], c = at < last ? d.low[i + stride] : b;
                const std::int64_t a = at > 0 ? d.low[i - stride] : b - (c - b);
                const std::int64_t e = at + 2 <= last ? d.low[i + 2 * stride] : c + (c - b);
                constexpr std::int64_t most = 1 << 30;
                curvature[i] = std::int32_t(std::clamp(a - b - c + e, -most, most));
                slope[i] = std::int32_t(std::min(std::abs(c - b), most));
            }
}

template <class Coding>
class Pass {
  public:
    Pass(Coding& coding, Model& model, Workspace& space, Details& details)
        : coding_(coding), model_(model), space_(space), d_(details) {}

    void run() {
        const glm::ivec3 low = d_.shape.low();
        for (int a = 0; a < 3; ++a)
            if (d_.shape.halved[a]) parent_derivatives(d_, a, space_.curvature[std::size_t(a)], space_.slope[std::size_t(a)]);
        done_ = 0;
        for (int mask : kBandOrder) {
            const Band band = d_.shape.band(mask);
            if (!d_.shape.has(band)) continue;
            space_.size[std::size_t(mask)].reset(low);
            blocks_ = (low + kBlock - 1) / kBlock;
            space_.block_used[std::size_t(mask)].assign(
                std::size_t(blocks_.x) * std::size_t(blocks_.y) * std::size_t(blocks_.z), 0);
            code_band(band);
            done_ |= 1 << mask;
        }
    }

  private:
    // The parent's sample at a place of a band: along split axes the band has but half of them.
    std::size_t place(int x, int y, int z) const {
        const glm::ivec3 low = d_.shape.low(), i = glm::ivec3(x, y, z) << glm::ivec3(d_.shape.split);
        return (std::size_t(i.z) * std::size_t(low.y) + std::size_t(i.y)) * std::size_t(low.x) + std::size_t(i.x);
    }
    std::int32_t& number(const Band& b, int x, int y, int z) const { return d_.q[d_.shape.at(b.lo + glm::ivec3(x, y, z))]; }

    void code_band(const Band& b) {
        bool any = false;
        if constexpr (!Coding::kDecodes)
            for (int z = 0; z < b.dims.z && !any; ++z)
                for (int y = 0; y < b.dims.y && !any; ++y)
                    for (int x = 0; x < b.dims.x && !any; ++x) any = number(b, x, y, z) != 0;
        any = code_one(coding_, model_.band[b.mask - 1][any_band_], any);
        any_band_ = any;
        if (!any) {
            if constexpr (Coding::kDecodes)
                for (int z = 0; z < b.dims.z; ++z)
                    for (int y = 0; y < b.dims.y; ++y) std::fill_n(&number(b, 0, y, z), b.dims.x, 0);
            return;
        }
        type_ = std::popcount(unsigned(b.mask)) - 1;
        foretell(b);
        space_.sign.reset(d_.shape.low());
        code_blocks(b);
        for (int z = 0; z < b.dims.z; ++z)
            for (int y = 0; y < b.dims.y; ++y)
                for (int x = 0; x < b.dims.x; ++x) {
                    if (space_.block_used[std::size_t(b.mask)][block_at(x, y, z)])
                        code_number(b, x, y, z);
                    else if constexpr (Coding::kDecodes)
                        number(b, x, y, z) = 0;
                }
    }

    // What the parent says of each place of the band, in units of the band's step.
    void foretell(const Band& b) {
        const std::size_t count = space_.curvature[0].size() | space_.curvature[1].size() | space_.curvature[2].size();
        space_.curve_here.assign(count, 0);
        space_.slope_here.assign(count, 0);
        space_.foretold.assign(count, 0);
        // 8 levels a step; the band's numbers are -1/16 of the curvature along each of its axes.
        const std::int64_t scale = std::int64_t(65536.0 * 8 / std::max(1.0, d_.step[std::size_t(b.mask)]));
        for (int a = 0; a < 3; ++a) {
            if (!(b.mask >> a & 1) || !d_.shape.halved[a]) continue;
            const auto& curvature = space_.curvature[std::size_t(a)];
            const auto& slope = space_.slope[std::size_t(a)];
            constexpr std::int64_t most = 1 << 24;
            for (std::size_t i = 0; i < curvature.size(); ++i) {
                const std::int64_t c = std::clamp(curvature[i] * scale >> 16, -most, most);
                space_.curve_here[i] += std::int32_t(std::abs(c));
                space_.slope_here[i] += std::int32_t(std::min(slope[i] * scale >> 16, most));
                space_.foretold[i] = std::int32_t(-c);
            }
        }
        for (auto& v : space_.curve_here) v = level_of(std::uint32_t(v) / 4, 64);
        for (auto& v : space_.slope_here) v = level_of(std::uint32_t(v) / 4, 64);
    }

    std::size_t block_at(int x, int y, int z) const {
        return (std::size_t(z / kBlock) * std::size_t(blocks_.y) + std::size_t(y / kBlock)) * std::size_t(blocks_.x) +
               std::size_t(x / kBlock);
    }

    void code_blocks(const Band& b) {
        auto& used = space_.block_used[std::size_t(b.mask)];
        const glm::ivec3 n = (b.dims + kBlock - 1) / kBlock;
        for (int z = 0; z < n.z; ++z)
            for (int y = 0; y < n.y; ++y)
                for (int x = 0; x < n.x; ++x) {
                    const glm::ivec3 lo = glm::ivec3(x, y, z) * kBlock, hi = glm::min(lo + kBlock, b.dims);
                    const std::size_t here = block_at(lo.x, lo.y, lo.z);
                    int nearby = 0, across = 0, curve = 0;
                    if (x > 0) nearby += used[here - 1];
                    if (y > 0) nearby += used[here - std::size_t(blocks_.x)];
                    if (z > 0) nearby += used[here - std::size_t(blocks_.x) * std::size_t(blocks_.y)];
                    for (int m = 1; m < 8; ++m)
                        if (done_ >> m & 1) across += space_.block_used[std::size_t(m)][here];
                    bool any = false;
                    for (int k = lo.z; k < hi.z; ++k)
                        for (int j = lo.y; j < hi.y; ++j)
                            for (int i = lo.x; i < hi.x; ++i) {
                                curve = std::max(curve, space_.curve_here[place(i, j, k)]);
                                if constexpr (!Coding::kDecodes) any = any || number(b, i, j, k) != 0;
                            }
                    used[here] = code_one(coding_, model_.block[type_][nearby][std::min(across, 4)][std::min(curve, 9)], any);
                }
    }

    void code_number(const Band& b, int x, int y, int z) {
        auto& size = space_.size[std::size_t(b.mask)];
        const std::size_t i = size.at(x, y, z), row = size.row(), plane = size.plane();
        const std::uint32_t w = size[i - 1], n = size[i - row], u = size[i - plane];
        const std::uint32_t around = size[i - row - 1] + size[i - row + 1] + size[i - plane - 1] + size[i - plane + 1] +
                                     size[i - plane - row] + size[i - plane + row];
        const std::uint32_t nearby = 2 * (w + n + u) + around;
        std::uint32_t across = 0, beyond = 0;
        for (int m = 1; m < 8; ++m)
            if (done_ >> m & 1) {
                const auto& other = space_.size[std::size_t(m)];
                across += other[i];
                beyond += other[i - 1] + other[i + 1] + other[i - row] + other[i + row] + other[i - plane] + other[i + plane];
            }
        const int curve = space_.curve_here[place(x, y, z)], slope = space_.slope_here[place(x, y, z)];
        const int nearby_class = level_of(nearby, 20), rough = level_of(nearby / 2, 12);
        Chance* const contexts[kInputs - 1] = {
            model_.near_cross[type_][nearby_class][level_of(across, 7)],
            model_.three[type_][level_of(w, 6)][level_of(n, 6)][level_of(u, 6)],
            model_.curve[type_][std::min(curve, 13)][rough],
            model_.slope[type_][std::min(slope, 13)][rough],
            model_.across[b.mask - 1][level_of(2 * across + beyond, 16)][level_of(nearby, 8)],
        };

        std::int32_t& q = number(b, x, y, z);
        std::uint32_t magnitude = 0;
        int token = 0;
        if constexpr (!Coding::kDecodes) {
            magnitude = q < 0 ? 0u - std::uint32_t(q) : std::uint32_t(q);
            token = token_of(magnitude);
        }
        int t = 0;
        const int mixer = level_of(nearby / 2, kMixers);
        while (code_more(contexts, mixer, t, token > t))
            if (++t > kMaxToken) fail("a number is out of range");
        const int bits = low_bits_of(t);
        std::uint32_t value = first_of(t), rest = magnitude - value;
        if constexpr (Coding::kDecodes) rest = 0;
        std::uint32_t got = 0;
        for (int bit = bits - 1; bit >= 0; --bit) {
            const bool one = rest >> bit & 1;
            const int depth = bits - 1 - bit;
            const bool b1 = depth < 3 ? code_one(coding_, model_.top_bit[t][depth], one) : coding_.code(one, 32768);
            got = got << 1 | std::uint32_t(b1);
        }
        value += got;
        if (value == 0) {
            q = 0;
            return;
        }
        const bool negative = code_sign(b, x, y, z, i, q < 0);
        if constexpr (Coding::kDecodes) q = negative ? -std::int32_t(value) : std::int32_t(value);
        size[i] = std::uint16_t(std::min<std::uint32_t>(value, 4095));
        space_.sign[i] = negative ? -1 : 1;
    }

    // Is the token larger than t?
    bool code_more(Chance* const* contexts, int mixer, int t, bool more) {
        const int step = std::min(t, kSteps - 1);
        std::int32_t* const weights = model_.weights[step][type_][mixer];
        int inputs[kInputs];
        std::int64_t sum = 0;
        for (int k = 0; k < kInputs - 1; ++k) {
            inputs[k] = stretch(contexts[k][step].p);
            sum += std::int64_t(weights[k]) * inputs[k];
        }
        inputs[kInputs - 1] = 256;
        sum += std::int64_t(weights[kInputs - 1] - 65536 * 28 / 100) * 256;
        const int p = squash(int(std::clamp<std::int64_t>(sum >> 16, -2047, 2047)));
        more = coding_.code(more, usable(p));
        const int error = ((int(more) << 16) - p) >> 4;
        for (int k = 0; k < kInputs; ++k) weights[k] += (inputs[k] * error * kMixerRate + 0x8000) >> 16;
        for (int k = 0; k < kInputs - 1; ++k) contexts[k][step].learn(more, kLearnLimit);
        return more;
    }

    bool code_sign(const Band& b, int x, int y, int z, std::size_t i, bool negative) {
        const auto& sign = space_.sign;
        int foretold = 4;
        if (std::popcount(unsigned(b.mask)) == 1) {
            const int f = space_.foretold[place(x, y, z)];
            const int strength = std::min(4, (token_of(std::uint32_t(std::abs(f)) / 8) + 1) / 2);
            foretold = 4 + (f < 0 ? -strength : strength);
        }
        Chance& chance = model_.sign[b.mask - 1][foretold][sign[i - 1] + 1][sign[i - sign.row()] + 1]
                                    [sign[i - sign.plane()] + 1];
        return code_one(coding_, chance, negative);
    }

    Coding& coding_;
    Model& model_;
    Workspace& space_;
    Details& d_;
    int done_ = 0;  // bit m: band m is coded
    int any_band_ = 1;
    int type_ = 0;
    glm::ivec3 blocks_{0};
};

// Tables: for every chance whether enough was learned of it to be worth its bits, and then its logit in
// 64 levels; and the mixers' weights. All of it range coded, since most chances were hardly used.
template <class Coding>
std::uint32_t code_bits(Coding& coding, std::vector<Chance>& tree, std::uint32_t value, int bits) {
    std::uint32_t node = 1;
    for (int i = bits - 1; i >= 0; --i) {
        Chance& chance = tree[node];
        node = node << 1 | std::uint32_t(code_one(coding, chance, value >> i & 1));
    }
    return node - (1u << bits);
}

template <class Coding>
void code_tables(Coding& coding, Chance* all, std::size_t count, Model& model) {
    std::vector<Chance> used(4), logit(64), weight(256);
    std::uint32_t before = 0;
    for (std::size_t i = 0; i < count; ++i) {
        const bool any = code_one(coding, used[before], all[i].seen >= kWorthStoring);
        before = (before << 1 | std::uint32_t(any)) & 3;
        if (!any) {
            all[i] = Chance();
            continue;
        }
        const std::uint32_t at = code_bits(coding, logit, std::uint32_t(stretch(all[i].p) + 2047) >> 6, 6);
        all[i].p = std::uint16_t(squash((int(at) << 6) + 32 - 2047));
        all[i].seen = kTrainedSeen;
    }
    for (auto& step : model.weights)
        for (auto& type : step)
            for (auto& set : type)
                for (std::int32_t& w : set) {
                    const int level = std::clamp((w >> 10) + 128, 0, 255);
                    w = (std::int32_t(code_bits(coding, weight, std::uint32_t(level), 8)) - 128) * 1024 + 512;
                }
}

class DenseCoder final : public Coder {
  public:
    explicit DenseCoder(std::span<const std::byte> tables) : models_(std::make_unique<std::array<Model, 2>>()) {
        if (tables.empty()) return;
        RangeDecoder decoder(tables);
        for (Model& model : *models_) code_tables(decoder, chances(model), kChances, model);
        tables_.assign(tables.begin(), tables.end());
    }

    CoderKind kind() const override { return CoderKind::dense; }

    void train(const Details& details) override {
        RangeCounter counter;
        run(counter, (*models_)[details.finest], details);
    }
    void finish_training() override {
        RangeEncoder encoder(tables_);
        for (Model& model : *models_) code_tables(encoder, chances(model), kChances, model);
        encoder.finish();
    }
    Bytes tables() const override { return tables_; }

    void encode(const Details& details, Bytes& out) const override {
        if (all_zero(details)) return;
        RangeEncoder encoder(out);
        auto model = std::make_unique<Model>((*models_)[details.finest]);
        run(encoder, *model, details);
        encoder.finish();
    }
    void decode(std::span<const std::byte> in, Details& details) const override {
        if (in.empty()) return clear_bands(details);
        RangeDecoder decoder(in);
        auto model = std::make_unique<Model>((*models_)[details.finest]);
        run(decoder, *model, details);
    }

  private:
    static constexpr std::size_t kChances = offsetof(Model, weights) / sizeof(Chance);
    static Chance* chances(Model& model) { return reinterpret_cast<Chance*>(&model); }

    template <class Coding>
    static void run(Coding& coding, Model& model, const Details& details) {
        thread_local Workspace space;
        Details copy = details;
        Pass<Coding>(coding, model, space, copy).run();
    }

    std::unique_ptr<std::array<Model, 2>> models_;  // [1]: of the finest families
    Bytes tables_;
};

}  // namespace

std::unique_ptr<Coder> make_dense_coder(std::span<const std::byte> tables) {
    return std::make_unique<DenseCoder>(tables);
}

}  // namespace voxloom::wavelet
