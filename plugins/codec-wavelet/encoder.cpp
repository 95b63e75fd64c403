// Bottom up: the transform fills all coarser levels. Then, for a step, top down: every level is quantised
// and restored as the decoder will see it, since the coders lean on the restored parent. The search for
// a step looks at some of the families; what is reported was measured on all of them.
#include "plugins/codec-wavelet/encoder.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/base/text.h"
#include "core/data/convert.h"
#include "plugins/codec-wavelet/byte_io.h"
#include "plugins/codec-wavelet/exact_layer.h"
#include "plugins/codec-wavelet/file_format.h"
#include "plugins/codec-wavelet/statistics.h"

namespace voxloom::wavelet {

namespace {

constexpr std::int64_t kBatch = 128;            // families whose bytes wait to be appended in order
constexpr std::int64_t kTrainingFamilies = 384; // of each level
constexpr std::int64_t kSearchFamilies = 256;   // of level 0, looked at by the search for a step

FamilyId family_at(const TreeDesc& tree, int level, std::int64_t i) {
    const glm::i64vec3 n(families_of(tree, level));
    return {level, glm::ivec3(i % n.x, i / n.x % n.y, i / (n.x * n.y))};
}
std::int64_t family_count(const TreeDesc& tree, int level) {
    const glm::i64vec3 n(families_of(tree, level));
    return n.x * n.y * n.z;
}
// A family's parent as a box of its level; the root has none.
Box parent_box(const TreeDesc& tree, FamilyId family) {
    return stored_box(tree, {family.level + 1, family.index});
}

struct Encoded {
    Bytes bytes;
    double squares = 0, largest = 0;
    std::uint64_t finite = 0, patches = 0;
    std::vector<std::pair<std::size_t, BrickInfo>> bricks;  // of level 0
    std::vector<BrickParts> parts;
};

class Encoder {
  public:
    Encoder(const Volume& volume, const EncodeOptions& options, const std::stop_token& stop,
            const std::function<void(double)>& progress)
        : volume_(volume), options_(options), stop_(stop), progress_(progress), tree_(plan(volume.desc(), options)) {}

    std::shared_ptr<const WaveletBricks> run(EncodeReport& report) {
        tree_.bricks.volume.range = value_range(volume_, stop_);
        tree_.map = map_of(type(), range(), lossy() ? fraction_bits() : 0);
        tree_.distances = options_.target == Target::lossless && !is_exact(type(), range());
        if (!tree_.empty()) analyse();
        auto result = tree_.empty() ? emit(report) : search(report);
        tell(1);
        return result;
    }

  private:
    ScalarType type() const { return tree_.bricks.volume.type; }
    const ValueRange& range() const { return *tree_.bricks.volume.range; }
    bool lossy() const { return options_.target != Target::lossless && options_.target != Target::threshold; }
    int fraction_bits() const { return bytes_of(type()) == 1 ? 4 : 3; }
    void tell(double fraction) const {
        if (progress_) progress_(fraction);
    }

    // --- originals ---

    Buffer voxels_of(const Box& box) const {
        Buffer voxels(box.voxels() * volume_.desc().voxel_bytes(), "voxels to encode");
        volume_.read(box, voxels.bytes(), stop_);
        return voxels;
    }

    Buffer part_of(const Buffer& voxels, const Box& box, const Box& part) const {
        const std::size_t each = volume_.desc().voxel_bytes();
        Buffer out(part.voxels() * each, "voxels to encode");
        copy_box(part, voxels.data(), box, out.data(), part, each);
        return out;
    }

    // What is not finite is filled with the last value before it: a jump would cost details. Shared faces are
    // filled from what they hold themselves.
    FamilyCodec::Planes integers_of(FamilyId family, const Buffer& voxels) const {
        const Box box = box_of(tree_, family);
        const auto components = std::size_t(volume_.desc().components);
        const std::size_t count = box.voxels();
        FamilyCodec::Planes planes(components, std::vector<std::int32_t>(count));
        const int shift = tree_.map.shift();
        if (!is_float(type()) && bytes_of(type()) <= 2 && shift >= 0) {  // a short cut without floating point
            with_type(type(), [&](auto t) {
                const auto values = voxels.as<decltype(t)>();
                for (std::size_t c = 0; c < components; ++c)
                    for (std::size_t i = 0; i < count; ++i)
                        planes[c][i] = std::int32_t(values[i * components + c]) * (1 << shift);
            });
            return planes;
        }
        std::vector<double> values(count * components);
        to_double(type(), voxels.data(), values.size(), values.data());
        for_each_part(shape_of(tree_, family), [&](glm::ivec3 lo, glm::ivec3 hi) {
            const auto each = [&](auto&& use) {
                for (std::int64_t z = lo.z; z < hi.z; ++z)
                    for (std::int64_t y = lo.y; y < hi.y; ++y)
                        for (std::int64_t x = lo.x; x < hi.x; ++x) use(std::size_t((z * box.dims().y + y) * box.dims().x + x));
            };
            for (std::size_t c = 0; c < components; ++c) {
                double last = std::numeric_limits<double>::quiet_NaN();
                each([&](std::size_t i) {
                    if (std::isnan(last) && std::isfinite(values[i * components + c])) last = values[i * components + c];
                });
                if (std::isnan(last)) last = range().min / 2 + range().max / 2;
                each([&](std::size_t i) {
                    if (std::isfinite(values[i * components + c])) last = values[i * components + c];
                    planes[c][i] = tree_.map.tree(last);
                });
            }
        });
        return planes;
    }
    FamilyCodec::Planes originals(FamilyId family) const {
        const Box box = box_of(tree_, family);
        return family.level == 0 ? integers_of(family, voxels_of(box)) : original_[std::size_t(family.level)].read(box);
    }
    // The inside of a family's box, and each shared face, edge and corner.
    template <class Use>
    static void for_each_part(const Shape& shape, const Use& use) {
        std::array<std::vector<int>, 3> at;
        for (int a = 0; a < 3; ++a)
            at[std::size_t(a)] = cuts(shape.dims[a], shape.shared.lo[a], shape.shared.hi[a], shape.dims[a]);
        for (std::size_t k = 0; k + 1 < at[2].size(); ++k)
            for (std::size_t j = 0; j + 1 < at[1].size(); ++j)
                for (std::size_t i = 0; i + 1 < at[0].size(); ++i)
                    use(glm::ivec3(at[0][i], at[1][j], at[2][k]), glm::ivec3(at[0][i + 1], at[1][j + 1], at[2][k + 1]));
    }

    void analyse() {
        const int top = tree_.top();
        original_.resize(std::size_t(top) + 1);
        decoded_.resize(std::size_t(top) + 1);
        for (int l = 1; l <= top; ++l)
            original_[std::size_t(l)] = LevelStore(tree_.bricks.levels[std::size_t(l)].dims, tree_.bricks.volume.components);
        for (int l = 0; l < top; ++l)
            parallel_for(0, family_count(tree_, l), 1, [&](std::int64_t lo, std::int64_t hi) {
                std::vector<std::int32_t> scratch;
                for (std::int64_t i = lo; i < hi; ++i) {
                    check_stop(stop_);
                    const FamilyId family = family_at(tree_, l, i);
                    const Shape shape = shape_of(tree_, family);
                    const glm::ivec3 n = shape.low();
                    auto planes = originals(family);
                    for (auto& plane : planes) {
                        forward(plane.data(), shape.dims, shape.halved, tree_.rounding, scratch, shape.shared);
                        std::size_t to = 0;  // keeps the low band only
                        for (int z = 0; z < n.z; ++z)
                            for (int y = 0; y < n.y; ++y, to += std::size_t(n.x))
                                std::copy_n(plane.begin() + std::ptrdiff_t(shape.at({0, y, z})), n.x,
                                            plane.begin() + std::ptrdiff_t(to));
                        plane.resize(to);
                    }
                    original_[std::size_t(l) + 1].write(tree_.bricks.box_of({l + 1, family.index}), planes,
                                                        parent_box(tree_, family));
                }
            }, stop_);
        tell(0.1);
    }

    // --- top down ---

    FamilyCodec::Planes parent_of(FamilyId family) const {
        if (family.level == tree_.top()) return {};
        return decoded_[std::size_t(family.level) + 1].read(parent_box(tree_, family));
    }

    // Levels above 0 as the decoder will see them.
    void restore_levels() {
        const Untrained none;
        const FamilyCodec codec(tree_, none);
        for (int l = tree_.top(); l > 0; --l) {
            decoded_[std::size_t(l)] = LevelStore(tree_.bricks.levels[std::size_t(l)].dims, tree_.bricks.volume.components);
            parallel_for(0, family_count(tree_, l), 4, [&](std::int64_t lo, std::int64_t hi) {
                for (std::int64_t i = lo; i < hi; ++i) {
                    const FamilyId family = family_at(tree_, l, i);
                    auto planes = originals(family);
                    codec.restore(family, parent_of(family), planes, [](const Details&) {});
                    decoded_[std::size_t(l)].write(own_box(tree_, family), planes, box_of(tree_, family));
                }
            }, stop_);
        }
    }

    // A coder that has seen some families of each level.
    std::unique_ptr<Coder> trained() const {
        std::unique_ptr<Coder> coder = make_coder(options_.coder);
        const FamilyCodec codec(tree_, *coder);
        for (int l = tree_.top() - 1; l >= 0; --l) {
            const std::int64_t count = family_count(tree_, l), step = (count + kTrainingFamilies - 1) / kTrainingFamilies;
            for (std::int64_t i = step / 2; i < count; i += step) {
                check_stop(stop_);
                const FamilyId family = family_at(tree_, l, i);
                auto planes = originals(family);
                codec.restore(family, parent_of(family), planes, [&](const Details& d) { coder->train(d); });
            }
        }
        coder->finish_training();
        return coder;
    }

    Encoded encode_family(const FamilyCodec& codec, FamilyId family) const {
        Encoded result;
        const VolumeDesc& volume = tree_.bricks.volume;
        if (family.level > 0) {
            auto planes = originals(family);
            codec.encode(family, parent_of(family), planes, result.bytes);
            drop_if_empty(result.bytes);
            return result;
        }
        const Box with_faces = box_of(tree_, family), box = own_box(tree_, family);
        Buffer exact = voxels_of(with_faces);
        auto planes = integers_of(family, exact);
        codec.encode(family, parent_of(family), planes, result.bytes);
        FamilyCodec::crop(planes, with_faces, box);
        if (box != with_faces) exact = part_of(exact, with_faces, box);
        const std::size_t count = box.voxels(), values = count * planes.size();
        Buffer near(count * volume.voxel_bytes(), "voxels decoded");
        codec.to_voxels(planes, count, near.data());
        finish_exactly(exact, near, values, result);
        drop_if_empty(result.bytes);
        measure(family, box, exact, near, result);
        return result;
    }

    // Distances and patches; `near` becomes what the decoder gives.
    void finish_exactly(const Buffer& exact, Buffer& near, std::size_t count, Encoded& result) const {
        std::vector<double> truth(count), given(count);
        to_double(type(), exact.data(), count, truth.data());
        to_double(type(), near.data(), count, given.data());
        const double bound = options_.target == Target::max_error ? options_.amount : std::numeric_limits<double>::infinity();
        std::vector<std::uint8_t> patched(count);
        for (std::size_t i = 0; i < count; ++i) {
            patched[i] = !std::isfinite(truth[i]) || std::abs(truth[i] - given[i]) > bound;
            result.patches += patched[i];
        }
        const std::size_t each = bytes_of(type());
        ByteWriter writer(result.bytes);
        Bytes part;
        if (tree_.distances) {
            Buffer wanted(exact.size(), "voxels to encode");
            for (std::size_t i = 0; i < count; ++i)
                std::copy_n((patched[i] ? near : exact).data() + i * each, each, wanted.data() + i * each);
            encode_distances(type(), wanted.data(), near.data(), count, part);
            std::copy_n(wanted.data(), wanted.size(), near.data());
        }
        writer.block(part);
        part.clear();
        encode_patches(type(), exact.data(), patched, part);
        writer.bytes(part);
        for (std::size_t i = 0; i < count; ++i)
            if (patched[i]) std::copy_n(exact.data() + i * each, each, near.data() + i * each);
    }

    // Lengths of empty streams say nothing that the absence of all bytes does not.
    static void drop_if_empty(Bytes& bytes) {
        if (std::all_of(bytes.begin(), bytes.end(), [](std::byte b) { return b == std::byte(0); }) && bytes.size() <= 5) bytes.clear();
    }

    void measure(FamilyId family, const Box& box, const Buffer& exact, const Buffer& near, Encoded& result) const {
        const BricksDesc& desc = tree_.bricks;
        const auto components = std::size_t(desc.volume.components);
        std::vector<BrickId> bricks = tree_.top() > 0 ? desc.finer({1, family.index}) : std::vector<BrickId>{{0, glm::ivec3(0)}};
        for (const BrickId& id : bricks) {
            const Box part = desc.box_of(id);
            const Buffer truth_voxels = part_of(exact, box, part), given_voxels = part_of(near, box, part);
            const std::size_t count = part.voxels() * components;
            std::vector<double> truth(count), given(count);
            to_double(type(), truth_voxels.data(), count, truth.data());
            to_double(type(), given_voxels.data(), count, given.data());
            BrickInfo info;
            info.exact_error = true;
            double squares = 0;
            for (std::size_t i = 0; i < count; ++i) {
                if (!std::isfinite(truth[i])) continue;
                const double e = std::abs(truth[i] - given[i]);
                squares += e * e;
                info.max_error = std::max(info.max_error, e);
                ++result.finite;
            }
            info.l2 = info.octant_l2[0] = std::sqrt(squares);
            result.squares += squares;
            result.largest = std::max(result.largest, info.max_error);
            const glm::i64vec3 n(desc.levels[0].bricks), at(id.index);
            result.bricks.emplace_back(std::size_t((at.z * n.y + at.y) * n.x + at.x), info);
            result.parts.push_back(parts_of(part, given_voxels.data(), part, type(), int(components)));
        }
    }

    // Encodes families first, first + step, ... of a level, handing each over in this order.
    template <class Take>
    void encode_level(const FamilyCodec& codec, int level, std::int64_t first, std::int64_t step, const Take& take) const {
        const std::int64_t count = family_count(tree_, level);
        std::vector<Encoded> batch(std::size_t{kBatch});
        for (std::int64_t at = first; at < count; at += kBatch * step) {
            const std::int64_t here = std::min(kBatch, (count - at + step - 1) / step);
            parallel_for(0, here, 1, [&](std::int64_t lo, std::int64_t hi) {
                for (std::int64_t i = lo; i < hi; ++i) {
                    check_stop(stop_);
                    batch[std::size_t(i)] = encode_family(codec, family_at(tree_, level, at + i * step));
                }
            }, stop_);
            for (std::int64_t i = 0; i < here; ++i) take(at + i * step, batch[std::size_t(i)]);
        }
    }

    std::shared_ptr<const WaveletBricks> emit(EncodeReport& report) {
        if (!tree_.empty()) restore_levels();
        TreeIndex index;
        index.coder = tree_.empty() ? make_coder(options_.coder) : trained();
        const FamilyCodec codec(tree_, *index.coder);
        const auto levels = std::size_t(tree_.top()) + 1;
        index.families.resize(levels);
        index.infos.resize(levels);
        auto payload = std::make_shared<Bytes>();
        double squares = 0;
        std::uint64_t finite = 0;
        const int rounds = report.rounds;
        report = {};
        report.rounds = rounds;
        if (!tree_.empty()) {
            std::vector<BrickParts> parts;
            for (int l = tree_.top(); l >= 0; --l) {
                const glm::i64vec3 grid(tree_.bricks.levels[std::size_t(l)].bricks);
                auto& infos = index.infos[std::size_t(l)];
                infos.resize(std::size_t(grid.x * grid.y * grid.z));
                if (l == 0) parts.resize(infos.size());
                encode_level(codec, l, 0, 1, [&](std::int64_t, Encoded& family) {
                    index.families[std::size_t(l)].push_back({payload->size(), family.bytes.size(), check_of(family.bytes)});
                    payload->insert(payload->end(), family.bytes.begin(), family.bytes.end());
                    ++report.families;
                    report.empty_families += family.bytes.empty();
                    report.patches += family.patches;
                    squares += family.squares;
                    finite += family.finite;
                    report.max_error = std::max(report.max_error, family.largest);
                    for (std::size_t b = 0; b < family.bricks.size(); ++b) {
                        infos[family.bricks[b].first] = family.bricks[b].second;
                        parts[family.bricks[b].first] = family.parts[b];
                    }
                });
                share_bytes(l, index);
            }
            fill_fine_ranges(tree_.bricks, parts, index.infos[0]);
            fill_coarse(tree_, decoded_, volume_, index.infos, stop_);
        }
        report.rmse = finite ? std::sqrt(squares / double(finite)) : 0;
        report.psnr = report.rmse > 0 ? 20 * std::log10(range().extent() / report.rmse) : std::numeric_limits<double>::infinity();
        index.tree = tree_;
        const std::uint64_t all = file_bytes(index, payload->size());
        index.tree.bricks.compressed_bytes = all;
        if (!tree_.empty()) report.bits_per_voxel = 8.0 * double(all) / double(tree_.bricks.volume.voxels());
        const std::uint64_t resident = payload->size() + index_memory(index);
        const std::span<const std::byte> bytes(*payload);
        return std::make_shared<WaveletBricks>(std::move(index), bytes, std::move(payload), resident);
    }

    // A family's bytes count for its bricks in equal parts.
    void share_bytes(int level, TreeIndex& index) const {
        const BricksDesc& desc = tree_.bricks;
        for (std::int64_t i = 0; i < family_count(tree_, level); ++i) {
            const FamilyId family = family_at(tree_, level, i);
            const auto bricks = level == tree_.top() ? std::vector<BrickId>{{level, glm::ivec3(0)}}
                                                     : desc.finer({level + 1, family.index});
            const std::uint64_t bytes = index.families[std::size_t(level)][std::size_t(i)].size;
            const glm::i64vec3 n(desc.levels[std::size_t(level)].bricks);
            for (std::size_t b = 0; b < bricks.size(); ++b) {
                const glm::i64vec3 at(bricks[b].index);
                index.infos[std::size_t(level)][std::size_t((at.z * n.y + at.y) * n.x + at.x)].compressed_bytes =
                    bytes / bricks.size() + (b < bytes % bricks.size());
            }
        }
    }

    // --- rate control ---

    void set_step(double step) {
        tree_.quantiser.step = step;
        tree_.quantiser.centre_one = kCentreOne;
        tree_.quantiser.centre_more = kCentreMore;
    }

    // Mean squared error and bytes, from some families of level 0 and all of the coarser ones.
    struct Estimate {
        double mse = 0, bytes = 0;
    };
    Estimate estimate(double step, bool with_bytes) {
        set_step(step);
        restore_levels();
        const std::unique_ptr<Coder> coder = with_bytes ? trained() : nullptr;
        const Untrained none;
        const FamilyCodec codec(tree_, coder ? *coder : static_cast<const Coder&>(none));
        Estimate sum;
        double squares = 0;
        std::uint64_t finite = 0;
        const std::int64_t count = family_count(tree_, 0), each = (count + kSearchFamilies - 1) / kSearchFamilies;
        std::int64_t seen = 0;
        double fine = 0;
        encode_level(codec, 0, each / 2, each, [&](std::int64_t, const Encoded& family) {
            squares += family.squares;
            finite += family.finite;
            fine += double(family.bytes.size());
            ++seen;
        });
        sum.mse = finite ? squares / double(finite) : 0;
        if (with_bytes) {
            sum.bytes = fine * double(count) / double(std::max<std::int64_t>(seen, 1)) + double(coder->tables().size());
            for (int l = 1; l <= tree_.top(); ++l)
                encode_level(codec, l, 0, 1, [&](std::int64_t, const Encoded& family) { sum.bytes += double(family.bytes.size()); });
        }
        return sum;
    }

    std::shared_ptr<const WaveletBricks> search(EncodeReport& report) {
        const double extent = range().extent();
        switch (options_.target) {
            case Target::lossless: break;
            case Target::threshold: tree_.quantiser.threshold = options_.amount / tree_.map.step; break;
            case Target::max_error: return search_bound(report);
            case Target::psnr:
                if (extent > 0) return search_psnr(report);
                break;
            case Target::bpv:
            case Target::ratio: return search_rate(report);
        }
        return emit(report);
    }

    // Falls back to the exact tree where that is no larger than what was found (fine steps).
    std::shared_ptr<const WaveletBricks> or_lossless(std::shared_ptr<const WaveletBricks> found, EncodeReport& report) {
        if (!is_exact(type(), range()) || tree_.quantiser.step * tree_.map.step > 2) return found;
        const Quantiser quantiser = std::exchange(tree_.quantiser, {});
        const ValueMap map = std::exchange(tree_.map, map_of(type(), range(), 0));
        analyse();
        EncodeReport exact_report = report;
        auto exact = emit(exact_report);
        tree_.quantiser = quantiser;
        if (exact->desc().compressed_bytes > found->desc().compressed_bytes) {
            tree_.map = map;
            return found;
        }
        report = exact_report;
        return exact;
    }

    // log(mse) is nearly linear in log(step): false position on that, until the measured value of all
    // families is within 0.05 dB above what was asked for.
    std::shared_ptr<const WaveletBricks> search_psnr(EncodeReport& report) {
        constexpr double close = 0.05;
        const double extent = range().extent();
        auto psnr_of = [&](double mse) { return mse > 0 ? 10 * std::log10(extent * extent / mse) : 400.0; };
        double aim = options_.amount + close / 2;
        double step = std::max(1.0, std::sqrt(12.0) * extent * std::pow(10, -aim / 20) / tree_.map.step);
        std::shared_ptr<const WaveletBricks> result;
        for (int attempt = 0; attempt < 3; ++attempt) {
            double finer = 0, finer_psnr = 0, coarser = 0, coarser_psnr = 0;
            for (int round = 0; round < 16; ++round) {
                ++report.rounds;
                const double psnr = psnr_of(estimate(step, false).mse);
                if (std::abs(psnr - aim) < close / 4 || (psnr < aim && step <= 1)) break;
                (psnr > aim ? finer : coarser) = step;
                (psnr > aim ? finer_psnr : coarser_psnr) = psnr;
                if (finer > 0 && coarser > 0) {
                    const double t = std::clamp((finer_psnr - aim) / (finer_psnr - coarser_psnr), 0.05, 0.95);
                    step = finer * std::pow(coarser / finer, t);
                } else {
                    step = std::max(1.0, step * std::pow(10, std::clamp((psnr - aim) / 12, -2.0, 2.0)));
                }
                tell(0.1 + 0.3 * (1 - std::exp(-round / 6.0)));
            }
            set_step(step);
            result = emit(report);
            tell(0.5 + 0.1 * attempt);
            if (report.psnr >= options_.amount && report.psnr < options_.amount + 2 * close) break;
            if (report.psnr > options_.amount && step > 1e6) break;
            aim += options_.amount + close / 2 - std::min(report.psnr, 400.0);
        }
        return or_lossless(result, report);
    }

    std::shared_ptr<const WaveletBricks> search_bound(EncodeReport& report) {
        if (options_.amount <= 0) fail("a largest error of 0 is lossless; choose that target");
        double best = 0, best_bytes = 0;
        for (const double factor : {1.0, 1.6, 2.5, 4.0}) {
            const double step = std::max(1.0, factor * options_.amount / tree_.map.step);
            ++report.rounds;
            const double bytes = estimate(step, true).bytes;
            if (best == 0 || bytes < best_bytes) {
                best = step;
                best_bytes = bytes;
            }
            tell(0.1 + 0.1 * factor);
        }
        set_step(best);
        auto result = emit(report);
        return or_lossless(result, report);
    }

    // The smallest step whose bytes are within the budget, to one per cent.
    std::shared_ptr<const WaveletBricks> search_rate(EncodeReport& report) {
        const VolumeDesc& volume = tree_.bricks.volume;
        const double budget = options_.target == Target::bpv ? options_.amount * double(volume.voxels()) / 8
                                                             : double(volume.dense_bytes()) / options_.amount;
        double step = std::max(1.0, range().extent() / tree_.map.step / 64), overhead = 0, aim = budget;
        std::shared_ptr<const WaveletBricks> best;
        EncodeReport best_report;
        bool best_fits = false;
        for (int attempt = 0; attempt < 4; ++attempt) {
            double finer = 0, finer_bytes = 0, coarser = 0, coarser_bytes = 0, bytes = 0;
            for (int round = 0; round < 16; ++round) {
                ++report.rounds;
                bytes = estimate(step, true).bytes + overhead;
                if (std::abs(bytes / aim - 1) < 0.003 || (bytes < aim && step <= 1) || step > 1e12) break;
                (bytes > aim ? finer : coarser) = step;
                (bytes > aim ? finer_bytes : coarser_bytes) = bytes;
                if (finer > 0 && coarser > 0) {
                    if (coarser / finer < 1.0005) break;
                    const double t = std::clamp(std::log(finer_bytes / aim) / std::log(finer_bytes / coarser_bytes), 0.05, 0.95);
                    step = finer * std::pow(coarser / finer, t);
                } else {
                    step = std::max(1.0, step * std::pow(std::clamp(bytes / aim, 0.02, 50.0), 0.9));
                }
                tell(0.1 + 0.3 * (1 - std::exp(-round / 6.0)));
            }
            set_step(step);
            const int rounds = report.rounds;
            auto result = emit(report);
            report.rounds = rounds;
            const double actual = double(result->desc().compressed_bytes);
            const bool fits = actual <= budget * 1.0001;
            const double before = best ? double(best->desc().compressed_bytes) : 0;
            if (!best || (fits != best_fits ? fits : fits ? actual > before : actual < before)) {
                best = result;
                best_fits = fits;
                best_report = report;
            }
            tell(0.5 + 0.1 * attempt);
            if ((fits && actual > 0.99 * budget) || (fits && step <= 1)) break;
            overhead += actual - bytes;
            aim = budget * 0.996;
        }
        report = best_report;
        return or_lossless_within(best, budget, report);
    }

    // Where the budget pays for everything, nothing need be lost.
    std::shared_ptr<const WaveletBricks> or_lossless_within(std::shared_ptr<const WaveletBricks> found, double budget,
                                                            EncodeReport& report) {
        if (report.max_error == 0) return found;
        EncodeReport exact_report = report;
        auto exact = or_lossless(found, exact_report);
        if (double(exact->desc().compressed_bytes) > budget) return found;
        report = exact_report;
        return exact;
    }

    // Stands in where no bytes are wanted.
    class Untrained final : public Coder {
      public:
        CoderKind kind() const override { return CoderKind::dense; }
        void encode(const Details&, Bytes&) const override {}
        void decode(std::span<const std::byte>, Details&) const override {}
    };

    const Volume& volume_;
    const EncodeOptions& options_;
    std::stop_token stop_;
    const std::function<void(double)>& progress_;
    TreeDesc tree_;
    std::vector<LevelStore> original_, decoded_;
};

std::string provenance_of(const EncodeOptions& options) {
    constexpr std::string_view kTargets[] = {"lossless", "threshold", "psnr", "max-error", "bpv", "ratio"};
    std::string text = fmt::format("voxloom wavelet.encode, target {}", kTargets[int(options.target)]);
    if (options.target != Target::lossless) text += " " + shortest(options.amount);
    text += fmt::format(", coder {}, brick {}", name_of(options.coder), options.brick);
    if (options.faces == Faces::shared) text += ", shared faces";
    if (!options.source.empty()) text += ", from " + options.source;
    return text;
}

}  // namespace

TreeDesc plan(const VolumeDesc& volume, const EncodeOptions& options) {
    if (volume.has_mask)
        fail("a volume with a validity mask cannot be encoded; write NaN into what is not valid, as floats");
    TreeDesc tree;
    tree.bricks.volume = volume;
    tree.bricks.brick = glm::ivec3(options.brick);
    tree.bricks.tree_type = tree_type_of(volume.type);
    tree.bricks.levels = pyramid_levels(volume, tree.bricks.brick);
    tree.rounding = options.rounding;
    tree.faces = options.faces;
    tree.coder = options.coder;
    tree.provenance = provenance_of(options);
    return tree;
}

std::shared_ptr<const WaveletBricks> encode(const Volume& volume, const EncodeOptions& options, EncodeReport& report,
                                            const std::stop_token& stop, const std::function<void(double)>& progress) {
    return Encoder(volume, options, stop, progress).run(report);
}

}  // namespace voxloom::wavelet
