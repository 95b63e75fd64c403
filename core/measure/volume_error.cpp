#include "core/measure/volume_error.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <vector>

#include "core/base/parallel.h"
#include "core/measure/sum.h"

namespace voxloom {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
// Samples of a tile: both sides as doubles lie in the second-level cache.
constexpr std::int64_t kTileVoxels = 1 << 16;
// Samples that are added up plainly before their sum is compensated: costs no digit that counts.
constexpr std::size_t kBlock = 64;

// Whole rows and slices as long as they fit: sources deliver those fastest.
Index3 default_tile(Index3 dims) {
    Index3 tile;
    tile.x = std::min(dims.x, kTileVoxels);
    tile.y = std::min(dims.y, std::max<std::int64_t>(1, kTileVoxels / tile.x));
    tile.z = std::min(dims.z, std::max<std::int64_t>(1, kTileVoxels / (tile.x * tile.y)));
    return tile;
}

struct Tiles {
    Index3 dims, tile, grid;
    Tiles(Index3 d, Index3 wanted) : dims(d), tile(default_tile(d)) {
        for (int a = 0; a < 3; ++a)
            if (wanted[a] > 0) tile[a] = std::min(wanted[a], dims[a]);
        grid = (dims + tile - Index3(1)) / tile;
    }
    std::int64_t count() const { return grid.x * grid.y * grid.z; }
    Box box(std::int64_t i) const {
        Index3 at{i % grid.x, i / grid.x % grid.y, i / (grid.x * grid.y)};
        return {at * tile, glm::min((at + Index3(1)) * tile, dims)};
    }
};

// One side of a tile as doubles; NaN where the mask says invalid.
class Side {
  public:
    Side(const Volume& volume, const Box& box, const std::stop_token& stop)
        : values_(box.voxels() * std::size_t(volume.desc().components) * sizeof(double), "tile") {
        const VolumeDesc& desc = volume.desc();
        Buffer raw(box.voxels() * desc.voxel_bytes(), "tile");
        volume.read(box, raw.bytes(), stop);
        with_type(desc.type, [&](auto t) {
            auto from = raw.as<decltype(t)>();
            std::copy(from.begin(), from.end(), values_.as<double>().begin());
        });
        if (!desc.has_mask) return;
        Buffer mask(box.voxels(), "tile");
        volume.read_mask(box, mask.as<std::uint8_t>());
        const auto components = std::size_t(desc.components);
        for (std::size_t i = 0; i < box.voxels(); ++i)
            if (!mask.as<std::uint8_t>()[i])
                std::fill_n(&values_.as<double>()[i * components], components, kNaN);
    }
    std::span<const double> values() const { return values_.as<double>(); }

  private:
    Buffer values_;
};

// What one tile, or all tiles up to one, add up to. v is the volume, r the reference.
struct Moments {
    std::uint64_t compared = 0, skipped = 0, mismatched = 0, different = 0;
    Sum error, squared_error;
    double max_error = -1;
    Index3 max_error_at{0};
    ValueRange reference{kInf, -kInf};
    // Means and central moments, merged by Chan, Golub & LeVeque 1979: no cancellation.
    double mean_v = 0, mean_r = 0, vv = 0, rr = 0, vr = 0;

    void add(const Moments& b) {
        if (b.max_error > max_error) {
            max_error = b.max_error;
            max_error_at = b.max_error_at;
        }
        skipped += b.skipped;
        mismatched += b.mismatched;
        different += b.different;
        if (b.compared == 0) return;
        error.add(b.error);
        squared_error.add(b.squared_error);
        reference = {std::min(reference.min, b.reference.min), std::max(reference.max, b.reference.max)};
        const double n = double(compared), m = double(b.compared), all = n + m;
        const double dv = b.mean_v - mean_v, dr = b.mean_r - mean_r, weight = n * (m / all);
        mean_v += dv * (m / all);
        mean_r += dr * (m / all);
        vv += b.vv + dv * dv * weight;
        rr += b.rr + dr * dr * weight;
        vr += b.vr + dv * dr * weight;
        compared += b.compared;
    }
};

Moments compare_tile(const Box& box, std::size_t components, std::span<const double> v,
                     std::span<const double> r) {
    Moments m;
    std::size_t max_at = 0;
    Sum sum_v, sum_r;
    for (std::size_t begin = 0; begin < v.size(); begin += kBlock) {
        double error = 0, squared = 0, of_v = 0, of_r = 0;
        for (std::size_t i = begin; i < std::min(begin + kBlock, v.size()); ++i) {
            if (!std::isfinite(v[i]) || !std::isfinite(r[i])) {
                bool alike = v[i] == r[i] || (std::isnan(v[i]) && std::isnan(r[i]));
                (alike ? m.skipped : m.mismatched) += 1;
                m.different += !alike;
                continue;
            }
            const double d = v[i] - r[i];
            m.compared += 1;
            m.different += v[i] != r[i];
            error += d;
            squared += d * d;
            of_v += v[i];
            of_r += r[i];
            if (std::abs(d) > m.max_error) {
                m.max_error = std::abs(d);
                max_at = i;
            }
            m.reference = {std::min(m.reference.min, r[i]), std::max(m.reference.max, r[i])};
        }
        m.error.add(error);
        m.squared_error.add(squared);
        sum_v.add(of_v);
        sum_r.add(of_r);
    }
    if (m.compared == 0) return m;
    const auto voxel = std::int64_t(max_at / components);
    const Index3 d = box.dims();
    m.max_error_at = box.lo + Index3(voxel % d.x, voxel / d.x % d.y, voxel / (d.x * d.y));
    m.mean_v = sum_v.value() / double(m.compared);
    m.mean_r = sum_r.value() / double(m.compared);
    for (std::size_t i = 0; i < v.size(); ++i) {
        if (!std::isfinite(v[i]) || !std::isfinite(r[i])) continue;
        const double dv = v[i] - m.mean_v, dr = r[i] - m.mean_r;
        m.vv += dv * dv;
        m.rr += dr * dr;
        m.vr += dv * dr;
    }
    return m;
}

VolumeError error_of(const Moments& m, const VolumeDesc& reference) {
    VolumeError e;
    e.compared = m.compared;
    e.skipped = m.skipped;
    e.mismatched = m.mismatched;
    e.different = m.different;
    e.nominal_peak = nominal_peak(reference);
    if (m.compared == 0) {
        e.rmse = e.mean_error = e.max_error = e.correlation = e.psnr_range = kNaN;
        if (e.nominal_peak) e.psnr_nominal = kNaN;
        return e;
    }
    const double n = double(m.compared);
    e.rmse = std::sqrt(m.squared_error.value() / n);
    e.mean_error = m.error.value() / n;
    e.max_error = m.max_error;
    e.max_error_at = m.max_error_at;
    e.correlation = m.vv > 0 && m.rr > 0
                        ? std::clamp(m.vr / (std::sqrt(m.vv) * std::sqrt(m.rr)), -1.0, 1.0)
                        : kNaN;
    e.reference_range = m.reference;
    e.psnr_range = psnr(m.reference.extent(), e.rmse);
    if (e.nominal_peak) e.psnr_nominal = psnr(*e.nominal_peak, e.rmse);
    return e;
}

}  // namespace

double psnr(double peak, double rmse) {
    if (rmse == 0) return kInf;
    return peak > 0 ? 20 * std::log10(peak / rmse) : kNaN;
}

std::optional<double> nominal_peak(const VolumeDesc& desc) {
    if (is_float(desc.type)) return std::nullopt;
    int bits = desc.significant_bits > 0 ? desc.significant_bits : int(8 * bytes_of(desc.type));
    return std::ldexp(1.0, bits) - 1;
}

Index3 tile_of_bricks(glm::ivec3 brick) {
    return Index3(brick) * glm::max(Index3(64) / Index3(brick), Index3(1));
}

std::string problem_with_comparison(const VolumeDesc& volume, const VolumeDesc& reference) {
    if (volume.dims != reference.dims)
        return fmt::format("the volume has {} x {} x {} voxels and the reference {} x {} x {}; they "
                           "must agree, so crop or resample one of them",
                           volume.dims.x, volume.dims.y, volume.dims.z, reference.dims.x,
                           reference.dims.y, reference.dims.z);
    if (volume.components != reference.components)
        return fmt::format("the volume has {} components and the reference {}; they must agree",
                           volume.components, reference.components);
    return {};
}

VolumeError compare_volumes(const VolumePtr& volume, const VolumePtr& reference,
                            const CompareOptions& options) {
    const VolumeDesc& desc = reference->desc();
    if (std::string problem = problem_with_comparison(volume->desc(), desc); !problem.empty())
        fail("{}", problem);
    Moments all;
    if (desc.voxels() == 0) return error_of(all, desc);

    // What cannot be read by region is read once, as a whole.
    const VolumePtr v = volume->reads_by_region() ? volume : in_memory(volume, options.stop);
    const VolumePtr r = reference->reads_by_region() ? reference : in_memory(reference, options.stop);
    const Tiles tiles(desc.dims, options.tile);
    // Whatever thread compares a tile, the tiles are added up in their order. A batch bounds the memory.
    constexpr std::int64_t kBatch = 4096;
    std::atomic<std::int64_t> done{0};
    for (std::int64_t first = 0; first < tiles.count(); first += kBatch) {
        std::vector<Moments> batch(std::size_t(std::min(kBatch, tiles.count() - first)));
        parallel_for(0, std::int64_t(batch.size()), 1, [&](std::int64_t lo, std::int64_t hi) {
            for (std::int64_t i = lo; i < hi; ++i) {
                check_stop(options.stop);
                const Box box = tiles.box(first + i);
                const Side side_v(*v, box, options.stop), side_r(*r, box, options.stop);
                batch[std::size_t(i)] = compare_tile(box, std::size_t(desc.components),
                                                     side_v.values(), side_r.values());
                if (options.progress) options.progress(double(++done) / double(tiles.count()));
            }
        }, options.stop);
        for (const Moments& tile : batch) all.add(tile);
    }
    return error_of(all, desc);
}

}  // namespace voxloom
