#include "plugins/render-slicer/tables.h"

#include <algorithm>
#include <cmath>

#include "core/base/parallel.h"

namespace voxloom::slicer {

namespace {

// Light through a piece of the ray: what it emits towards the front, and what it lets through. The
// depth is carried along as a sum of its own: a difference of prefix sums would lose all that stands
// behind an opaque value.
struct Piece {
    glm::dvec3 light{0.0};
    double transmittance = 1;
    double depth = 0;
};
Piece behind(const Piece& front, const Piece& back) {
    return {front.light + front.transmittance * back.light, front.transmittance * back.transmittance,
            front.depth + back.depth};
}

// Beyond this the exponential is 0 in double; the table keeps finite floats.
constexpr double kLargestDepth = 1e30;

glm::vec4 entry(const Piece& piece) {
    if (!(piece.depth > 0)) return glm::vec4(0.0f);
    const double depth = std::min(piece.depth, kLargestDepth);
    const double alpha = -std::expm1(-depth);
    return glm::vec4(glm::dvec4(piece.light / alpha, 1.0) * depth);
}

// Mean emission between each two of n nodes.
std::vector<Emission> means_of(const TransferFunction1D& tf, ValueRange range, int n) {
    const double bin = range.extent() / (n - 1);
    std::vector<Emission> mean;
    for (int i = 0; i + 1 < n; ++i)
        mean.push_back(tf.integral(range.min + bin * i, range.min + bin * (i + 1)) / bin);
    return mean;
}

}  // namespace

bool has_narrow_peak(const TransferFunction1D& tf, ValueRange range, int n) {
    const std::vector<Emission> mean = means_of(tf, range, n);
    const auto at = [&](int i) { return mean[std::size_t(std::clamp(i, 0, n - 2))].a; };
    for (int i = 0; i + 1 < n; ++i)
        if (at(i) > 2 * std::max(at(i - 2), at(i + 2))) return true;
    return false;
}

std::vector<float> depth_integral(const TransferFunction1D& tf, ValueRange range, int n, double d) {
    std::vector<double> sum = {0};
    for (const Emission& e : means_of(tf, range, n)) sum.push_back(sum.back() + std::min(d * e.a / (n - 1), kOpaqueBin));
    std::vector<float> integral;
    for (double s : sum) integral.push_back(float(s - 0.5 * sum.back()));
    return integral;
}

std::vector<glm::vec4> preintegrated_table(const TransferFunction1D& tf, ValueRange range, int n,
                                           double d, const std::stop_token& stop) {
    const std::vector<Emission> mean = means_of(tf, range, n);
    std::vector<glm::vec4> table(std::size_t(n) * std::size_t(n));
    auto at = [&](int f, int b) -> glm::vec4& {
        return table[std::size_t(b) * std::size_t(n) + std::size_t(f)];
    };
    // The diagonal is the mean of its two segments: the point value would lose, or multiply, a peak
    // narrower than a bin.
    for (int i = 0; i < n; ++i) {
        const Emission e = 0.5 * (mean[std::size_t(std::max(i - 1, 0))] +
                                  mean[std::size_t(std::min(i, n - 2))]);
        const double depth = std::min(d * e.a, kLargestDepth);
        const glm::dvec3 c = e.a > 0 ? glm::dvec3(e) / e.a : glm::dvec3(0.0);
        at(i, i) = glm::vec4(glm::dvec4(c, 1.0) * depth);
    }
    // Windows of m segments, each 1/m of the slab thick. Blocks of m segments hold the products of
    // their beginnings and of their ends, so a window is one product of an end and a beginning.
    parallel_for(1, n, 8, [&](std::int64_t lo, std::int64_t hi) {
        const std::size_t segments = std::size_t(n - 1);
        std::vector<Piece> piece(segments), begin(segments), end(segments), begin_down(segments),
            end_down(segments);
        for (std::int64_t window = lo; window < hi; ++window) {
            check_stop(stop);
            const std::size_t m = std::size_t(window);
            const double thickness = d / double(m);
            for (std::size_t i = 0; i < segments; ++i) {
                const double depth = std::min(thickness * mean[i].a, kLargestDepth);
                const double alpha = -std::expm1(-depth);
                const glm::dvec3 c = mean[i].a > 0 ? glm::dvec3(mean[i]) / mean[i].a : glm::dvec3(0.0);
                piece[i] = {c * alpha, 1 - alpha, depth};
            }
            // Up: the front is the low value. Down: the front is the high one.
            for (std::size_t i = 0; i < segments; ++i) {
                const bool first = i % m == 0;
                begin[i] = first ? piece[i] : behind(begin[i - 1], piece[i]);
                begin_down[i] = first ? piece[i] : behind(piece[i], begin_down[i - 1]);
            }
            for (std::size_t i = segments; i-- > 0;) {
                const bool last = i % m == m - 1 || i + 1 == segments;
                end[i] = last ? piece[i] : behind(piece[i], end[i + 1]);
                end_down[i] = last ? piece[i] : behind(end_down[i + 1], piece[i]);
            }
            for (std::size_t i = 0; i + m <= segments; ++i) {
                const std::size_t last = i + m - 1;
                const bool whole = i % m == 0;
                const Piece up = whole ? begin[last] : behind(end[i], begin[last]);
                const Piece down = whole ? begin_down[last] : behind(begin_down[last], end_down[i]);
                at(int(i), int(i + m)) = entry(up);
                at(int(i + m), int(i)) = entry(down);
            }
        }
    }, stop);
    return table;
}

std::vector<glm::vec4> emission_table(const TransferFunction1D& tf, ValueRange range, int n, double d) {
    std::vector<glm::vec4> table;
    for (int i = 0; i < n; ++i)
        table.push_back(glm::vec4(
            glm::min(tf.at(range.min + range.extent() * i / (n - 1)) * d, glm::dvec4(kLargestDepth))));
    return table;
}

std::vector<glm::vec4> emission_table_2d(const TransferFunction2D& tf, double d) {
    std::vector<glm::vec4> table;
    for (const Emission& e : tf.samples) table.push_back(glm::vec4(glm::min(e * d, glm::dvec4(kLargestDepth))));
    return table;
}

Hash hash_of(const TransferFunction& tf) {
    Hasher h;
    auto emission = [&](const Emission& e) {
        for (int c = 0; c < 4; ++c) h.value(e[c]);
    };
    h.value(tf.reference_length);
    for (const auto& p : tf.one.points) {
        h.value(p.value);
        emission(p.emission);
    }
    if (tf.two) {
        for (double v : {tf.two->value.min, tf.two->value.max, tf.two->gradient.min, tf.two->gradient.max})
            h.value(v);
        h.value(tf.two->dims.x).value(tf.two->dims.y);
        for (const Emission& e : tf.two->samples) emission(e);
    }
    return h.finish();
}

}  // namespace voxloom::slicer
