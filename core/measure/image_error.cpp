#include "core/measure/image_error.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/measure/sum.h"
#include "core/measure/volume_error.h"

namespace voxloom {

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
// One step of 8 bits, and what floats lose in taking it: exactly one step off is not more than one.
constexpr double kOneStep = (1 + 1e-4) / 255;

bool finite(const glm::vec4& c) {
    return std::isfinite(c.r) && std::isfinite(c.g) && std::isfinite(c.b) && std::isfinite(c.a);
}

double largest(const glm::dvec4& v) { return std::max({v.x, v.y, v.z, v.w}); }

// A plane of doubles.
struct Plane {
    int width, height;
    std::vector<double> values;
    Plane(int w, int h) : width(w), height(h), values(std::size_t(w) * std::size_t(h)) {}
    double* row(int y) { return values.data() + std::size_t(y) * std::size_t(width); }
    const double* row(int y) const { return values.data() + std::size_t(y) * std::size_t(width); }
};

Plane luma_of(const Image& image) {
    Plane luma(image.size().x, image.size().y);
    for (int y = 0; y < luma.height; ++y)
        for (int x = 0; x < luma.width; ++x) {
            glm::vec4 c = image.at(x, y);
            luma.row(y)[x] = finite(c) ? 0.2126 * c.r + 0.7152 * c.g + 0.0722 * c.b : 0;
        }
    return luma;
}

Plane product(const Plane& a, const Plane& b) {
    Plane p(a.width, a.height);
    for (std::size_t i = 0; i < p.values.size(); ++i) p.values[i] = a.values[i] * b.values[i];
    return p;
}

constexpr int kRadius = 5;  // of the 11 x 11 window

std::array<double, 2 * kRadius + 1> window() {
    constexpr double sigma = 1.5;
    std::array<double, 2 * kRadius + 1> weights;
    double sum = 0;
    for (int i = -kRadius; i <= kRadius; ++i)
        sum += weights[std::size_t(i + kRadius)] = std::exp(-i * i / (2 * sigma * sigma));
    for (double& w : weights) w /= sum;
    return weights;
}

// Centres along an axis of n pixels: those whose window lies inside, or all where none does.
struct Centres {
    int first, count;
};
Centres centres_of(int n) {
    return n > 2 * kRadius ? Centres{kRadius, n - 2 * kRadius} : Centres{0, n};
}

// Weighted mean about position c of n values that lie `stride` apart.
double windowed(const double* values, int n, std::size_t stride, int c) {
    static const auto weights = window();
    double sum = 0, weight = 0;
    for (int i = std::max(c - kRadius, 0); i <= std::min(c + kRadius, n - 1); ++i) {
        const double w = weights[std::size_t(i - c + kRadius)];
        sum += w * values[std::size_t(i) * stride];
        weight += w;
    }
    return sum / weight;
}

Plane smooth(const Plane& p, const std::stop_token& stop) {
    const Centres across = centres_of(p.width), down = centres_of(p.height);
    Plane rows(across.count, p.height);
    parallel_for(0, p.height, 16, [&](std::int64_t lo, std::int64_t hi) {
        for (int y = int(lo); y < int(hi); ++y)
            for (int x = 0; x < rows.width; ++x)
                rows.row(y)[x] = windowed(p.row(y), p.width, 1, across.first + x);
    }, stop);
    Plane all(across.count, down.count);
    parallel_for(0, all.height, 16, [&](std::int64_t lo, std::int64_t hi) {
        for (int y = int(lo); y < int(hi); ++y)
            for (int x = 0; x < all.width; ++x)
                all.row(y)[x] = windowed(rows.row(0) + x, p.height, std::size_t(rows.width),
                                         down.first + y);
    }, stop);
    return all;
}

double ssim_of(const Plane& a, const Plane& b, const std::stop_token& stop) {
    constexpr double c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
    const Plane ma = smooth(a, stop), mb = smooth(b, stop);
    const Plane aa = smooth(product(a, a), stop), bb = smooth(product(b, b), stop), ab = smooth(product(a, b), stop);
    Sum sum;
    for (std::size_t i = 0; i < ma.values.size(); ++i) {
        const double x = ma.values[i], y = mb.values[i];
        const double xx = aa.values[i] - x * x, yy = bb.values[i] - y * y, xy = ab.values[i] - x * y;
        sum.add((2 * x * y + c1) * (2 * xy + c2) / ((x * x + y * y + c1) * (xx + yy + c2)));
    }
    return sum.value() / double(ma.values.size());
}

}  // namespace

std::string problem_with_comparison(glm::ivec2 size, glm::ivec2 reference) {
    if (size == reference) return {};
    return fmt::format("the image has {} x {} pixels and the reference {} x {}; they must agree",
                       size.x, size.y, reference.x, reference.y);
}

ImageError compare_images(const Image& image, const Image& reference, const std::stop_token& stop) {
    if (std::string problem = problem_with_comparison(image.size(), reference.size()); !problem.empty())
        fail("{}", problem);
    const glm::ivec2 size = image.size();
    ImageError e;
    Sum squares;
    std::uint64_t off = 0, all = std::uint64_t(size.x) * std::uint64_t(size.y);
    for (int y = 0; y < size.y; ++y) {
        check_stop(stop);
        for (int x = 0; x < size.x; ++x) {
            const glm::vec4 c = image.at(x, y), r = reference.at(x, y);
            if (!finite(c) || !finite(r)) {
                e.mismatched += finite(c) != finite(r);
                continue;
            }
            const glm::dvec4 d = glm::abs(glm::dvec4(c) - glm::dvec4(r));
            e.pixels += 1;
            squares.add(glm::dot(d, d));
            off += largest(d) > kOneStep;
            if (largest(d) > e.max_error) {
                e.max_error = largest(d);
                e.max_error_at = {x, y};
            }
        }
    }
    if (e.pixels == 0) {
        e.rmse = e.max_error = e.psnr = kNaN;
    } else {
        e.rmse = std::sqrt(squares.value() / (4 * double(e.pixels)));
        e.psnr = psnr(1, e.rmse);
    }
    if (all > 0) {
        e.share_off = double(off + e.mismatched) / double(all);
        e.ssim = ssim_of(luma_of(image), luma_of(reference), stop);
    }
    return e;
}

ImagePtr difference_image(const Image& image, const Image& reference, double scale, const std::stop_token& stop) {
    if (std::string problem = problem_with_comparison(image.size(), reference.size()); !problem.empty())
        fail("{}", problem);
    auto difference = std::make_shared<Image>(image.size(), Image::Format::rgba32f);
    glm::vec4* out = difference->rgba32f().data();
    for (int y = 0; y < image.size().y; ++y) {
        check_stop(stop);
        for (int x = 0; x < image.size().x; ++x) {
            const glm::vec4 c = image.at(x, y), r = reference.at(x, y);
            glm::vec3 d = glm::abs(glm::vec3(c) - glm::vec3(r)) * float(scale);
            if (!finite(c) || !finite(r)) d = glm::vec3(finite(c) != finite(r) ? 1.0f : 0.0f);
            *out++ = glm::vec4(d, 1.0f);
        }
    }
    return difference;
}

}  // namespace voxloom
