#include "plugins/lattice-bcc/resample.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "core/base/parallel.h"
#include "core/data/convert.h"

namespace voxloom::bcc {

namespace {

constexpr double kHuge = 1e300;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

double apply(const Taps& taps, const double* line, std::int64_t stride) {
    double sum = 0;
    for (int i = 0; i < taps.count; ++i) sum += taps.weights[std::size_t(i)] * line[(taps.first + i) * stride];
    return sum;
}

// Room for so many numbers, which hold nothing yet.
Buffer numbers(std::uint64_t count) { return Buffer(checked_product({std::int64_t(count), 1, 1}, sizeof(double), "a lattice"), "lattice"); }

// One of the two grids, where it lies in the volume.
struct Grid {
    Index3 dims{0};
    double first = 0, step = 1;  // of its sites, in voxels

    std::vector<Taps> taps(Filter filter, int axis, std::int64_t samples) const {
        return taps_of_grid(filter, first, step, dims[axis], samples);
    }
};

// What is filtered: the values themselves, or what is known of their validity.
enum class Read { values, valid_values, validity, invalidity };

class Resampler {
  public:
    Resampler(const Volume& volume, const ResampleOptions& options, const std::stop_token& stop, const std::function<void(double)>& progress)
        : volume_(volume), options_(options), stop_(stop), progress_(progress) {}

    LatticePtr run() {
        check_stop(stop_);
        LatticeDesc desc = lattice_desc(volume_.desc(), options_.step, options_.type);
        const int components = volume_.desc().components;
        if (options_.filter) survey();
        for (const bool invalid : invalid_) passes_ += invalid ? 8 : 2;
        std::vector<Value> grids;
        for (std::size_t g = 0; g < 2; ++g) {
            VolumeDesc& form = std::get<VolumeDesc>(desc.grids[g].grid.detail);
            const Grid grid{form.dims, g == 0 ? 0 : 0.5 * options_.step, options_.step};
            Buffer all = numbers(form.voxels() * std::uint64_t(components));
            for (int c = 0; c < components; ++c) {
                const Buffer one = sites(grid, c);
                for (std::size_t i = 0; i < form.voxels(); ++i) all.as<double>()[i * std::size_t(components) + std::size_t(c)] = one.as<double>()[i];
            }
            const auto volume = dense(form, all.as<double>());
            form = volume->desc();
            grids.emplace_back(VolumePtr(volume));
        }
        return std::make_shared<const Lattice>(std::move(desc), std::move(grids));
    }

  private:
    // What both grids must know alike before either is filtered: which components have something invalid, and whether values are so
    // large that sums of a few would be no numbers.
    void survey() {
        const VolumeDesc& desc = volume_.desc();
        if (!desc.has_mask && !is_float(desc.type)) return;
        std::vector<std::atomic<bool>> invalid(invalid_.size());
        std::atomic<bool> huge{false};
        parallel_for(0, desc.dims.z, 1, [&](std::int64_t lo, std::int64_t hi) {
            std::vector<double> slice(std::size_t(desc.dims.x * desc.dims.y));
            for (std::int64_t z = lo; z < hi; ++z)
                for (std::size_t c = 0; c < invalid.size(); ++c) {
                    read_slice(z, int(c), Read::values, slice);
                    for (const double v : slice) {
                        if (std::isnan(v)) invalid[c] = true;
                        if (std::abs(v) > kHuge) huge = true;
                    }
                }
        }, stop_);
        for (std::size_t c = 0; c < invalid.size(); ++c) invalid_[c] = invalid[c];
        if (huge) scale_ = 0x1p-8;
    }

    Buffer sites(const Grid& grid, int component) {
        if (!options_.filter) return closed_form(grid);
        if (!invalid_[std::size_t(component)]) return filtered(grid, component, *options_.filter, Read::values);
        Buffer values = filtered(grid, component, *options_.filter == Filter::linear ? Filter::linear : Filter::catmull_rom, Read::valid_values);
        const Buffer touched = filtered(grid, component, Filter::catmull_rom, Read::invalidity);
        const Buffer sum = filtered(grid, component, Filter::linear, Read::valid_values);
        const Buffer weight = filtered(grid, component, Filter::linear, Read::validity);
        for (std::size_t i = 0; i < values.as<double>().size(); ++i) {
            const double w = weight.as<double>()[i];
            if (touched.as<double>()[i] > 0) values.as<double>()[i] = w > 1e-12 ? sum.as<double>()[i] / w : kNaN;
        }
        return values;
    }

    Buffer closed_form(const Grid& grid) {
        const ClosedForm* form = volume_.closed_form();
        if (!form) fail("this volume has no closed form; take another filter");
        if (volume_.desc().components != 1) fail("a closed form has one component, and this volume {}", volume_.desc().components);
        Buffer values = numbers(Box::of(grid.dims).voxels());
        std::atomic<std::int64_t> slices{0};
        parallel_for(0, grid.dims.z, 1, [&](std::int64_t lo, std::int64_t hi) {
            for (std::int64_t z = lo; z < hi; ++z) {
                double* out = values.as<double>().data() + z * grid.dims.y * grid.dims.x;
                for (std::int64_t y = 0; y < grid.dims.y; ++y)
                    for (std::int64_t x = 0; x < grid.dims.x; ++x) {
                        const glm::dvec3 at = grid.first + grid.step * glm::dvec3(double(x), double(y), double(z));
                        *out++ = form->value(glm::dvec3(volume_.desc().index_to_world * glm::dvec4(at, 1)));
                    }
                tell(double(++slices) / double(grid.dims.z));
            }
        }, stop_);
        ++done_;
        return values;
    }

    // Along x and y slice by slice as they are read, then along z.
    Buffer filtered(const Grid& grid, int component, Filter filter, Read what) {
        const Index3 n = volume_.desc().dims;
        const auto across = grid.taps(filter, 0, n.x), down = grid.taps(filter, 1, n.y), deep = grid.taps(filter, 2, n.z);
        const std::int64_t slice = grid.dims.x * grid.dims.y;
        Buffer between = numbers(std::uint64_t(slice * n.z)), result = numbers(std::uint64_t(slice * grid.dims.z));
        const std::span<double> slices = between.as<double>(), values = result.as<double>();
        const bool touches = what == Read::invalidity;  // adds up what a footprint meets, whatever the weights
        std::atomic<std::int64_t> read{0};
        parallel_for(0, n.z, 1, [&](std::int64_t lo, std::int64_t hi) {
            std::vector<double> in(std::size_t(n.x * n.y)), rows(std::size_t(grid.dims.x * n.y));
            for (std::int64_t z = lo; z < hi; ++z) {
                read_slice(z, component, what, in);
                for (std::int64_t y = 0; y < n.y; ++y) {
                    double* line = in.data() + y * n.x;
                    if (!touches) to_coefficients(filter, line, n.x);
                    for (std::int64_t x = 0; x < grid.dims.x; ++x) rows[std::size_t(y * grid.dims.x + x)] = along(touches, across[std::size_t(x)], line, 1);
                }
                for (std::int64_t x = 0; x < grid.dims.x; ++x) {
                    double* line = rows.data() + x;
                    if (!touches) to_coefficients(filter, line, n.y, grid.dims.x);
                    for (std::int64_t y = 0; y < grid.dims.y; ++y)
                        slices[std::size_t(z * slice + y * grid.dims.x + x)] = along(touches, down[std::size_t(y)], line, grid.dims.x);
                }
                tell(0.8 * double(++read) / double(n.z));
            }
        }, stop_);
        parallel_for(0, slice, 256, [&](std::int64_t lo, std::int64_t hi) {
            std::vector<double> line(std::size_t(n.z));
            for (std::int64_t i = lo; i < hi; ++i) {
                for (std::int64_t z = 0; z < n.z; ++z) line[std::size_t(z)] = slices[std::size_t(z * slice + i)];
                if (!touches) to_coefficients(filter, line.data(), n.z);
                for (std::int64_t z = 0; z < grid.dims.z; ++z) values[std::size_t(z * slice + i)] = along(touches, deep[std::size_t(z)], line.data(), 1);
            }
        }, stop_);
        ++done_;
        return result;
    }

    static double along(bool touches, const Taps& taps, const double* line, std::int64_t stride) {
        if (!touches) return apply(taps, line, stride);
        double most = 0;
        for (int i = 0; i < taps.count; ++i) most = std::max(most, line[(taps.first + i) * stride]);
        return most;
    }

    void read_slice(std::int64_t z, int component, Read what, std::vector<double>& out) {
        const VolumeDesc& desc = volume_.desc();
        const Box box{{0, 0, z}, {desc.dims.x, desc.dims.y, z + 1}};
        const std::size_t count = out.size(), components = std::size_t(desc.components);
        std::vector<std::byte> bytes(count * desc.voxel_bytes());
        volume_.read(box, bytes, stop_);
        std::vector<double> values(count * components);
        to_double(desc.type, bytes.data(), values.size(), values.data());
        std::vector<std::uint8_t> mask(desc.has_mask ? count : 0);
        if (desc.has_mask) volume_.read_mask(box, mask);
        for (std::size_t i = 0; i < count; ++i) {
            const double v = values[i * components + std::size_t(component)];
            const bool valid = std::isfinite(v) && (mask.empty() || mask[i]);
            switch (what) {
                case Read::values: out[i] = valid ? v * scale_ : kNaN; break;
                case Read::valid_values: out[i] = valid ? v * scale_ : 0; break;
                case Read::validity: out[i] = valid; break;
                case Read::invalidity: out[i] = !valid; break;
            }
        }
    }

    std::shared_ptr<const DenseVolume> dense(VolumeDesc form, std::span<double> values) {
        const std::size_t components = std::size_t(form.components);
        Buffer mask;
        if (form.has_mask) {
            mask = Buffer(form.voxels(), "mask");
            for (std::size_t i = 0; i < mask.size(); ++i) {
                bool valid = true;
                for (std::size_t c = 0; c < components; ++c) valid = valid && !std::isnan(values[i * components + c]);
                mask.data()[i] = std::byte(valid);
            }
        }
        if (scale_ != 1)
            for (double& v : values) v = std::clamp(v / scale_, std::numeric_limits<double>::lowest(), std::numeric_limits<double>::max());
        Buffer voxels(form.dense_bytes(), "lattice");
        from_double(values.data(), values.size(), form.type, voxels.data());
        return std::make_shared<const DenseVolume>(std::move(form), std::move(voxels), std::move(mask));
    }

    void tell(double of_pass) const {
        if (progress_) progress_(std::min((done_ + of_pass) / passes_, 1.0));
    }

    const Volume& volume_;
    const ResampleOptions& options_;
    const std::stop_token& stop_;
    const std::function<void(double)>& progress_;
    std::vector<bool> invalid_ = std::vector<bool>(std::size_t(volume_.desc().components));  // of each component
    double scale_ = 1;  // of what is filtered
    int done_ = 0, passes_ = 0;
};

}  // namespace

LatticePtr resample(const Volume& volume, const ResampleOptions& options, const std::stop_token& stop, const std::function<void(double)>& progress) {
    return Resampler(volume, options, stop, progress).run();
}

}  // namespace voxloom::bcc
