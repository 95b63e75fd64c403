#include "plugins/codec-vq/encoder.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/base/meter.h"
#include "core/base/parallel.h"
#include "core/base/text.h"
#include "core/data/brick_file.h"
#include "core/data/brick_ranges.h"
#include "core/measure/sum.h"
#include "core/measure/volume_error.h"
#include "plugins/codec-vq/block.h"
#include "plugins/codec-vq/survey.h"

namespace voxloom::vq {

namespace {

constexpr std::int64_t kBatch = 32;  // bricks whose bytes wait to be appended in order
constexpr double kSurveyed = 0.05, kTrained = 0.6;  // fractions of progress

struct BrickError {
    double squares = 0, largest = 0;
    std::uint64_t finite = 0;
};

template <class T>
BrickError error_of(std::span<const T> truth, std::span<const T> given) {
    BrickError error;
    for (std::size_t i = 0; i < truth.size(); ++i) {
        if constexpr (std::is_floating_point_v<T>)
            if (!std::isfinite(truth[i])) continue;
        const double e = std::abs(double(truth[i]) - double(given[i]));
        error.squares += e * e;
        error.largest = std::max(error.largest, e);
        ++error.finite;
    }
    return error;
}

// Of all codebooks' samples together.
struct Distortion {
    double sum = 0, vectors = 0;
};

class Encoder {
  public:
    Encoder(const Volume& volume, const EncodeOptions& options, EncodeReport& report, const std::stop_token& stop,
            const std::function<void(double)>& progress)
        : volume_(volume), options_(options), report_(report), stop_(stop), progress_(progress) {
        index_.desc = plan(volume.desc(), options);
        index_.loop = options.loop;
        index_.macroblocks = macroblocks_for(index_.desc, options.macroblocks);
        index_.provenance = provenance();
        count_ = Box::of(Index3(index_.desc.levels[0].bricks)).voxels();
    }

    VqBricksPtr run() {
        report_ = {};
        const Survey seen = survey(volume_, index_, stop_, [&](double f) { tell(kSurveyed * f); });
        index_.desc.volume.range = seen.range;
        index_.unit = unit_for(desc().type, seen.range, seen.middle);
        train_all(seen);
        return emit();
    }

  private:
    const VolumeDesc& desc() const { return index_.desc.volume; }
    void tell(double fraction) const {
        if (progress_) progress_(fraction);
    }
    std::string provenance() const {
        const glm::ivec3 m = index_.macroblocks;
        std::string text = fmt::format("voxloom vq.encode, {} codewords, {} loop, {} x {} x {} macroblocks", options_.codewords,
                                       options_.loop == Loop::closed ? "closed" : "open", m.x, m.y, m.z);
        if (!volume_.desc().name.empty()) text += ", from " + volume_.desc().name;
        return text;
    }

    // --- codebooks ---

    void train_all(const Survey& seen) {
        const std::int64_t start = wall_ns();
        const std::size_t macroblocks = Box::of(Index3(index_.macroblocks)).voxels();
        std::vector<std::vector<std::size_t>> bricks(macroblocks);
        for (std::size_t b = 0; b < count_; ++b) bricks[index_.macroblock_of(brick_at(index_.desc, b))].push_back(b);
        Distortion distortion;
        for (std::size_t m = 0; m < macroblocks; ++m)
            for (int c = 0; c < desc().components; ++c) {
                check_stop(stop_);
                index_.books.push_back(trained(sample_of(volume_, index_, seen, bricks[m], c, options_, stop_), distortion));
                const auto done = double(index_.books.size()) / double(macroblocks * std::size_t(desc().components));
                tell(kSurveyed + (kTrained - kSurveyed) * done);
            }
        if (distortion.vectors > 0)
            report_.distortion = index_.unit * std::sqrt(distortion.sum / distortion.vectors / kVoxels);
        report_.training_seconds = double(wall_ns() - start) * 1e-9;
    }

    Codebooks trained(Sample differences, Distortion& distortion) {
        const std::size_t count = differences.size();
        Sample octants{kOctants, {}, differences.weights};
        octants.numbers.reserve(count * kOctants);
        for (std::size_t i = 0; i < count; ++i)
            for (const float mean : octant_means(differences.vector(i))) octants.numbers.push_back(mean);
        Codebooks books;
        Training first = book_from(octants);
        books.octants = std::move(first.book);
        std::vector<std::uint8_t> index(count);
        std::vector<float> distance(count);
        if (options_.loop == Loop::closed)
            find_nearest(search_table(books.octants.words, kOctants), octants.numbers.data(), count, index.data(), distance.data());
        for (std::size_t i = 0; i < count; ++i) {
            const float* known = options_.loop == Loop::closed ? books.octants.word(index[i]).data() : octants.vector(i);
            take_octants_off(known, &differences.numbers[i * kVoxels]);
        }
        octants = {};
        Training voxels = book_from(std::move(differences));
        books.voxels = std::move(voxels.book);
        distortion.sum += voxels.distortion.back();
        // The second codebook did not see what the first one left, of which each octant is a mean of eight voxels.
        if (options_.loop == Loop::open) distortion.sum += (kVoxels / kOctants) * first.distortion.back();
        distortion.vectors += double(count);
        report_.sampled += count;
        return books;
    }

    Training book_from(Sample sample) {
        TrainOptions options;
        options.codewords = options_.codewords;
        options.sweeps = options_.sweeps;
        Training training = train(std::move(sample), options, stop_);
        round_words(desc().type, training.book);
        report_.sweeps = std::max(report_.sweeps, int(training.distortion.size()) - 1);
        return training;
    }

    // --- every brick once ---

    struct Outcome {
        CodedBrick brick;
        BrickError error;
        std::int64_t codec_ns = 0;
    };

    Outcome code(std::size_t b, std::span<const BrickSearch> search, BrickParts& parts) const {
        const BrickId id = brick_at(index_.desc, b);
        const Box box = index_.desc.box_of(id);
        const BrickForm form = index_.form(box.dims());
        const Buffer voxels = voxels_of_brick(volume_, box, stop_);
        const std::span<const Codebooks> books = index_.books_of(id);
        Outcome outcome;
        const std::int64_t start = thread_cpu_ns();
        outcome.brick = code_brick(form, options_.loop, books, search, voxels.bytes());
        outcome.codec_ns = thread_cpu_ns() - start;
        Buffer decoded(voxels.size(), "brick");
        decode_brick(form, books, outcome.brick.bytes, decoded.bytes());
        parts = parts_of(box, decoded.data(), box, desc().type, desc().components);
        with_type(desc().type, [&](auto t) {
            using T = decltype(t);
            outcome.error = error_of<T>(voxels.as<T>(), decoded.as<T>());
        });
        return outcome;
    }

    // Tables are larger than the codebooks: of the macroblocks of a batch alone.
    void make_search(std::size_t first, std::size_t count, std::map<std::size_t, std::vector<BrickSearch>>& search) const {
        std::set<std::size_t> met;
        for (std::size_t b = first; b < first + count; ++b) met.insert(index_.macroblock_of(brick_at(index_.desc, b)));
        std::erase_if(search, [&](const auto& one) { return !met.contains(one.first); });
        const auto components = std::size_t(desc().components);
        for (const std::size_t m : met) {
            std::vector<BrickSearch>& tables = search[m];
            for (std::size_t c = tables.size(); c < components; ++c) {
                const Codebooks& books = index_.books[m * components + c];
                tables.push_back({search_table(books.octants.words, kOctants), search_table(books.voxels.words, kVoxels)});
            }
        }
    }

    VqBricksPtr emit() {
        std::map<std::size_t, std::vector<BrickSearch>> search;  // of the macroblocks that are met, of each component
        index_.bricks.places.resize(count_);
        index_.bricks.infos.resize(count_);
        std::vector<BrickParts> parts(count_);
        std::vector<Outcome> batch(std::size_t{kBatch});
        auto payload = std::make_shared<Bytes>();
        Sum squares;
        std::uint64_t finite = 0;
        for (std::size_t first = 0; first < count_; first += kBatch) {
            const std::size_t here = std::min<std::size_t>(kBatch, count_ - first);
            make_search(first, here, search);
            parallel_for(0, std::int64_t(here), 1, [&](std::int64_t lo, std::int64_t hi) {
                for (auto i = std::size_t(lo); i < std::size_t(hi); ++i) batch[i] = code(first + i, search.at(index_.macroblock_of(brick_at(index_.desc, first + i))), parts[first + i]);
            }, stop_);
            for (std::size_t i = 0; i < here; ++i) {  // in order, whatever the threads did
                append(first + i, batch[i], *payload);
                squares.add(batch[i].error.squares);
                finite += batch[i].error.finite;
            }
            tell(kTrained + (1 - kTrained) * double(first + here) / double(count_));
        }
        if (count_ > 0) fill_fine_ranges(index_.desc, parts, index_.bricks.infos);
        report_.rmse = finite ? std::sqrt(squares.value() / double(finite)) : 0;
        report_.psnr = psnr(desc().range->extent(), report_.rmse);
        index_.desc.compressed_bytes = front_of(index_, payload->size()).size() + payload->size();
        report_.bits_per_voxel = desc().voxels() ? 8 * double(index_.desc.compressed_bytes) / double(desc().voxels()) : 0;
        const std::span<const std::byte> bytes = *payload;
        return std::make_shared<VqBricks>(std::move(index_), bytes, payload, payload->size());
    }

    void append(std::size_t b, const Outcome& outcome, Bytes& payload) {
        const Bytes& bytes = outcome.brick.bytes;
        index_.bricks.places[b] = {payload.size(), bytes.size(), check_of(bytes)};
        payload.insert(payload.end(), bytes.begin(), bytes.end());
        BrickInfo& info = index_.bricks.infos[b];
        info.l2 = info.octant_l2[0] = std::sqrt(outcome.error.squares);
        info.max_error = outcome.error.largest;
        info.compressed_bytes = bytes.size();
        info.exact_error = true;
        report_.max_error = std::max(report_.max_error, outcome.error.largest);
        report_.constant_blocks += outcome.brick.constant_blocks;
        report_.raw_blocks += outcome.brick.raw_blocks;
        report_.codec_seconds += double(outcome.codec_ns) * 1e-9;
    }

    const Volume& volume_;
    const EncodeOptions& options_;
    EncodeReport& report_;
    std::stop_token stop_;
    const std::function<void(double)>& progress_;
    VqIndex index_;
    std::size_t count_ = 0;
};

}  // namespace

BricksDesc plan(const VolumeDesc& volume, const EncodeOptions& options) {
    if (volume.has_mask)
        fail("a volume with a validity mask cannot be encoded; write NaN into what is not valid, as floats");
    return vq_desc(volume, glm::ivec3(options.brick));
}

VqBricksPtr encode(const Volume& volume, const EncodeOptions& options, EncodeReport& report, const std::stop_token& stop,
                   const std::function<void(double)>& progress) {
    return Encoder(volume, options, report, stop, progress).run();
}

}  // namespace voxloom::vq
