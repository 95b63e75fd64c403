// At low rates these numbers are a good part of a file, so they are no finer than they need be, and each is
// predicted by its neighbours and its parent; how well those were predicted tells how large it will be.
#include "plugins/codec-wavelet/statistics_code.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "core/base/error.h"
#include "plugins/codec-wavelet/adaptive_number.h"
#include "plugins/codec-wavelet/wavelet_bricks.h"

namespace voxloom::wavelet {

namespace {

// Errors on a logarithmic scale; 0 is 0. Versions before 4 had 128 steps an octave.
constexpr double kErrorSteps = 16, kErrorStepsBefore4 = 128;
constexpr int kShareSteps = 63, kShareStepsBefore4 = 255;

std::uint16_t error_code(double error, bool up) {
    if (!(error > 0)) return 0;
    const double x = (std::log2(error) + 200) * kErrorSteps;
    return std::uint16_t(std::clamp(up ? std::ceil(x) : std::round(x), 1.0, 65535.0));
}
double from_error_code(std::uint16_t code, double steps) { return code ? std::exp2(code / steps - 200) : 0; }

// Exact for integers of 16 bits that lose nothing. Where values are wrong by the quantiser's step anyway, an
// eighth of it is fine enough.
RangeScale scale_of(const TreeIndex& index) {
    double lo = std::numeric_limits<double>::infinity(), hi = -lo;
    for (std::size_t l = 0; l < index.tree.bricks.levels.size(); ++l)
        for (std::size_t i = 0; i < index.bricks_of_level(int(l)); ++i) {
            const ValueRange range = index.info(int(l), i).range;
            lo = std::min(lo, range.min);
            hi = std::max(hi, range.max);
        }
    if (!(lo <= hi)) return {};
    RangeScale scale{lo, 1};
    if (is_float(index.tree.bricks.volume.type) || hi - lo > 65535) {
        scale.step = hi / 65535 - lo / 65535;
        while (scale.value(65535) < hi) scale.step = std::nextafter(scale.step, std::numeric_limits<double>::infinity());
    }
    const double useful = index.tree.quantiser.step * index.tree.map.step / 8;
    if (useful > 0) scale.step = std::max(scale.step, std::exp2(std::floor(std::log2(useful))));
    if (!(scale.step > 0)) scale.step = 1;
    return scale;
}

class StatisticsCoding {
  public:
    explicit StatisticsCoding(const BricksDesc& desc) : desc_(desc) {}

    // Levels come from the coarsest to the finest. A decoder fills `codes`, which have their size already.
    template <class Coding>
    void code_level(Coding& coding, int level, std::vector<BrickCodes>& codes) {
        const glm::i64vec3 n(desc_.levels[std::size_t(level)].bricks);
        for (auto& residuals : residuals_) residuals.assign(codes.size(), 0);
        std::size_t i = 0;
        for (std::int64_t z = 0; z < n.z; ++z)
            for (std::int64_t y = 0; y < n.y; ++y)
                for (std::int64_t x = 0; x < n.x; ++x, ++i) {
                    const BrickId id{level, glm::ivec3(x, y, z)};
                    Nearby nearby;
                    if (x > 0) nearby.add(i - 1);
                    if (y > 0) nearby.add(i - std::size_t(n.x));
                    if (z > 0) nearby.add(i - std::size_t(n.x * n.y));
                    if (const auto parent = desc_.coarser(id)) {
                        const glm::i64vec3 m(desc_.levels[std::size_t(level) + 1].bricks), p(parent->index);
                        nearby.parent = &above_[std::size_t((p.z * m.y + p.y) * m.x + p.x)];
                    }
                    for (std::size_t column = 0; column < 4; ++column) code_number(coding, column, i, nearby, codes);
                    if (level > 0 && codes[i].number[2] > 0) code_shares(coding, id, codes[i]);
                }
        above_ = codes;
    }

  private:
    struct Nearby {
        std::array<std::size_t, 3> at{};  // bricks of the same level that are coded already
        std::size_t count = 0;
        const BrickCodes* parent = nullptr;
        void add(std::size_t i) { at[count++] = i; }
    };

    // The middle of what stands around, or of the middle two.
    static std::uint16_t predicted(std::size_t column, const Nearby& nearby, const std::vector<BrickCodes>& codes) {
        std::array<std::int32_t, 4> values{};
        std::size_t n = 0;
        const auto add = [&](const BrickCodes& c) {  // in order
            const std::int32_t value = column == 3 ? std::int16_t(c.number[3]) : c.number[column];
            std::size_t k = n++;
            for (; k > 0 && values[k - 1] > value; --k) values[k] = values[k - 1];
            values[k] = value;
        };
        for (std::size_t k = 0; k < nearby.count; ++k) add(codes[nearby.at[k]]);
        if (nearby.parent) add(*nearby.parent);
        if (n == 0) return 0;
        return std::uint16_t((values[(n - 1) / 2] + values[n / 2]) / 2);
    }

    template <class Coding>
    void code_number(Coding& coding, std::size_t column, std::size_t i, const Nearby& nearby, std::vector<BrickCodes>& codes) {
        auto& residuals = residuals_[column];
        std::uint32_t around = 0;
        for (std::size_t k = 0; k < nearby.count; ++k) around += residuals[nearby.at[k]];
        const std::uint16_t guess = predicted(column, nearby, codes);
        const std::uint16_t folded = folded_of(std::uint16_t(codes[i].number[column] - guess));
        const std::uint16_t got = models_[column].code(coding, folded, std::bit_width(around));
        residuals[i] = std::uint32_t(got + 1) / 2;
        codes[i].number[column] = std::uint16_t(guess + unfolded(got));
    }

    // What the octants before have left is shared equally, as far as anyone knows.
    template <class Coding>
    void code_shares(Coding& coding, BrickId id, BrickCodes& codes) {
        int left = kShareSteps * kShareSteps;
        const auto children = desc_.finer(id);
        auto remaining = int(children.size());
        for (const BrickId& child : children) {
            std::uint8_t& share = codes.share[std::size_t(desc_.octant_of(child))];
            const auto guess = std::uint16_t(std::sqrt(double(std::max(left, 0) / remaining)));
            const int context = 2 * remaining + (left > kShareSteps * kShareSteps / 4);
            const std::uint16_t got = shares_.code(coding, folded_of(std::uint16_t(share - guess)), context);
            share = std::uint8_t(guess + unfolded(got));
            left -= share * share;
            --remaining;
        }
    }

    // Differences modulo 2^16: 0, -1, 1, -2, 2 become 0, 1, 2, 3, 4.
    static std::uint16_t folded_of(std::uint16_t d) { return std::uint16_t(d & 0x8000 ? ~(d << 1) : d << 1); }
    static std::uint16_t unfolded(std::uint16_t f) { return std::uint16_t(f & 1 ? ~(f >> 1) : f >> 1); }

    const BricksDesc& desc_;
    std::array<AdaptiveNumber, 4> models_;
    AdaptiveNumber shares_;
    std::array<std::vector<std::uint32_t>, 4> residuals_;  // of this level: how far predictions were off
    std::vector<BrickCodes> above_;
};

// What versions before 4 had: for each level, finest first, columns of differences from the brick before.
std::vector<std::uint16_t> column_before_4(std::size_t count, ByteReader& reader) {
    RangeDecoder decoder(reader.block());
    AdaptiveNumber model;
    std::vector<std::uint16_t> column(count);
    std::uint16_t last = 0;
    for (std::uint16_t& v : column) {
        const auto folded = model.code(decoder, std::uint16_t(0));
        v = last = std::uint16_t(last + (folded & 1 ? ~(folded >> 1) : folded >> 1));
    }
    return column;
}
void read_codes_before_4(std::vector<std::vector<BrickCodes>>& levels, ByteReader& reader) {
    for (std::size_t l = 0; l < levels.size(); ++l) {
        auto& codes = levels[l];
        for (std::size_t column = 0; column < (l > 0 ? 12 : 4); ++column) {
            const auto values = column_before_4(codes.size(), reader);
            for (std::size_t i = 0; i < codes.size(); ++i) {
                if (column < 3)
                    codes[i].number[column] = values[i];
                else if (column == 3)
                    codes[i].number[3] = std::uint16_t(values[i] - codes[i].number[2]);
                else
                    codes[i].share[column - 4] = std::uint8_t(values[i]);
            }
        }
    }
}

}  // namespace

std::uint16_t RangeScale::below(double v) const {
    auto code = std::int64_t(std::clamp(std::floor((v - lo) / step), 0.0, 65535.0));
    while (code > 0 && value(code) > v) --code;
    return std::uint16_t(code);
}
std::uint16_t RangeScale::above(double v) const {
    auto code = std::int64_t(std::clamp(std::ceil((v - lo) / step), 0.0, 65535.0));
    while (code < 65535 && value(code) < v) ++code;
    return std::uint16_t(code);
}

BrickInfo CodedStatistics::info(int level, std::size_t brick) const {
    const BrickCodes& c = levels[std::size_t(level)][brick];
    BrickInfo info;
    info.range.min = scale.value(c.number[0]);
    info.range.max = scale.value(std::min(c.number[0] + c.number[1], 65535));
    info.l2 = from_error_code(c.number[2], error_steps);
    info.max_error = from_error_code(std::uint16_t(c.number[3] + c.number[2]), error_steps);
    if (level == 0) info.octant_l2[0] = info.l2;
    for (std::size_t o = 0; o < 8 && level > 0; ++o) info.octant_l2[o] = info.l2 * c.share[o] / share_steps;
    info.exact_error = true;
    return info;
}

void write_statistics(const TreeIndex& index, ByteWriter& writer) {
    const RangeScale scale = scale_of(index);
    writer.number(scale.lo);
    writer.number(scale.step);
    Bytes part;
    RangeEncoder encoder(part);
    StatisticsCoding coding(index.tree.bricks);
    for (std::size_t l = index.tree.bricks.levels.size(); l-- > 0;) {
        std::vector<BrickCodes> codes(index.bricks_of_level(int(l)));
        for (std::size_t i = 0; i < codes.size(); ++i) {
            const BrickInfo info = index.info(int(l), i);
            BrickCodes& c = codes[i];
            c.number[0] = scale.below(info.range.min);
            c.number[1] = std::uint16_t(scale.above(info.range.max) - c.number[0]);
            c.number[2] = error_code(info.l2, false);
            c.number[3] = std::uint16_t(error_code(info.max_error, true) - c.number[2]);
            for (std::size_t o = 0; o < 8 && l > 0 && info.l2 > 0; ++o)
                c.share[o] = std::uint8_t(std::lround(kShareSteps * info.octant_l2[o] / info.l2));
        }
        coding.code_level(encoder, int(l), codes);
    }
    encoder.finish();
    writer.block(part);
}

CodedStatistics read_statistics(const BricksDesc& desc, ByteReader& reader, std::uint32_t version) {
    const bool before_4 = version < 4;
    CodedStatistics out;
    out.scale.lo = reader.number<double>();
    out.scale.step = reader.number<double>();
    if (!std::isfinite(out.scale.lo) || !(out.scale.step >= 0) || !std::isfinite(out.scale.value(65535)))
        fail("its ranges are not finite");
    out.error_steps = before_4 ? kErrorStepsBefore4 : kErrorSteps;
    out.share_steps = before_4 ? kShareStepsBefore4 : kShareSteps;
    for (const LevelDesc& level : desc.levels) out.levels.emplace_back(Box::of(Index3(level.bricks)).voxels());
    if (before_4) {
        read_codes_before_4(out.levels, reader);
        return out;
    }
    RangeDecoder decoder(reader.block());
    StatisticsCoding coding(desc);
    for (std::size_t l = out.levels.size(); l-- > 0;) coding.code_level(decoder, int(l), out.levels[l]);
    return out;
}

}  // namespace voxloom::wavelet
