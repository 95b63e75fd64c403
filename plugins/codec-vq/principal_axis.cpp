#include "plugins/codec-vq/principal_axis.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/base/parallel.h"

namespace voxloom::vq {

namespace {

constexpr std::size_t kMostForAxis = 4096;  // vectors: the axis of more is the same to a hundredth
constexpr std::size_t kPart = 256;          // vectors a thread adds up at a time; sums join in order, whatever the threads
constexpr int kIterations = 200;

using Matrix = std::vector<double>;  // symmetric, dim x dim

// Of the covariance's lower half.
Matrix part_of_covariance(const Sample& sample, std::span<const std::size_t> members, std::span<const double> centroid) {
    const auto dim = std::size_t(sample.dim);
    Matrix sum(dim * dim);
    std::vector<double> x(dim);
    for (const std::size_t i : members) {
        for (std::size_t c = 0; c < dim; ++c) x[c] = double(sample.vector(i)[c]) - centroid[c];
        for (std::size_t r = 0; r < dim; ++r) {
            const double scaled = double(sample.weights[i]) * x[r];
            double* row = sum.data() + r * dim;
            for (std::size_t c = 0; c <= r; ++c) row[c] += scaled * x[c];
        }
    }
    return sum;
}

Matrix covariance(const Sample& sample, std::span<const std::size_t> members, std::span<const double> centroid) {
    const auto dim = std::size_t(sample.dim);
    std::vector<Matrix> parts((members.size() + kPart - 1) / kPart);
    parallel_for(0, std::int64_t(parts.size()), 1, [&](std::int64_t lo, std::int64_t hi) {
        for (auto p = std::size_t(lo); p < std::size_t(hi); ++p)
            parts[p] = part_of_covariance(sample, members.subspan(p * kPart, std::min(kPart, members.size() - p * kPart)), centroid);
    });
    Matrix sum(dim * dim);
    for (const Matrix& part : parts)
        for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += part[i];
    for (std::size_t r = 0; r < dim; ++r)
        for (std::size_t c = 0; c < r; ++c) sum[c * dim + r] = sum[r * dim + c];
    return sum;
}

struct Direction {
    std::vector<double> axis;
    double variance = 0;  // along it
};

Direction iterated(const Matrix& matrix, std::vector<double> axis) {
    const std::size_t dim = axis.size();
    Direction best;
    std::vector<double> next(dim);
    for (int iteration = 0; iteration < kIterations; ++iteration) {
        double squares = 0;
        for (std::size_t r = 0; r < dim; ++r) {
            next[r] = 0;
            for (std::size_t c = 0; c < dim; ++c) next[r] += matrix[r * dim + c] * axis[c];
            squares += next[r] * next[r];
        }
        const double length = std::sqrt(squares);  // grows with each step towards the eigenvalue
        if (!(length > 0)) break;
        for (std::size_t r = 0; r < dim; ++r) axis[r] = next[r] / length;
        const bool settled = length - best.variance <= 1e-9 * length;
        best = {axis, length};
        if (settled) break;
    }
    return best;
}

}  // namespace

std::vector<double> centroid_of(const Sample& sample, std::span<const std::size_t> members) {
    std::vector<double> sum(std::size_t(sample.dim));
    double weight = 0;
    for (const std::size_t i : members) {
        const double w = double(sample.weights[i]);
        weight += w;
        for (std::size_t c = 0; c < sum.size(); ++c) sum[c] += w * double(sample.vector(i)[c]);
    }
    for (double& s : sum) s /= weight;
    return sum;
}

std::vector<double> principal_axis(const Sample& sample, std::span<const std::size_t> members, std::span<const double> centroid) {
    std::vector<std::size_t> some(std::min(members.size(), kMostForAxis));
    for (std::size_t k = 0; k < some.size(); ++k) some[k] = members[k * members.size() / some.size()];
    Matrix matrix = covariance(sample, some, centroid);
    // Numbers near one, so that squares of tiny ones do not vanish.
    const auto dim = std::size_t(sample.dim);
    std::size_t widest = 0;
    for (std::size_t r = 1; r < dim; ++r)
        if (matrix[r * (dim + 1)] > matrix[widest * (dim + 1)]) widest = r;
    const double scale = matrix[widest * (dim + 1)];
    if (scale > 0)
        for (double& m : matrix) m /= scale;

    // From the widest component the variance found is never below that one's; a second start that is at right angles
    // to nothing in particular checks that a wider direction was not missed.
    std::vector<double> first(dim), second(dim);
    first[widest] = 1;
    std::uint32_t state = 1;  // no library function, which might round elsewhere on another machine
    for (double& s : second) {
        state = state * 1664525 + 1013904223;
        s = double(state >> 8) * 0x1p-23 - 1;
    }
    const Direction a = iterated(matrix, first), b = iterated(matrix, second);
    const Direction& found = b.variance > a.variance * (1 + 1e-6) ? b : a;
    return found.axis.empty() ? first : found.axis;
}

}  // namespace voxloom::vq
