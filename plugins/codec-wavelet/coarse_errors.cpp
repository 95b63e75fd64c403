// Rows along x are interpolated first, since there are few of the coarse ones; then planes across z, and last, for
// every row of voxels, along y, where it is compared at once.
#include "plugins/codec-wavelet/coarse_errors.h"

#include <algorithm>
#include <cmath>

#include "core/base/parallel.h"
#include "core/base/wide.h"
#include "core/data/convert.h"
#include "plugins/codec-wavelet/brick_ranges.h"
#include "plugins/codec-wavelet/passes.h"

namespace voxloom::wavelet {

namespace {

// Sums stay apart for every place of the row, so that wide registers add up in the same order as narrow ones.
// Small integers and their interpolations are good to 24 bits, so single precision will do for them.
template <class Real>
inline void blend_row(const Real* a, const Real* b, Real f, Real* out, std::size_t n) {
    for (std::size_t i = 0; i < n; ++i) out[i] = a[i] * (1 - f) + b[i] * f;
}
template <class Real>
inline void add_row(const Real* a, const Real* b, Real f, const Real* truth, const Real* counts, Real* squares, Real* largest,
                    std::size_t n) {
    for (std::size_t i = 0; i < n; ++i) {
        const Real e = std::abs((a[i] * (1 - f) + b[i] * f - truth[i]) * counts[i]);
        squares[i] += e * e;
        largest[i] = e > largest[i] ? e : largest[i];
    }
}
VOXLOOM_WIDE void blend(const float* a, const float* b, float f, float* out, std::size_t n) { blend_row(a, b, f, out, n); }
VOXLOOM_WIDE void blend(const double* a, const double* b, double f, double* out, std::size_t n) { blend_row(a, b, f, out, n); }
VOXLOOM_WIDE void add(const float* a, const float* b, float f, const float* truth, const float* counts, float* squares,
                      float* largest, std::size_t n) {
    add_row(a, b, f, truth, counts, squares, largest, n);
}
VOXLOOM_WIDE void add(const double* a, const double* b, double f, const double* truth, const double* counts, double* squares,
                      double* largest, std::size_t n) {
    add_row(a, b, f, truth, counts, squares, largest, n);
}

// Where a voxel stands between two samples; f is the weight of the second, 0 at the last, which is continued.
struct Corner {
    std::int64_t first;
    double f;
};
Corner corner(const LevelDesc& level, std::int64_t fine, int axis) {
    const std::int64_t stride = level.stride[axis], first = fine / stride;
    if (first + 1 >= level.dims[axis]) return {level.dims[axis] - 1, 0.0};
    return {first, double(fine % stride) / double(stride)};
}

// The samples that take part in a box of voxels.
Box around(const LevelDesc& level, const Box& fine) {
    Box box;
    for (int a = 0; a < 3; ++a) {
        box.lo[a] = corner(level, fine.lo[a], a).first;
        const Corner last = corner(level, fine.hi[a] - 1, a);
        box.hi[a] = last.first + (last.f > 0 ? 2 : 1);
    }
    return box;
}

template <class Real>
class Measured final : public CoarseErrors {
  public:
    Measured(const TreeDesc& tree, std::span<const LevelStore> decoded, const Box& box, const std::stop_token& stop)
        : tree_(tree) {
        for (std::size_t l = 1; l < decoded.size(); ++l) {
            Samples samples{around(tree.bricks.levels[l], box), {}};
            samples.values = Buffer(samples.box.voxels() * sizeof(Real) * components(), "samples of coarse levels");
            load(decoded[l], samples, stop);
            levels_.push_back(std::move(samples));
        }
    }

    void measure(const VoxelView& original, FamilyId family, std::vector<ErrorSum>& sums) const override {
        const Box box = own_box(tree_, family);
        const Index3 brick(tree_.bricks.brick), bricks = (box.dims() + brick - Index3(1)) / brick;
        sums.assign(Box::of(bricks).voxels() * levels_.size(), {});
        thread_local std::vector<Real> truth, counts;  // too large to be got anew for every family
        truth.resize(box.voxels());
        counts.resize(box.voxels());
        for (std::size_t c = 0; c < components(); ++c) {
            take_truth(original, box, c, truth, counts);
            for (std::size_t l = 0; l < levels_.size(); ++l)
                measure_level(int(l) + 1, c, box, truth.data(), counts.data(), [&](Index3 b, double squares, double largest) {
                    ErrorSum& sum = sums[std::size_t((b.z * bricks.y + b.y) * bricks.x + b.x) * levels_.size() + l];
                    sum.squares += squares;
                    sum.largest = std::max(sum.largest, largest);
                });
        }
    }

  private:
    struct Samples {
        Box box;
        Buffer values;  // component by component
        const Real* plane(std::size_t c) const { return values.as<Real>().data() + c * box.voxels(); }
    };
    std::size_t components() const { return std::size_t(tree_.bricks.volume.components); }

    void load(const LevelStore& store, Samples& samples, const std::stop_token& stop) {
        const Box& box = samples.box;
        // A few slices at a time, since they are read brick by brick.
        const std::int64_t step = tree_.bricks.brick.z, first = box.lo.z / step, last = (box.hi.z - 1) / step + 1;
        parallel_for(first, last, 1, [&](std::int64_t lo, std::int64_t hi) {
            Box part = box;
            part.lo.z = std::max(box.lo.z, lo * step);
            part.hi.z = std::min(box.hi.z, hi * step);
            const std::size_t at = Box{box.lo, {box.hi.x, box.hi.y, part.lo.z}}.voxels();
            std::vector<std::int32_t> plane(part.voxels());
            for (std::size_t c = 0; c < components(); ++c) {
                store.read(part, int(c), plane.data());
                Real* to = samples.values.template as<Real>().data() + c * box.voxels() + at;
                for (std::size_t i = 0; i < plane.size(); ++i) to[i] = Real(delivered(tree_, plane[i]));
            }
        }, stop);
    }

    // The original as numbers, and 0 in `counts` where it is none.
    void take_truth(const VoxelView& original, const Box& box, std::size_t c, std::vector<Real>& truth, std::vector<Real>& counts) const {
        std::size_t at = 0;
        const auto n = std::size_t(box.dims().x);
        with_type(tree_.bricks.volume.type, [&](auto t) {
            for (std::int64_t z = box.lo.z; z < box.hi.z; ++z)
                for (std::int64_t y = box.lo.y; y < box.hi.y; ++y, at += n) {
                    const auto* row = reinterpret_cast<const decltype(t)*>(original.row(box.lo.x, y, z)) + c;
                    const std::uint8_t* valid = original.mask_row(box.lo.x, y, z);
                    if (std::is_integral_v<decltype(t)> && !valid && components() == 1) {  // apart, for the compiler's sake
                        for (std::size_t i = 0; i < n; ++i) truth[at + i] = Real(row[i]);
                        std::fill_n(counts.data() + at, n, Real(1));
                        continue;
                    }
                    for (std::size_t i = 0; i < n; ++i) {
                        const Real v = Real(row[i * components()]);
                        const bool finite = std::isfinite(v) && (!valid || valid[i]);
                        truth[at + i] = finite ? v : Real(0);
                        counts[at + i] = finite ? Real(1) : Real(0);
                    }
                }
        });
    }

    template <class Use>
    void measure_level(int level, std::size_t c, const Box& box, const Real* truth, const Real* counts, const Use& use) const {
        const LevelDesc& desc = tree_.bricks.levels[std::size_t(level)];
        const Samples& samples = levels_[std::size_t(level) - 1];
        const Box need = around(desc, box);
        const Index3 n = need.dims();
        const auto width = std::size_t(box.dims().x);
        const std::size_t plane = std::size_t(n.y) * width;

        // x
        thread_local std::vector<Real> rows;
        rows.resize(plane * std::size_t(n.z));
        const VoxelView view{samples.box, reinterpret_cast<const std::byte*>(samples.plane(c)), sizeof(Real)};
        std::vector<std::size_t> left(width), right(width);
        std::vector<Real> weight(width);
        for (std::size_t x = 0; x < width; ++x) {
            const Corner cx = corner(desc, box.lo.x + std::int64_t(x), 0);
            left[x] = std::size_t(cx.first - need.lo.x);
            right[x] = cx.f > 0 ? left[x] + 1 : left[x];
            weight[x] = Real(cx.f);
        }
        Real* to = rows.data();
        for (std::int64_t z = need.lo.z; z < need.hi.z; ++z)
            for (std::int64_t y = need.lo.y; y < need.hi.y; ++y, to += width) {
                const auto* from = reinterpret_cast<const Real*>(view.row(need.lo.x, y, z));
                for (std::size_t x = 0; x < width; ++x) to[x] = from[left[x]] * (1 - weight[x]) + from[right[x]] * weight[x];
            }

        const Index3 brick(tree_.bricks.brick);
        std::vector<Real> between(plane), squares(width), largest(width);
        for (std::int64_t z = box.lo.z; z < box.hi.z; ++z) {
            const Corner cz = corner(desc, z, 2);
            const Real* here = rows.data() + std::size_t(cz.first - need.lo.z) * plane;
            if (cz.f > 0) {
                blend(here, here + plane, Real(cz.f), between.data(), plane);
                here = between.data();
            }
            for (std::int64_t y = box.lo.y; y < box.hi.y; ++y) {
                const Corner cy = corner(desc, y, 1);
                const Real* a = here + std::size_t(cy.first - need.lo.y) * width;
                const std::size_t at = std::size_t((z - box.lo.z) * box.dims().y + y - box.lo.y) * width;
                add(a, cy.f > 0 ? a + width : a, Real(cy.f), truth + at, counts + at, squares.data(), largest.data(), width);
                if (y + 1 < box.hi.y && (y + 1 - box.lo.y) % brick.y != 0) continue;
                // Rows of a brick are added up before single precision is used up.
                for (std::size_t x = 0; x < width;) {
                    const std::size_t first = x, end = std::min(width, x + std::size_t(brick.x));
                    double sum = 0, most = 0;
                    for (; x < end; ++x) {
                        sum += double(squares[x]);
                        most = std::max(most, double(largest[x]));
                    }
                    use(Index3(std::int64_t(first) / brick.x, (y - box.lo.y) / brick.y, (z - box.lo.z) / brick.z), sum, most);
                }
                std::fill(squares.begin(), squares.end(), Real(0));
                std::fill(largest.begin(), largest.end(), Real(0));
            }
        }
    }

    const TreeDesc& tree_;
    std::vector<Samples> levels_;  // from 1 on
};

}  // namespace

std::unique_ptr<const CoarseErrors> coarse_errors(const TreeDesc& tree, std::span<const LevelStore> decoded, const Box& box,
                                                  const std::stop_token& stop) {
    const ScalarType type = tree.bricks.volume.type;
    if (!is_float(type) && bytes_of(type) <= 2) return std::make_unique<Measured<float>>(tree, decoded, box, stop);
    return std::make_unique<Measured<double>>(tree, decoded, box, stop);
}

}  // namespace voxloom::wavelet
