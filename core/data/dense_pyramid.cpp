#include "core/data/dense_pyramid.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "core/base/parallel.h"
#include "core/data/convert.h"

namespace voxloom {

namespace {

constexpr double kInvalid = std::numeric_limits<double>::quiet_NaN();

ScalarType tree_type_for(ScalarType type, PyramidFilter filter) {
    if (filter != PyramidFilter::lifting53) return type;
    switch (type) {
        case ScalarType::u8:
        case ScalarType::i8: return ScalarType::i16;
        case ScalarType::u16:
        case ScalarType::i16: return ScalarType::i32;
        case ScalarType::u32:
        case ScalarType::i32: return ScalarType::f64;
        default: return type;
    }
}

// Whole rows of a level: all of x, some of y and z.
struct Rows {
    Box box;
    ScalarType type = ScalarType::u8;
    int components = 1;
    const std::byte* voxels = nullptr;
    const std::uint8_t* mask = nullptr;  // null: all valid
    Buffer own_voxels, own_mask;         // where they had to be read

    std::size_t voxel(std::int64_t y, std::int64_t z) const {
        const Index3 n = box.dims();
        return std::size_t(((z - box.lo.z) * n.y + y - box.lo.y) * n.x);
    }
    const std::byte* row(std::int64_t y, std::int64_t z) const {
        return voxels + voxel(y, z) * std::size_t(components) * bytes_of(type);
    }
    const std::uint8_t* mask_row(std::int64_t y, std::int64_t z) const {
        return mask ? mask + voxel(y, z) : nullptr;
    }
    std::size_t row_values() const { return std::size_t(box.dims().x) * std::size_t(components); }

    // A row as numbers, NaN where it is not valid.
    void load(std::int64_t y, std::int64_t z, double* out) const {
        to_double(type, row(y, z), row_values(), out);
        if (is_float(type))
            for (std::size_t i = 0; i < row_values(); ++i)
                if (std::isinf(out[i])) out[i] = kInvalid;
        if (const std::uint8_t* valid = mask_row(y, z))
            for (std::size_t i = 0; i < row_values(); ++i)
                if (!valid[i / std::size_t(components)]) out[i] = kInvalid;
    }
};

class DensePyramid final : public Bricks {
  public:
    DensePyramid(BricksDesc desc, VolumePtr volume) : Bricks(std::move(desc)), volume_(std::move(volume)) {
        voxels.resize(this->desc().levels.size());
        masks.resize(this->desc().levels.size());
        infos.resize(this->desc().levels.size());
        for (std::size_t l = 0; l < infos.size(); ++l) {
            const glm::i64vec3 n(this->desc().levels[l].bricks);
            infos[l].resize(std::size_t(n.x * n.y * n.z));
        }
    }

    BrickInfo info(BrickId id) const override { return infos[std::size_t(id.level)][place(id)]; }
    std::optional<BrickId> parent(BrickId) const override { return std::nullopt; }
    std::vector<DecodedBrick> refine(BrickId id, const BrickVoxels*,
                                     const std::stop_token& stop) const override {
        const Box box = desc().box_of(id);
        auto brick = std::make_shared<BrickVoxels>();
        brick->stored = box.dims();
        brick->voxels = Buffer(family_bytes(id), "brick");
        const ScalarType type = desc().volume.type, tree = desc().tree_type;
        const int components = desc().volume.components;
        if (id.level == 0 && !volume_->data() && tree == type) {
            volume_->read(box, brick->voxels.bytes(), stop);
        } else if (id.level == 0 && !volume_->data()) {
            Buffer read(box.voxels() * desc().volume.voxel_bytes(), "brick");
            volume_->read(box, read.bytes(), stop);
            convert_box(box, type, read.data(), box, tree, brick->voxels.data(), box, components);
        } else {
            const Box all = Box::of(desc().levels[std::size_t(id.level)].dims);
            const bool fine = id.level == 0;
            convert_box(box, fine ? type : tree, fine ? volume_->data() : level_data(id.level), all, tree,
                        brick->voxels.data(), box, components);
        }
        std::vector<DecodedBrick> family;
        family.push_back({id, std::move(brick)});
        return family;
    }
    std::uint64_t family_bytes(BrickId id) const override {
        return desc().box_of(id).voxels() * desc().tree_voxel_bytes();
    }
    const std::byte* level_data(int level) const override {
        if (level > 0) return voxels[std::size_t(level)].data();
        return desc().tree_type == desc().volume.type ? volume_->data() : nullptr;
    }
    void read_mask(int level, const Box& box, std::span<std::uint8_t> out) const override {
        if (level == 0) return volume_->read_mask(box, out);
        copy_box(box, masks[std::size_t(level)].data(), Box::of(desc().levels[std::size_t(level)].dims),
                 reinterpret_cast<std::byte*>(out.data()), box, 1);
    }
    std::uint64_t resident_bytes() const override {
        std::uint64_t sum = volume_->resident_bytes();
        for (std::size_t l = 0; l < voxels.size(); ++l)
            sum += voxels[l].size() + masks[l].size() + infos[l].size() * sizeof(BrickInfo);
        return sum;
    }

    std::size_t place(BrickId id) const {
        const glm::i64vec3 n(desc().levels[std::size_t(id.level)].bricks), i(id.index);
        return std::size_t((i.z * n.y + i.y) * n.x + i.x);
    }
    // Rows of a level; `box` spans all of x.
    Rows rows(int level, const Box& box, const std::stop_token& stop) const {
        Rows r;
        r.box = box;
        r.components = desc().volume.components;
        const Box all = Box::of(desc().levels[std::size_t(level)].dims);
        if (level > 0) {
            r.box = all;
            r.type = desc().tree_type;
            r.voxels = voxels[std::size_t(level)].data();
            if (desc().volume.has_mask) r.mask = masks[std::size_t(level)].as<std::uint8_t>().data();
            return r;
        }
        r.type = desc().volume.type;
        r.voxels = volume_->data();
        if (r.voxels && !desc().volume.has_mask) {
            r.box = all;
            return r;
        }
        r.own_voxels = Buffer(box.voxels() * desc().volume.voxel_bytes(), "pyramid");
        volume_->read(box, r.own_voxels.bytes(), stop);
        r.voxels = r.own_voxels.data();
        if (desc().volume.has_mask) {
            r.own_mask = Buffer(box.voxels(), "pyramid");
            volume_->read_mask(box, r.own_mask.as<std::uint8_t>());
            r.mask = r.own_mask.as<std::uint8_t>().data();
        }
        return r;
    }

    // Of each level; filled in while it is built, constant ever after. Level 0 has no arrays.
    std::vector<Buffer> voxels, masks;
    std::vector<std::vector<BrickInfo>> infos;

  private:
    VolumePtr volume_;
};

// Runs tasks [0, count) in parallel, some at a time, so that progress can be told from this thread.
template <class Task>
void in_batches(std::int64_t count, std::int64_t batch, const Task& task, const std::stop_token& stop,
                const std::function<void(std::int64_t, std::int64_t)>& after) {
    for (std::int64_t first = 0; first < count; first += batch) {
        const std::int64_t last = std::min(first + batch, count);
        parallel_for(first, last, 1, [&](std::int64_t lo, std::int64_t hi) {
            for (std::int64_t i = lo; i < hi; ++i) {
                check_stop(stop);
                task(i);
            }
        }, stop);
        after(first, last);
    }
}

// --- filters -------------------------------------------------------------------------------------

// Weights of the samples `first`, first + 1, ... around the centre.
struct Taps {
    int first = 0, count = 1;
    std::array<double, 5> weight{1};
};

// For the sample `centre` of `n`: at the ends, point reflection folds the outer weights back.
Taps taps(PyramidFilter filter, bool halved, std::int64_t centre, std::int64_t n) {
    if (!halved || filter == PyramidFilter::subsample || centre == 0 || centre == n - 1) return {};
    if (filter == PyramidFilter::average) return {-1, 3, {0.25, 0.5, 0.25}};
    if (centre == n - 2) return {-2, 3, {-0.125, 0.25, 0.875}};
    return {-2, 5, {-0.125, 0.25, 0.75, 0.25, -0.125}};
}

// The weighted mean of what is valid, with the weights of `average`. value(offset) may be NaN.
template <class Value>
double repaired(const Taps& t, const Value& value) {
    double sum = 0, weights = 0;
    for (int k = 0; k < t.count; ++k) {
        const int offset = t.first + k;
        const double v = value(offset);
        const double w = offset == 0 ? 0.5 : std::abs(offset) == 1 ? 0.25 : 0.0;
        if (w == 0.0 || std::isnan(v)) continue;
        sum += w * v;
        weights += w;
    }
    return weights > 0 ? sum / weights : kInvalid;
}

// One row along x: `n` samples in, every one or every second out.
void filter_row(PyramidFilter filter, bool halved, const double* in, std::int64_t n, int components,
                double* out) {
    const std::int64_t step = halved ? 2 : 1;
    for (std::int64_t centre = 0; centre < n; centre += step) {
        const Taps t = taps(filter, halved, centre, n);
        for (int c = 0; c < components; ++c) {
            auto value = [&](int offset) { return in[(centre + offset) * components + c]; };
            double sum = 0;
            for (int k = 0; k < t.count; ++k) sum += t.weight[std::size_t(k)] * value(t.first + k);
            *out++ = std::isnan(sum) ? repaired(t, value) : sum;
        }
    }
}

// The same across rows or planes: at(offset) points at `count` values.
template <class At>
void combine(const Taps& t, const At& at, std::size_t count, double* out) {
    const double* row = at(t.first);
    for (std::size_t i = 0; i < count; ++i) out[i] = t.weight[0] * row[i];
    for (int k = 1; k < t.count; ++k) {
        row = at(t.first + k);
        for (std::size_t i = 0; i < count; ++i) out[i] += t.weight[std::size_t(k)] * row[i];
    }
    for (std::size_t i = 0; i < count; ++i)
        if (std::isnan(out[i])) out[i] = repaired(t, [&](int offset) { return at(offset)[i]; });
}

class LevelBuilder {
  public:
    LevelBuilder(DensePyramid& pyramid, int level, PyramidFilter filter)
        : pyramid_(pyramid), from_(level - 1), to_(level), filter_(filter) {
        const BricksDesc& desc = pyramid.desc();
        fine_ = desc.levels[std::size_t(from_)].dims;
        coarse_ = desc.levels[std::size_t(to_)].dims;
        halved_ = glm::notEqual(desc.levels[std::size_t(from_)].stride, desc.levels[std::size_t(to_)].stride);
        components_ = desc.volume.components;
        pyramid.voxels[std::size_t(to_)] =
            Buffer(checked_product(coarse_, desc.tree_voxel_bytes(), "pyramid"), "pyramid");
        if (desc.volume.has_mask)
            pyramid.masks[std::size_t(to_)] = Buffer(checked_product(coarse_, 1, "pyramid"), "pyramid");
    }

    // The level is cut into tiles of whole rows.
    std::int64_t tiles() const { return tiles(1) * tiles(2); }
    void build_tile(std::int64_t tile, const std::stop_token& stop) const {
        Index3 lo(0), hi = coarse_;
        lo.y = tile % tiles(1) * kTile.y;
        lo.z = tile / tiles(1) * kTile.z;
        hi.y = std::min(hi.y, lo.y + kTile.y);
        hi.z = std::min(hi.z, lo.z + kTile.z);
        const Index3 step = glm::mix(Index3(1), Index3(2), halved_);
        const Index3 reach = glm::mix(Index3(0), Index3(2), halved_);
        Box need{glm::max(lo * step - reach, Index3(0)),
                 glm::min((hi - Index3(1)) * step + reach + Index3(1), fine_)};
        need.lo.x = 0;
        need.hi.x = fine_.x;
        const Rows rows = pyramid_.rows(from_, need, stop);
        if (filter_ == PyramidFilter::subsample)
            pick({lo, hi}, step, rows);
        else
            filter({lo, hi}, step, need, rows, stop);
    }

  private:
    static constexpr Index3 kTile{0, 64, 8};
    // Less than half of 1/512, the step of what three passes of a filter make of integers.
    static constexpr double kTie = 1.0 / 4096;
    std::int64_t tiles(int axis) const { return (coarse_[axis] + kTile[axis] - 1) / kTile[axis]; }
    std::size_t place(std::int64_t y, std::int64_t z) const {
        return std::size_t((z * coarse_.y + y) * coarse_.x);
    }

    void pick(const Box& tile, Index3 step, const Rows& rows) const {
        const std::size_t bytes = pyramid_.desc().tree_voxel_bytes();
        for (std::int64_t z = tile.lo.z; z < tile.hi.z; ++z)
            for (std::int64_t y = tile.lo.y; y < tile.hi.y; ++y) {
                const std::byte* from = rows.row(y * step.y, z * step.z);
                std::byte* to = pyramid_.voxels[std::size_t(to_)].data() + place(y, z) * bytes;
                for (std::int64_t x = 0; x < coarse_.x; ++x)
                    std::copy_n(from + std::size_t(x * step.x) * bytes, bytes, to + std::size_t(x) * bytes);
                if (!rows.mask) continue;
                const std::uint8_t* valid = rows.mask_row(y * step.y, z * step.z);
                std::uint8_t* out = mask_row(y, z);
                for (std::int64_t x = 0; x < coarse_.x; ++x) out[x] = valid[x * step.x];
            }
    }

    // x first, then y, into planes; then z across planes, of which five are kept.
    void filter(const Box& tile, Index3 step, const Box& need, const Rows& rows,
                const std::stop_token& stop) const {
        const std::size_t row = std::size_t(coarse_.x) * std::size_t(components_);
        const std::size_t plane = row * std::size_t(tile.dims().y);
        std::vector<double> line(rows.row_values()), narrow(row * std::size_t(need.dims().y)), result(plane);
        std::array<std::vector<double>, 5> planes;
        std::array<std::int64_t, 5> plane_of;
        plane_of.fill(-1);
        auto plane_at = [&](std::int64_t z) {
            std::vector<double>& made = planes[std::size_t(z % 5)];
            if (std::exchange(plane_of[std::size_t(z % 5)], z) == z) return made.data();
            made.resize(plane);
            for (std::int64_t y = need.lo.y; y < need.hi.y; ++y) {
                rows.load(y, z, line.data());
                filter_row(filter_, halved_.x, line.data(), fine_.x, components_,
                           &narrow[std::size_t(y - need.lo.y) * row]);
            }
            for (std::int64_t y = tile.lo.y; y < tile.hi.y; ++y) {
                auto at = [&](int offset) {
                    return &narrow[std::size_t(y * step.y + offset - need.lo.y) * row];
                };
                combine(taps(filter_, halved_.y, y * step.y, fine_.y), at, row,
                        &made[std::size_t(y - tile.lo.y) * row]);
            }
            return made.data();
        };
        for (std::int64_t z = tile.lo.z; z < tile.hi.z; ++z) {
            check_stop(stop);
            const Taps t = taps(filter_, halved_.z, z * step.z, fine_.z);
            for (int k = 0; k < t.count; ++k) plane_at(z * step.z + t.first + k);
            combine(t, [&](int offset) { return plane_at(z * step.z + offset); }, plane, result.data());
            for (std::int64_t y = tile.lo.y; y < tile.hi.y; ++y)
                store(&result[std::size_t(y - tile.lo.y) * row], y, z);
        }
    }

    void store(double* values, std::int64_t y, std::int64_t z) const {
        const BricksDesc& desc = pyramid_.desc();
        const std::size_t count = std::size_t(coarse_.x) * std::size_t(components_);
        // Filters see finite values only; an overshoot beyond what a double holds is cut off.
        constexpr double most = std::numeric_limits<double>::max();
        for (std::size_t i = 0; i < count; ++i) values[i] = std::clamp(values[i], -most, most);
        if (desc.volume.has_mask)
            for (std::int64_t x = 0; x < coarse_.x; ++x)
                mask_row(y, z)[x] = !std::all_of(values + x * components_, values + (x + 1) * components_,
                                                 [](double v) { return std::isnan(v); });
        // Ties go up at every second sample. Half to even would not do: where all values lie between
        // 100 and 101, it takes every tie to 100, and the levels darken by 0.03 each.
        if (!is_float(desc.volume.type))
            for (std::int64_t x = 0; x < coarse_.x; ++x)
                for (int c = 0; c < components_; ++c) {
                    double& v = values[x * components_ + c];
                    v = std::isnan(v) ? 0.0 : round_half_to_even(v + ((x + y + z) & 1 ? kTie : -kTie));
                }
        from_double(values, count, desc.tree_type,
                    pyramid_.voxels[std::size_t(to_)].data() + place(y, z) * desc.tree_voxel_bytes());
    }
    std::uint8_t* mask_row(std::int64_t y, std::int64_t z) const {
        return pyramid_.masks[std::size_t(to_)].as<std::uint8_t>().data() + place(y, z);
    }

    DensePyramid& pyramid_;
    int from_, to_;
    PyramidFilter filter_;
    Index3 fine_, coarse_;
    glm::bvec3 halved_;
    int components_;
};

// --- errors and ranges ---------------------------------------------------------------------------

// Finite, valid values of a box of voxels; {0, 0} when there is none.
ValueRange range_of(const Rows& rows, const Box& box) {
    double lo = std::numeric_limits<double>::infinity(), hi = -lo;
    with_type(rows.type, [&](auto t) {
        using T = decltype(t);
        T smallest = std::numeric_limits<T>::max(), largest = std::numeric_limits<T>::lowest();
        const std::int64_t c = rows.components;
        for (std::int64_t z = box.lo.z; z < box.hi.z; ++z)
            for (std::int64_t y = box.lo.y; y < box.hi.y; ++y) {
                const T* row = reinterpret_cast<const T*>(rows.row(y, z));
                const std::uint8_t* valid = rows.mask_row(y, z);
                for (std::int64_t i = box.lo.x * c; i < box.hi.x * c; ++i) {
                    if constexpr (std::is_floating_point_v<T>)
                        if (!std::isfinite(row[i])) continue;
                    if (valid && !valid[i / c]) continue;
                    smallest = std::min(smallest, row[i]);
                    largest = std::max(largest, row[i]);
                }
            }
        if (smallest <= largest) lo = double(smallest), hi = double(largest);
    });
    return lo <= hi ? ValueRange{lo, hi} : ValueRange{};
}

// The box and the one layer around it that exists.
Box with_neighbours(const Box& box, Index3 dims) {
    return {glm::max(box.lo - Index3(1), Index3(0)), glm::min(box.hi + Index3(1), dims)};
}

// Measures level `level`, interpolated linearly, against rows of the original.
class RowError {
  public:
    struct Part {
        double squares = 0, largest = 0;
        bool exact = true;
    };

    RowError(const DensePyramid& pyramid, int level)
        : level_(pyramid.desc().levels[std::size_t(level)]),
          rows_(pyramid.rows(level, Box::of(level_.dims), {})),
          type_(pyramid.desc().volume.type) {
        for (auto& line : lines_) line.resize(rows_.row_values());
        blend_.resize(rows_.row_values());
        narrowed_.resize(rows_.row_values() * bytes_of(type_));
        for (std::int64_t x = 0; x < pyramid.desc().volume.dims.x; ++x) across_.push_back(corner(x, 0));
    }

    // Adds the errors of row (y, z) of level 0 to `parts`, each of which covers `part` voxels.
    void add(const double* original, std::int64_t n, std::int64_t y, std::int64_t z, std::int64_t part,
             Part* parts) {
        const int c = rows_.components;
        const Corner cy = corner(y, 1), cz = corner(z, 2);
        const bool two_y = cy.f > 0, two_z = cz.f > 0;
        load(0, cy.first, cz.first);
        if (two_y) load(1, cy.first + 1, cz.first);
        if (two_z) load(2, cy.first, cz.first + 1);
        if (two_y && two_z) load(3, cy.first + 1, cz.first + 1);
        for (std::size_t i = 0; i < blend_.size(); ++i) {
            const double near = two_y ? mix(lines_[0][i], lines_[1][i], cy.f) : lines_[0][i];
            if (!two_z) {
                blend_[i] = near;
            } else {
                const double far = two_y ? mix(lines_[2][i], lines_[3][i], cy.f) : lines_[2][i];
                blend_[i] = mix(near, far, cz.f);
            }
        }
        // The share of each of the four rows; those without one are not loaded.
        const double weight[4] = {(1 - cy.f) * (1 - cz.f), cy.f * (1 - cz.f), (1 - cy.f) * cz.f,
                                  cy.f * cz.f};
        for (std::int64_t first = 0; first < n; first += part, ++parts) {
            Part sum;
            for (std::int64_t x = first; x < std::min(first + part, n); ++x) {
                const Corner cx = across_[std::size_t(x)];
                for (int k = 0; k < c; ++k) {
                    const double truth = original[x * c + k];
                    const std::size_t a = std::size_t(cx.first * c + k), b = a + std::size_t(c);
                    double v = cx.f > 0 ? mix(blend_[a], blend_[b], cx.f) : blend_[a];
                    if (std::isnan(truth)) continue;
                    if (std::isnan(v)) v = of_valid(a, b, cx.f, weight);
                    if (std::isnan(v)) {
                        sum.exact = false;
                        continue;
                    }
                    const double error = std::abs(v - truth);
                    sum.squares += error * error;
                    sum.largest = std::max(sum.largest, error);
                }
            }
            parts->squares += sum.squares;
            parts->largest = std::max(parts->largest, sum.largest);
            parts->exact = parts->exact && sum.exact;
        }
    }

  private:
    struct Corner {
        std::int64_t first;
        double f;  // weight of first + 1; 0 at the last sample, which is continued
    };
    Corner corner(std::int64_t fine, int axis) const {
        const std::int64_t stride = level_.stride[axis], first = fine / stride;
        if (first + 1 >= level_.dims[axis]) return {level_.dims[axis] - 1, 0.0};
        return {first, double(fine % stride) / double(stride)};
    }
    // Exact for equal values, and without overflow.
    static double mix(double a, double b, double f) { return a == b ? a : a * (1 - f) + b * f; }
    // A row as it is delivered, NaN where it is not valid.
    void load(std::size_t line, std::int64_t y, std::int64_t z) {
        rows_.load(y, z, lines_[line].data());
        if (rows_.type == type_) return;
        convert(rows_.type, rows_.row(y, z), type_, narrowed_.data(), rows_.row_values());
        std::vector<double>& values = lines_[line];
        scratch_.resize(values.size());
        to_double(type_, narrowed_.data(), values.size(), scratch_.data());
        for (std::size_t i = 0; i < values.size(); ++i)
            if (!std::isnan(values[i])) values[i] = scratch_[i];
    }
    // The valid ones of the eight corners, their weights renormalised.
    double of_valid(std::size_t a, std::size_t b, double f, const double* weight) const {
        double sum = 0, weights = 0;
        auto add_one = [&](double w, double v) {
            if (std::isnan(v)) return;
            sum += w * v;
            weights += w;
        };
        for (std::size_t k = 0; k < 4; ++k) {
            if (weight[k] <= 0) continue;
            add_one(weight[k] * (1 - f), lines_[k][a]);
            if (f > 0) add_one(weight[k] * f, lines_[k][b]);
        }
        return weights > 0 ? sum / weights : kInvalid;
    }

    LevelDesc level_;
    Rows rows_;
    ScalarType type_;
    std::vector<Corner> across_;  // of each x
    std::array<std::vector<double>, 4> lines_;
    std::vector<double> blend_, scratch_;
    std::vector<std::byte> narrowed_;
};

// Ranges of level 0 and errors of all others, in one walk over level 0: one task reads one row of
// bricks along x. Sums are added up in order of place, whatever the threads did.
void measure_bricks(DensePyramid& pyramid, const std::stop_token& stop,
                    const std::function<void(double)>& progress) {
    const BricksDesc& desc = pyramid.desc();
    const Index3 grid(desc.levels[0].bricks), brick(desc.brick), dims = desc.volume.dims;
    const int levels = int(desc.levels.size());
    const std::int64_t batch = 64;
    std::vector<RowError::Part> parts(std::size_t(batch * grid.x * levels));
    const std::int64_t tasks = grid.y * grid.z;

    auto measure_row = [&](std::int64_t task) {
        RowError::Part* mine = &parts[std::size_t(task % batch * grid.x * levels)];
        std::fill_n(mine, grid.x * levels, RowError::Part{});
        const Index3 lo = Index3(0, task % grid.y, task / grid.y) * brick;
        const Box own{lo, {dims.x, std::min(lo.y + brick.y, dims.y), std::min(lo.z + brick.z, dims.z)}};
        const Rows rows = pyramid.rows(0, with_neighbours(own, dims), stop);
        for (std::int64_t x = 0; x < grid.x; ++x) {
            const BrickId id{0, glm::ivec3(x, task % grid.y, task / grid.y)};
            pyramid.infos[0][pyramid.place(id)].range =
                range_of(rows, with_neighbours(desc.box_of(id), dims));
        }
        std::vector<double> original(rows.row_values());
        std::vector<RowError> errors;
        for (int l = 1; l < levels; ++l) errors.emplace_back(pyramid, l);
        for (std::int64_t z = own.lo.z; z < own.hi.z; ++z) {
            check_stop(stop);
            for (std::int64_t y = own.lo.y; y < own.hi.y; ++y) {
                rows.load(y, z, original.data());
                for (int l = 1; l < levels; ++l)
                    errors[std::size_t(l) - 1].add(original.data(), dims.x, y, z, brick.x, mine + l * grid.x);
            }
        }
    };
    auto add_up = [&](std::int64_t first, std::int64_t last) {
        for (std::int64_t task = first; task < last; ++task)
            for (std::int64_t x = 0; x < grid.x; ++x) {
                BrickId id{0, glm::ivec3(x, task % grid.y, task / grid.y)};
                for (int l = 1; l < levels; ++l) {
                    const std::size_t octant = std::size_t(desc.octant_of(id));
                    id = *desc.coarser(id);
                    const RowError::Part& part =
                        parts[std::size_t((task % batch * levels + l) * grid.x + x)];
                    BrickInfo& info = pyramid.infos[std::size_t(l)][pyramid.place(id)];
                    info.l2 += part.squares;
                    info.octant_l2[octant] += part.squares;
                    info.max_error = std::max(info.max_error, part.largest);
                    info.exact_error = info.exact_error && part.exact;
                }
            }
        if (progress) progress(double(last) / double(tasks));
    };
    for (auto& infos : pyramid.infos)
        for (BrickInfo& info : infos) info.exact_error = true;
    in_batches(tasks, batch, measure_row, stop, add_up);
    for (auto& infos : pyramid.infos)
        for (BrickInfo& info : infos) {
            info.l2 = std::sqrt(info.l2);
            for (double& octant : info.octant_l2) octant = std::sqrt(octant);
        }
}

// Ranges of a coarse level, as it is delivered.
void measure_ranges(DensePyramid& pyramid, int level, const std::stop_token& stop) {
    const BricksDesc& desc = pyramid.desc();
    const LevelDesc& here = desc.levels[std::size_t(level)];
    const Rows rows = pyramid.rows(level, Box::of(here.dims), stop);
    const auto [lo, hi] = limits_of(desc.volume.type);
    const glm::i64vec3 grid(here.bricks);
    parallel_for(0, grid.x * grid.y * grid.z, 4, [&, lowest = lo, highest = hi](std::int64_t a, std::int64_t b) {
        for (std::int64_t i = a; i < b; ++i) {
            const BrickId id{level, glm::ivec3(i % grid.x, i / grid.x % grid.y, i / (grid.x * grid.y))};
            ValueRange range = range_of(rows, with_neighbours(desc.box_of(id), here.dims));
            range = {std::clamp(range.min, lowest, highest), std::clamp(range.max, lowest, highest)};
            pyramid.infos[std::size_t(level)][pyramid.place(id)].range = range;
        }
    }, stop);
}

}  // namespace

BricksDesc dense_pyramid_desc(const VolumeDesc& volume, glm::ivec3 brick, PyramidFilter filter) {
    BricksDesc desc;
    desc.volume = volume;
    desc.brick = brick;
    desc.tree_type = tree_type_for(volume.type, filter);
    desc.levels = pyramid_levels(volume, brick);
    desc.compressed_bytes = volume.dense_bytes();
    for (std::size_t l = 1; l < desc.levels.size(); ++l)
        desc.compressed_bytes += checked_product(desc.levels[l].dims, desc.tree_voxel_bytes(), "pyramid");
    return desc;
}

BricksPtr make_dense_pyramid(VolumePtr volume, glm::ivec3 brick, PyramidFilter filter,
                             const std::stop_token& stop, const std::function<void(double)>& progress) {
    if (!volume->reads_by_region()) volume = in_memory(std::move(volume), stop);
    auto pyramid =
        std::make_shared<DensePyramid>(dense_pyramid_desc(volume->desc(), brick, filter), volume);
    const BricksDesc& desc = pyramid->desc();
    for (std::size_t l = 0; l < desc.levels.size(); ++l)
        for (std::size_t i = 0; i < pyramid->infos[l].size(); ++i) {
            const glm::i64vec3 n(desc.levels[l].bricks), place(i);
            const BrickId id{int(l), glm::ivec3(place.x % n.x, place.x / n.x % n.y, place.x / (n.x * n.y))};
            pyramid->infos[l][i].compressed_bytes =
                desc.box_of(id).voxels() * (l == 0 ? desc.volume.voxel_bytes() : desc.tree_voxel_bytes());
        }
    // Level 1 takes about a third of the time, the errors most of the rest.
    for (int l = 1; l < int(desc.levels.size()); ++l) {
        const LevelBuilder builder(*pyramid, l, filter);
        in_batches(builder.tiles(), 32, [&](std::int64_t tile) { builder.build_tile(tile, stop); }, stop,
                   [&](std::int64_t, std::int64_t done) {
                       if (progress && l == 1) progress(double(done) / double(builder.tiles()) / 3);
                   });
        measure_ranges(*pyramid, l, stop);
    }
    measure_bricks(*pyramid, stop, [&](double fraction) {
        if (progress) progress((1 + 2 * fraction) / 3);
    });
    return pyramid;
}

}  // namespace voxloom
