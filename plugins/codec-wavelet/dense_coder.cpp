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
#include "plugins/codec-wavelet/parent_trend.h"
#include "plugins/codec-wavelet/range_coder.h"
#include "plugins/codec-wavelet/token.h"

namespace voxloom::wavelet {

namespace {

constexpr int kSteps = 24;                 // decisions of the unary part that have contexts of their own
constexpr int kInputs = 6;
constexpr int kMixers = 9;                 // sets of weights, chosen by the neighbours' sizes
constexpr int kBlock = 4;

// token_of() for a context: no more than `levels` classes, which are up to 20.
constexpr std::size_t kTabled = 1024;
const std::array<std::uint8_t, kTabled> kTokens = [] {
    std::array<std::uint8_t, kTabled> tokens{};
    for (std::size_t m = 0; m < kTabled; ++m) tokens[m] = std::uint8_t(token_of(std::uint32_t(m)));
    return tokens;
}();
int level_of(std::uint32_t m, int levels) {
    return std::min<int>(kTokens[std::min<std::size_t>(m, kTabled - 1)], levels - 1);
}

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
    // Of the band that is being coded, |q| and its sign; all bands stand on one common grid.
    Padded<std::uint16_t> size;
    Padded<std::int8_t> sign;
    std::vector<std::size_t> found;          // its places that are not zero
    std::vector<std::uint8_t> block_used;
    // Sums over the bands that are coded already: at a place, and at its six neighbours.
    Padded<std::uint32_t> across, beyond;
    std::vector<std::uint8_t> blocks_across;
    ParentTrend trend;
};

template <class Coding>
class Pass {
  public:
    Pass(Coding& coding, Model& model, Workspace& space, Details& details)
        : coding_(coding), model_(model), space_(space), d_(details) {}

    void run() {
        const glm::ivec3 low = d_.shape.low();
        space_.trend.look_at(d_);
        blocks_ = (low + kBlock - 1) / kBlock;
        space_.across.reset(low);
        space_.beyond.reset(low);
        space_.blocks_across.assign(std::size_t(blocks_.x) * std::size_t(blocks_.y) * std::size_t(blocks_.z), 0);
        for (int mask : kBandOrder) {
            const Band band = d_.shape.band(mask);
            if (!d_.shape.has(band)) continue;
            if (code_band(band)) remember_band();
        }
    }

  private:
    // The parent's sample at a place of a band: along split axes the band has but half of them.
    std::size_t place(int x, int y, int z) const {
        const glm::ivec3 low = d_.shape.low(), i = glm::ivec3(x, y, z) << glm::ivec3(d_.shape.split);
        return (std::size_t(i.z) * std::size_t(low.y) + std::size_t(i.y)) * std::size_t(low.x) + std::size_t(i.x);
    }
    std::int32_t& number(const Band& b, int x, int y, int z) const { return d_.q[d_.shape.at(b.lo + glm::ivec3(x, y, z))]; }

    // False for a band of zeros.
    bool code_band(const Band& b) {
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
            return false;
        }
        type_ = std::popcount(unsigned(b.mask)) - 1;
        space_.trend.look_at(d_, b);
        space_.size.reset(d_.shape.low());
        space_.sign.reset(d_.shape.low());
        space_.block_used.assign(space_.blocks_across.size(), 0);
        space_.found.clear();
        code_blocks(b);
        for (int z = 0; z < b.dims.z; ++z)
            for (int y = 0; y < b.dims.y; ++y)
                for (int x = 0; x < b.dims.x; x += kBlock) {
                    const int end = std::min(x + kBlock, b.dims.x);
                    if (space_.block_used[block_at(x, y, z)])
                        for (int i = x; i < end; ++i) code_number(b, i, y, z);
                    else if constexpr (Coding::kDecodes)
                        std::fill(&number(b, x, y, z), &number(b, x, y, z) + (end - x), 0);
                }
        return true;
    }

    // Adds what was found to the sums that later bands look at.
    void remember_band() {
        auto& across = space_.across;
        auto& beyond = space_.beyond;
        const std::size_t row = across.row(), plane = across.plane();
        for (const std::size_t i : space_.found) {
            const std::uint32_t size = space_.size[i];
            across[i] += size;
            for (const std::size_t step : {std::size_t(1), row, plane}) {
                beyond[i - step] += size;
                beyond[i + step] += size;
            }
        }
        for (std::size_t i = 0; i < space_.block_used.size(); ++i) space_.blocks_across[i] += space_.block_used[i];
    }

    // Classes of the trend at a place.
    static int steep(std::int32_t here, int levels) { return level_of(std::uint32_t(here) / 4, levels); }

    std::size_t block_at(int x, int y, int z) const {
        return (std::size_t(z / kBlock) * std::size_t(blocks_.y) + std::size_t(y / kBlock)) * std::size_t(blocks_.x) +
               std::size_t(x / kBlock);
    }

    void code_blocks(const Band& b) {
        auto& used = space_.block_used;
        const glm::ivec3 n = (b.dims + kBlock - 1) / kBlock;
        for (int z = 0; z < n.z; ++z)
            for (int y = 0; y < n.y; ++y)
                for (int x = 0; x < n.x; ++x) {
                    const glm::ivec3 lo = glm::ivec3(x, y, z) * kBlock, hi = glm::min(lo + kBlock, b.dims);
                    const std::size_t here = block_at(lo.x, lo.y, lo.z);
                    int nearby = 0;
                    std::int32_t curve = 0;
                    if (x > 0) nearby += used[here - 1];
                    if (y > 0) nearby += used[here - std::size_t(blocks_.x)];
                    if (z > 0) nearby += used[here - std::size_t(blocks_.x) * std::size_t(blocks_.y)];
                    bool any = false;
                    for (int k = lo.z; k < hi.z; ++k)
                        for (int j = lo.y; j < hi.y; ++j)
                            for (int i = lo.x; i < hi.x; ++i) {
                                curve = std::max(curve, space_.trend.curve[place(i, j, k)]);
                                if constexpr (!Coding::kDecodes) any = any || number(b, i, j, k) != 0;
                            }
                    const int across = std::min<int>(space_.blocks_across[here], 4);
                    used[here] = code_one(coding_, model_.block[type_][nearby][across][steep(curve, 10)], any);
                }
    }

    void code_number(const Band& b, int x, int y, int z) {
        auto& size = space_.size;
        const std::size_t i = size.at(x, y, z), row = size.row(), plane = size.plane();
        const std::uint32_t w = size[i - 1], n = size[i - row], u = size[i - plane];
        const std::uint32_t around = size[i - row - 1] + size[i - row + 1] + size[i - plane - 1] + size[i - plane + 1] +
                                     size[i - plane - row] + size[i - plane + row];
        const std::uint32_t nearby = 2 * (w + n + u) + around;
        const std::uint32_t across = space_.across[i], beyond = space_.beyond[i];
        const std::size_t at = place(x, y, z);
        const int curve = steep(space_.trend.curve[at], 14), slope = steep(space_.trend.slope[at], 14);
        const int nearby_class = level_of(nearby, 20), rough = level_of(nearby / 2, 12);
        Chance* const contexts[kInputs - 1] = {
            model_.near_cross[type_][nearby_class][level_of(across, 7)],
            model_.three[type_][level_of(w, 6)][level_of(n, 6)][level_of(u, 6)],
            model_.curve[type_][curve][rough],
            model_.slope[type_][slope][rough],
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
        const bool negative = code_sign(b, at, i, q < 0);
        if constexpr (Coding::kDecodes) q = negative ? -std::int32_t(value) : std::int32_t(value);
        size[i] = std::uint16_t(std::min<std::uint32_t>(value, 4095));
        space_.found.push_back(i);
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

    bool code_sign(const Band& b, std::size_t at, std::size_t i, bool negative) {
        const auto& sign = space_.sign;
        int foretold = 4;
        if (std::popcount(unsigned(b.mask)) == 1) {
            const int f = space_.trend.foretold[at];
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
        run(encoder, fresh_model(details), details);
        encoder.finish();
    }
    void decode(std::span<const std::byte> in, Details& details) const override {
        if (in.empty()) return clear_bands(details);
        RangeDecoder decoder(in);
        run(decoder, fresh_model(details), details);
    }

  private:
    static constexpr std::size_t kChances = offsetof(Model, weights) / sizeof(Chance);
    static Chance* chances(Model& model) { return reinterpret_cast<Chance*>(&model); }

    // A copy to learn in, which each thread keeps: memory of this size is dear to get anew.
    Model& fresh_model(const Details& details) const {
        thread_local const auto model = std::make_unique<Model>();
        *model = (*models_)[details.finest];
        return *model;
    }

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
