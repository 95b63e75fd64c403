#include "plugins/codec-wavelet/emission.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/meter.h"
#include "core/data/brick_file.h"
#include "plugins/codec-wavelet/file_format.h"
#include "plugins/codec-wavelet/payload.h"

namespace voxloom::wavelet {

double error_bound(const EncodeOptions& options, const TreeDesc& tree) {
    if (options.target == Target::max_error) return options.amount;
    return options.target == Target::lossless && !tree.distances ? 0 : std::numeric_limits<double>::infinity();
}

std::int64_t families_to_learn_from(CoderKind kind) {
    switch (kind) {
        case CoderKind::paper: return 0;   // its code is fixed
        case CoderKind::blocks: return 0;  // only read
        case CoderKind::fast: return 96;   // frequencies settle soon
        case CoderKind::dense: break;
    }
    return 384;
}

namespace {

class Emission {
  public:
    Emission(const Encoding& e, const Progress& progress)
        : e_(e), tree_(e.tree), progress_(progress), payload_(e.memory.payload) {}

    std::shared_ptr<const WaveletBricks> run(EncodeReport& report) {
        const auto levels = std::size_t(tree_.top()) + 1;
        index_.families.resize(levels);
        index_.infos.resize(levels);
        if (tree_.empty()) {
            index_.coder = make_coder(e_.options.coder);
        } else {
            restore_levels();
            train();
            for (int l = tree_.top(); l >= 0; --l) encode_level(l);
            finish_infos();
        }
        return finish(report);
    }

  private:
    // Where nothing is quantised the levels come back as they are.
    const LevelStore& decoded(int level) const { return keeps_integers(tree_) ? e_.original[std::size_t(level)] : decoded_[std::size_t(level)]; }
    FamilyCodec::Planes parent_of(FamilyId family) const {
        if (family.level == tree_.top()) return {};
        return decoded(family.level + 1).read(parent_box(tree_, family));
    }

    void restore_levels() {
        decoded_.resize(std::size_t(tree_.top()) + 1);
        if (keeps_integers(tree_)) return;
        const NoCoder none;
        const FamilyCodec codec(tree_, none);
        for (int l = tree_.top(); l > 0; --l) {
            decoded_[std::size_t(l)] = LevelStore(tree_, l, tree_.bricks.volume.components, l >= e_.memory.first_level_in_memory);
            for (std::int64_t at = 0; at < family_count(tree_, l);) {
                const Tile tile = tile_from(tree_, l, at, e_.memory.coarse_tile_voxels);
                each_family(tree_, tile, e_.stop, progress_.part(l == 1 ? 0.01 : 0, l == 1 ? 0.04 : 0.01), [&](std::int64_t i) {
                    const FamilyId family = family_at(tree_, l, i);
                    auto planes = e_.originals(family);
                    codec.restore(family, parent_of(family), planes, [](const Details&) {});
                    decoded_[std::size_t(l)].write(own_box(tree_, family), planes, box_of(tree_, family));
                });
                at = tile.last;
            }
        }
    }

    // The coder sees some families of each level, in the order of decoding.
    void train() {
        index_.coder = make_coder(e_.options.coder);
        const FamilyCodec codec(tree_, *index_.coder);
        const std::int64_t most = std::min(families_to_learn_from(index_.coder->kind()), sample_size(tree_));
        const auto train_on = [&](FamilyId family, FamilyCodec::Planes& planes) {
            check_stop(e_.stop);
            codec.restore(family, parent_of(family), planes, [&](const Details& d) { index_.coder->train(d); }, FamilyCodec::After::spoiled);
        };
        FamilyCodec::Planes planes;
        for (int l = tree_.top() - 1; l > 0 && most > 0; --l) {
            const Selection some = select(tree_, l, most);
            for (std::int64_t i = 0; i < some.count; ++i) {
                const FamilyId family = family_at(tree_, l, some.family(i));
                planes = e_.originals(family);
                train_on(family, planes);
            }
        }
        if (tree_.top() > 0 && most > 0) {
            Buffer buffer;
            const auto some = e_.sample.families();
            const std::size_t step = std::max<std::size_t>(1, some.size() / std::size_t(most));
            for (std::size_t i = step / 2; i < some.size(); i += step) {
                const FamilyId family = family_at(tree_, 0, some[i].family);
                integers_of(tree_, e_.sample.get(tree_, some[i], buffer), family, planes);
                train_on(family, planes);
            }
        }
        index_.coder->finish_training();
        progress_(0.07);
    }

    void encode_level(int level) {
        const FamilyCodec codec(tree_, *index_.coder);
        const glm::i64vec3 grid(tree_.bricks.levels[std::size_t(level)].bricks);
        index_.infos[std::size_t(level)].resize(std::size_t(grid.x * grid.y * grid.z));
        begin_ranges(index_.infos[std::size_t(level)]);
        const Progress progress = level > 1 ? progress_.part(0.07, 0.08) : level == 1 ? progress_.part(0.08, 0.15) : progress_.part(0.15, 1);
        const std::uint64_t most = level == 0 ? e_.memory.tile_voxels : e_.memory.coarse_tile_voxels;
        std::vector<EncodedFamily> encoded;
        for (std::int64_t at = 0; at < family_count(tree_, level);) {
            const Tile tile = tile_from(tree_, level, at, most);
            encoded.clear();
            encoded.resize(std::size_t(tile.last - tile.first));
            if (level == 0) {
                const VoxelTile voxels(e_.volume, tile.box, e_.stop);
                const auto coarse = coarse_errors(tree_, keeps_integers(tree_) ? e_.original : decoded_, tile.box, e_.stop);
                each_family(tree_, tile, e_.stop, progress, [&](std::int64_t i) {
                    const FamilyId family = family_at(tree_, 0, i);
                    encoded[std::size_t(i - tile.first)] =
                        encode_fine(codec, tree_, family, voxels.view(), parent_of(family), error_bound(e_.options, tree_), coarse.get());
                });
            } else {
                each_family(tree_, tile, e_.stop, progress, [&](std::int64_t i) {
                    encoded[std::size_t(i - tile.first)] = encode_coarse(codec, family_at(tree_, level, i));
                });
            }
            for (EncodedFamily& family : encoded) {
                take(level, family);
                family = {};
            }
            at = tile.last;
        }
        end_ranges(index_.infos[std::size_t(level)]);
    }

    EncodedFamily encode_coarse(const FamilyCodec& codec, FamilyId family) const {
        const Box box = box_of(tree_, family);
        EncodedFamily result;
        auto planes = e_.originals(family);
        if (tree_.bricks.volume.has_mask) result.add_mask(e_.mask(family), box.dims());
        const std::int64_t start = thread_cpu_ns();
        codec.encode(family, parent_of(family), planes, result.bytes);
        result.codec_ns = thread_cpu_ns() - start;
        result.drop_if_empty();
        result.check = check_of(result.bytes);
        for (const BrickId& id : bricks_of(tree_, family)) {
            MeasuredBrick brick{id, no_parts()};
            for (const auto& plane : planes) add_parts(tree_, tree_.bricks.box_of(id), plane, box, brick.parts);
            result.bricks.push_back(std::move(brick));
        }
        return result;
    }

    // Families come in the order of the payload, whatever the threads did.
    void take(int level, const EncodedFamily& family) {
        auto& infos = index_.infos[std::size_t(level)];
        index_.families[std::size_t(level)].push_back({payload_.size(), family.bytes.size(), family.check});
        payload_.append(family.bytes);
        ++report_.families;
        report_.empty_families += family.bytes.empty();
        report_.patches += family.patches;
        report_.codec_seconds += double(family.codec_ns) * 1e-9;
        for (std::size_t b = 0; b < family.bricks.size(); ++b) {
            const MeasuredBrick& brick = family.bricks[b];
            BrickInfo& info = infos[place_of(tree_.bricks, brick.id)];
            // A family's bytes count for its bricks in equal parts.
            info.compressed_bytes = share_of(family.bytes.size(), b, family.bricks.size());
            widen_ranges(tree_.bricks, brick.id, brick.parts, infos);
            if (level > 0) continue;
            info.l2 = info.octant_l2[0] = std::sqrt(brick.squares);
            info.max_error = brick.largest;
            info.exact_error = true;
            squares_ += brick.squares;
            finite_ += brick.finite;
            report_.max_error = std::max(report_.max_error, brick.largest);
            add_coarse(brick.id, std::span(family.coarse).subspan(b * std::size_t(tree_.top()), std::size_t(tree_.top())));
        }
    }

    // Sums of squares, until finish_infos().
    void add_coarse(BrickId id, std::span<const ErrorSum> errors) {
        for (std::size_t l = 1; l <= errors.size(); ++l) {
            const auto octant = std::size_t(tree_.bricks.octant_of(id));
            id = *tree_.bricks.coarser(id);
            BrickInfo& info = index_.infos[l][place_of(tree_.bricks, id)];
            info.l2 += errors[l - 1].squares;
            info.octant_l2[octant] += errors[l - 1].squares;
            info.max_error = std::max(info.max_error, errors[l - 1].largest);
        }
    }
    void finish_infos() {
        for (std::size_t l = 1; l < index_.infos.size(); ++l)
            for (BrickInfo& info : index_.infos[l]) {
                info.l2 = std::sqrt(info.l2);
                for (double& octant : info.octant_l2) octant = std::sqrt(octant);
                info.exact_error = true;
            }
    }

    std::shared_ptr<const WaveletBricks> finish(EncodeReport& report) {
        report_.rounds = report.rounds;
        report_.codec_seconds += e_.transform_seconds;
        report_.rmse = finite_ ? std::sqrt(squares_ / double(finite_)) : 0;
        report_.psnr = report_.rmse > 0 ? 20 * std::log10(e_.range().extent() / report_.rmse) : std::numeric_limits<double>::infinity();
        index_.tree = tree_;
        const std::uint64_t all = file_bytes(index_, payload_.size());
        index_.tree.bricks.compressed_bytes = all;
        if (!tree_.empty()) report_.bits_per_voxel = 8.0 * double(all) / double(tree_.bricks.volume.voxels());
        report = report_;
        return std::make_shared<WaveletBricks>(std::move(index_), payload_.finish());
    }

    const Encoding& e_;
    const TreeDesc& tree_;
    const Progress& progress_;
    std::vector<LevelStore> decoded_;  // [0] is not used
    TreeIndex index_;
    PayloadWriter payload_;
    EncodeReport report_;
    double squares_ = 0;
    std::uint64_t finite_ = 0;
};

}  // namespace

std::shared_ptr<const WaveletBricks> emit(const Encoding& e, EncodeReport& report, const Progress& progress) {
    return Emission(e, progress).run(report);
}

}  // namespace voxloom::wavelet
