#include "plugins/codec-baseline/encoder.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/base/meter.h"
#include "core/base/parallel.h"
#include "core/base/text.h"
#include "core/data/brick_file.h"
#include "core/data/brick_ranges.h"
#include "core/measure/volume_error.h"

namespace voxloom::baseline {

namespace {

constexpr std::int64_t kBatch = 32;         // bricks whose bytes wait to be appended in order
constexpr std::size_t kSearchBricks = 32;   // that a search looks at
constexpr int kCorrections = 6;             // passes over everything, where the few misled

class Encoder {
  public:
    Encoder(const Volume& volume, const Codec& codec, const EncodeOptions& options, const std::stop_token& stop,
            const std::function<void(double)>& progress)
        : volume_(volume), codec_(codec), options_(options), stop_(stop), progress_(progress) {
        index_.desc = plan(volume.desc(), codec, options);
        index_.desc.volume.range = value_range(volume, stop);
        index_.codec = &codec;
        if (const std::string problem = codec.problem(index_.desc.volume); !problem.empty())
            fail("{} cannot encode this volume: {}", codec.title, problem);
        index_.provenance = provenance();
        const glm::i64vec3 n(index_.desc.levels[0].bricks);
        count_ = std::size_t(n.x * n.y * n.z);
    }

    FlatBricksPtr run(EncodeReport& report) {
        const bool searched = options_.target == Target::psnr || options_.target == Target::bpv || options_.target == Target::ratio;
        if (!searched || count_ == 0) {
            const Form whole = index_.form(volume_.desc().dims);
            set(searched ? Setting{} : codec_.direct(whole, options_.target, options_.amount));
            return emit(report, 0, 1);
        }
        return options_.target == Target::psnr ? search_psnr(report) : search_rate(report);
    }

  private:
    const VolumeDesc& desc() const { return index_.desc.volume; }
    void tell(double fraction) const {
        if (progress_) progress_(fraction);
    }
    void set(Setting setting) {
        setting.options = options_.codec;
        index_.setting = setting;
    }
    std::string provenance() const {
        std::string text = fmt::format("voxloom {}.encode ({}), target {}", codec_.name, codec_.library, name_of(options_.target));
        if (options_.target != Target::lossless) text += " " + shortest(options_.amount);
        if (!desc().name.empty()) text += ", from " + desc().name;
        return text;
    }

    Buffer voxels_of(const Box& box) const {
        Buffer voxels(box.voxels() * desc().voxel_bytes(), "voxels to encode");
        volume_.read(box, voxels.bytes(), stop_);
        return voxels;
    }
    CodedBrick code(std::size_t i, BrickError& error) const {
        check_stop(stop_);
        const Box box = index_.desc.box_of(brick_at(index_.desc, i));
        const Form form = index_.form(box.dims());
        const Buffer voxels = voxels_of(box);
        const double bound = options_.target == Target::max_error ? options_.amount : std::numeric_limits<double>::infinity();
        CodedBrick brick = code_brick(codec_, form, index_.setting, bound, voxels.bytes());
        error = error_of(form, voxels.bytes(), brick.decoded.bytes());
        return brick;
    }

    // --- every brick once ---

    FlatBricksPtr emit(EncodeReport& report, double from, double to) {
        const int rounds = report.rounds;
        report = {};
        report.rounds = rounds;
        index_.bricks.places.assign(count_, {});
        index_.bricks.infos.assign(count_, {});
        std::vector<BrickParts> parts(count_);
        auto payload = std::make_shared<Bytes>();
        std::vector<CodedBrick> batch(std::size_t{kBatch});
        std::vector<BrickError> errors(std::size_t{kBatch});
        BrickError sum;
        std::int64_t codec_ns = 0;
        for (std::size_t first = 0; first < count_; first += kBatch) {
            const std::size_t here = std::min<std::size_t>(kBatch, count_ - first);
            parallel_for(0, std::int64_t(here), 1, [&](std::int64_t lo, std::int64_t hi) {
                for (std::int64_t k = lo; k < hi; ++k) {
                    const auto i = std::size_t(k);
                    batch[i] = code(first + i, errors[i]);
                    const Box box = index_.desc.box_of(brick_at(index_.desc, first + i));
                    parts[first + i] = parts_of(box, batch[i].decoded.data(), box, desc().type, desc().components);
                    batch[i].decoded = {};
                }
            }, stop_);
            for (std::size_t i = 0; i < here; ++i) {  // in order, whatever the threads did
                append(first + i, batch[i], errors[i], *payload);
                codec_ns += batch[i].codec_ns;
                report.lossless_bricks += batch[i].kept == Kept::lossless;
                report.raw_bricks += batch[i].kept == Kept::raw;
                sum.squares += errors[i].squares;
                sum.largest = std::max(sum.largest, errors[i].largest);
                sum.finite += errors[i].finite;
            }
            tell(from + (to - from) * double(first + here) / double(count_));
        }
        if (count_ > 0) fill_fine_ranges(index_.desc, parts, index_.bricks.infos);
        report.codec_seconds = double(codec_ns) * 1e-9;
        return finish(report, sum, std::move(payload));
    }

    void append(std::size_t i, const CodedBrick& brick, const BrickError& error, Bytes& payload) {
        index_.bricks.places[i] = {payload.size(), brick.bytes.size(), check_of(brick.bytes)};
        payload.insert(payload.end(), brick.bytes.begin(), brick.bytes.end());
        BrickInfo& info = index_.bricks.infos[i];
        info.l2 = info.octant_l2[0] = std::sqrt(error.squares);
        info.max_error = error.largest;
        info.compressed_bytes = brick.bytes.size();
        info.exact_error = true;
    }

    FlatBricksPtr finish(EncodeReport& report, const BrickError& sum, std::shared_ptr<Bytes> payload) {
        report.rmse = sum.finite ? std::sqrt(sum.squares / double(sum.finite)) : 0;
        report.max_error = sum.largest;
        report.psnr = psnr(desc().range->extent(), report.rmse);
        FlatIndex index = index_;
        index.desc.compressed_bytes = front_of(index, payload->size()).size() + payload->size();
        report.bits_per_voxel = desc().voxels() ? 8 * double(index.desc.compressed_bytes) / double(desc().voxels()) : 0;
        const std::span<const std::byte> bytes = *payload;
        return std::make_shared<FlatBricks>(std::move(index), bytes, payload, payload->size());
    }

    // --- the search for a setting ---

    struct Estimate {
        double psnr = 0, bytes = 0;
    };
    // Of everything, from some of the bricks.
    Estimate estimate(const Scale& scale, int i, EncodeReport& report) {
        if (const auto it = known_.find(i); it != known_.end()) return it->second;
        ++report.rounds;
        set(scale.at(i));
        const std::size_t some = std::min(count_, kSearchBricks);
        std::vector<BrickError> errors(some);
        std::vector<std::uint64_t> sizes(some), values(some);
        parallel_for(0, std::int64_t(some), 1, [&](std::int64_t lo, std::int64_t hi) {
            for (std::int64_t k = lo; k < hi; ++k) {
                const std::size_t at = (std::size_t(k) * count_ + count_ / 2) / some;  // evenly spread
                sizes[std::size_t(k)] = code(at, errors[std::size_t(k)]).bytes.size();
                values[std::size_t(k)] = index_.desc.box_of(brick_at(index_.desc, at)).voxels();
            }
        }, stop_);
        double squares = 0, finite = 0, bytes = 0, voxels = 0;
        for (std::size_t k = 0; k < some; ++k) {
            squares += errors[k].squares;
            finite += double(errors[k].finite);
            bytes += double(sizes[k]);
            voxels += double(values[k]);
        }
        Estimate result;
        result.psnr = psnr(desc().range->extent(), finite > 0 ? std::sqrt(squares / finite) : 0);
        const double entry = 3 + 4 + 2 * double(bytes_of(desc().type)) + 16;
        result.bytes = bytes / voxels * double(desc().voxels()) + double(count_) * entry + 250;
        tell(0.5 * (1 - std::exp(-report.rounds / 6.0)));
        return known_[i] = result;
    }

    // The coarsest setting that `good` holds for, if it holds for all finer ones; scale.count where there is none.
    template <class Good>
    static int coarsest(const Scale& scale, const Good& good) {
        int lo = 0, hi = scale.count;
        while (lo < hi) {
            const int middle = lo + (hi - lo) / 2;
            if (good(middle))
                hi = middle;
            else
                lo = middle + 1;
        }
        return lo;
    }

    FlatBricksPtr search_psnr(EncodeReport& report) {
        const Scale scale = codec_.scale(index_.form(volume_.desc().dims), options_.target);
        if (desc().range->extent() > 0) {
            int i = coarsest(scale, [&](int at) { return estimate(scale, at, report).psnr >= options_.amount; });
            for (int attempt = 0; attempt < kCorrections && i < scale.count; ++attempt) {
                set(scale.at(i));
                auto bricks = emit(report, 0.5, 1);
                if (report.psnr >= options_.amount) return bricks;
                i += 1 << attempt;
            }
        }
        set({});  // the codec has nothing finer
        return emit(report, 0.5, 1);
    }

    FlatBricksPtr search_rate(EncodeReport& report) {
        const Scale scale = codec_.scale(index_.form(volume_.desc().dims), options_.target);
        const double budget = options_.target == Target::bpv ? options_.amount * double(desc().voxels()) / 8
                                                             : double(desc().dense_bytes()) / options_.amount;
        int i = coarsest(scale, [&](int at) { return estimate(scale, at, report).bytes > budget; }) - 1;
        if (i == scale.count - 1) {  // even the finest fits; so might all of it
            set({});
            auto bricks = emit(report, 0.5, 1);
            if (double(bricks->desc().compressed_bytes) <= budget) return bricks;
        }
        i = std::max(i, 0);
        for (int attempt = 0; attempt < kCorrections && i >= 0; ++attempt) {
            set(scale.at(i));
            auto bricks = emit(report, 0.5, 1);
            if (double(bricks->desc().compressed_bytes) <= budget) return bricks;
            i = i > 0 ? std::max(0, i - (1 << attempt)) : -1;
        }
        fail("{} needs {:.4g} bits a voxel at the least here, and {:.4g} are allowed; allow more, or take larger bricks",
             codec_.title, report.bits_per_voxel, 8 * budget / double(desc().voxels()));
    }

    const Volume& volume_;
    const Codec& codec_;
    const EncodeOptions& options_;
    std::stop_token stop_;
    const std::function<void(double)>& progress_;
    FlatIndex index_;
    std::size_t count_ = 0;
    std::map<int, Estimate> known_;
};

}  // namespace

BricksDesc plan(const VolumeDesc& volume, const Codec& codec, const EncodeOptions& options) {
    if (volume.has_mask)
        fail("a volume with a validity mask cannot be encoded; write NaN into what is not valid, as floats");
    if (const std::string problem = codec.problem(volume); !problem.empty())
        fail("{} cannot encode this volume: {}", codec.title, problem);
    if (options.target == Target::max_error && !(options.amount > 0)) fail("a largest error of 0 is lossless; choose that target");
    return flat_desc(volume, options.brick);
}

FlatBricksPtr encode(const Volume& volume, const Codec& codec, const EncodeOptions& options, EncodeReport& report,
                     const std::stop_token& stop, const std::function<void(double)>& progress) {
    return Encoder(volume, codec, options, stop, progress).run(report);
}

}  // namespace voxloom::baseline
