#include "plugins/codec-wavelet/coefficient_counts.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "plugins/codec-wavelet/passes.h"
#include "plugins/codec-wavelet/token.h"

namespace voxloom::wavelet {

namespace {

int bin_of(std::uint32_t m) {
    if (m < CoefficientCounts::kExact) return int(m);
    const int octave = std::bit_width(m) - 1;  // 6 to 31
    return CoefficientCounts::kExact + 8 * (octave - 6) + int(m >> (octave - 3) & 7);
}

// Calls use(size, weight) for sizes that stand for the bin.
template <class Use>
void each_size(int bin, const Use& use) {
    if (bin < CoefficientCounts::kExact) return use(double(bin), 1.0);
    const int octave = 6 + (bin - CoefficientCounts::kExact) / 8;
    const double width = std::ldexp(1.0, octave - 3), first = (8 + (bin - CoefficientCounts::kExact) % 8) * width;
    for (int k = 0; k < 4; ++k) use(first + (k + 0.5) / 4 * width, 0.25);
}

// As the quantiser does it, but for its wider zone where numbers are few.
double number_of(double size, double step) {
    if (step <= 1) return size;
    return size < kDeadZone * step ? 0 : std::max(1.0, std::floor(size / step + kRoundUp));
}

}  // namespace

void CoefficientCounts::Bands::add(const Shape& shape, const std::int32_t* box) {
    voxels += shape.voxels();
    for (const int mask : kBandOrder) {
        const Band band = shape.band(mask);
        if (!shape.has(band)) continue;
        auto& counts = count[std::size_t(mask)];
        for (int z = 0; z < band.dims.z; ++z)
            for (int y = 0; y < band.dims.y; ++y) {
                const std::int32_t* row = box + shape.at(band.lo + glm::ivec3(0, y, z));
                for (int x = 0; x < band.dims.x; ++x)
                    ++counts[std::size_t(bin_of(row[x] < 0 ? 0u - std::uint32_t(row[x]) : std::uint32_t(row[x])))];
            }
    }
}

void CoefficientCounts::add(int level, const Bands& bands, double weight) {
    Level& to = levels_[std::size_t(level)];
    for (std::size_t m = 0; m < to.count.size(); ++m)
        for (std::size_t b = 0; b < to.count[m].size(); ++b) to.count[m][b] += weight * bands.count[m][b];
    to.voxels += weight * double(bands.voxels);
}

bool CoefficientCounts::empty() const {
    return levels_.empty() || std::any_of(levels_.begin(), levels_.end(), [](const Level& l) { return l.voxels == 0; });
}

// of_band(counts, norm of the band) summed up, levels weighed by what of them was counted.
template <class OfBand>
double CoefficientCounts::sum(const TreeDesc& tree, const OfBand& of_band) const {
    double all = 0;
    for (std::size_t l = 0; l < levels_.size(); ++l) {
        const Shape shape = shape_of(tree, family_at(tree, int(l), 0));
        double level = 0;
        for (const int mask : kBandOrder)
            if (shape.has(shape.band(mask)))
                level += of_band(levels_[l].count[std::size_t(mask)],
                                 band_norm(mask, tree.bricks.levels[l].stride,
                                           glm::bvec3(glm::ivec3(shape.halved) | glm::ivec3(shape.split))));
        const double voxels = double(Box::of(tree.bricks.levels[l].dims).voxels()) * tree.bricks.volume.components;
        all += level * voxels / levels_[l].voxels;
    }
    return all / double(tree.bricks.volume.voxels());
}

double CoefficientCounts::squares(const TreeDesc& tree) const {
    const Quantiser& q = tree.quantiser;
    return sum(tree, [&](const auto& counts, double norm) {
        const double step = std::max(1.0, q.step / norm);
        if (step <= 1) return 0.0;
        double squares = 0;
        for (int b = 0; b < kBins; ++b)
            if (counts[std::size_t(b)] > 0)
                each_size(b, [&](double size, double weight) {
                    const double n = number_of(size, step), value = n == 0 ? 0 : (n + (n == 1 ? q.centre_one : q.centre_more)) * step;
                    squares += weight * counts[std::size_t(b)] * (size - value) * (size - value);
                });
        return squares * norm * norm;
    });
}

double CoefficientCounts::bits(const TreeDesc& tree) const {
    return sum(tree, [&](const auto& counts, double norm) {
        const double step = std::max(1.0, tree.quantiser.step / norm);
        std::array<double, kMaxToken + 1> tokens{};
        double all = 0, bits = 0;
        for (int b = 0; b < kBins; ++b)
            if (counts[std::size_t(b)] > 0)
                each_size(b, [&](double size, double weight) {
                    const double n = std::min(number_of(size, step), 2147483647.0), some = weight * counts[std::size_t(b)];
                    const int token = token_of(std::uint32_t(n));
                    tokens[std::size_t(token)] += some;
                    all += some;
                    bits += some * (low_bits_of(token) + (token > 0));
                });
        for (const double some : tokens)
            if (some > 0) bits += some * std::log2(all / some);
        return bits;
    });
}

}  // namespace voxloom::wavelet
