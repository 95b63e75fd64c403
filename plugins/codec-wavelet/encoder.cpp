// The passes in their order: analysis (bottom up), search for a step where one is asked for, emission (top down).
#include "plugins/codec-wavelet/encoder.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/error.h"
#include "core/base/text.h"
#include "plugins/codec-wavelet/emission.h"
#include "plugins/codec-wavelet/step_search.h"
#include "plugins/codec-wavelet/value_survey.h"

namespace voxloom::wavelet {

namespace {

constexpr double kPsnrSlack = 0.1;  // dB above what was asked for

class Encoder {
  public:
    Encoder(const Volume& volume, const EncodeOptions& options, const std::stop_token& stop, const Progress& progress)
        : e_{volume, options, stop, {}, plan(volume.desc(), options), {}, {}, {}, 0}, options_(options), progress_(progress) {}

    std::shared_ptr<const WaveletBricks> run(EncodeReport& report) {
        report = {};
        TreeDesc& tree = e_.tree;
        if (tree.empty()) {
            tree.bricks.volume.range = ValueRange{};
            return emit(e_, report, progress_);
        }
        e_.memory = plan_memory(e_.volume, tree, options_.memory);
        choose_map();
        analyse(e_, lossy(), progress_.part(0.1, 0.25));
        switch (options_.target) {
            case Target::lossless: break;
            case Target::threshold: tree.quantiser.threshold = options_.amount / tree.map.step; break;
            case Target::max_error: return for_bound(report);
            case Target::psnr: return for_psnr(report);
            case Target::bpv:
            case Target::ratio: return for_budget(report);
        }
        return emit(e_, report, progress_.part(0.25, 1));
    }

  private:
    bool lossy() const { return options_.target != Target::lossless && options_.target != Target::threshold; }
    int fraction_bits() const { return bytes_of(e_.type()) == 1 ? 4 : 3; }  // keep lifting's rounding out of the result

    void choose_map() {
        TreeDesc& tree = e_.tree;
        auto& range = tree.bricks.volume.range;
        const bool small = !is_float(e_.type()) && bytes_of(e_.type()) <= 2, lossless = options_.target == Target::lossless;
        // Small integers need no range to be mapped, and theirs is found on the way.
        const bool look = !range && (!small || tree.bricks.volume.has_mask);
        ValueSurvey values;
        if (look || (is_float(e_.type()) && lossless)) {
            values = survey(e_.volume, tree, e_.memory.tile_voxels, e_.stop, progress_.part(0, 0.1));
            range = values.range;
        }
        tree.map = map_of(e_.type(), range.value_or(ValueRange{}), lossy() ? fraction_bits() : 0);
        if (lossless && values.grid > 0) tree.map = {values.grid, 0};
        tree.distances = lossless && !is_exact(e_.type(), range.value_or(ValueRange{})) && values.grid == 0;
    }

    // Where losing nothing is no dearer than the quantiser at hand, or than `budget` bytes.
    bool better_lossless(StepSearch& search, double budget) {
        if (!is_exact(e_.type(), e_.range()) || e_.tree.quantiser.step * e_.tree.map.step > 2) return false;
        return search.lossless_bytes() <= budget;
    }
    std::shared_ptr<const WaveletBricks> lossless(EncodeReport& report, const Progress& progress) {
        e_.tree.quantiser = {};
        e_.tree.map = map_of(e_.type(), e_.range(), 0);
        analyse(e_, false, progress.part(0, 0.2));
        return emit(e_, report, progress.part(0.2, 1));
    }

    std::shared_ptr<const WaveletBricks> for_bound(EncodeReport& report) {
        if (options_.amount <= 0) fail("a largest error of 0 is lossless; choose that target");
        StepSearch search(e_, report.rounds);
        double best = 0, least = std::numeric_limits<double>::infinity();
        for (const double factor : {1.0, 1.6, 2.5, 4.0}) {  // coarser steps leave more voxels beyond the bound
            const double step = std::max(1.0, factor * options_.amount / e_.tree.map.step);
            search.set_step(step);
            const double bytes = search.estimate(true).bytes;
            if (bytes < least) {
                best = step;
                least = bytes;
            }
        }
        search.set_step(best);
        const Progress rest = progress_.part(0.25, 1);
        return better_lossless(search, least) ? lossless(report, rest) : emit(e_, report, rest);
    }

    std::shared_ptr<const WaveletBricks> for_psnr(EncodeReport& report) {
        const double extent = e_.range().extent();
        const auto mse_of = [&](double psnr) { return extent * extent * std::pow(10, -psnr / 10); };
        const Progress rest = progress_.part(0.25, 1);
        if (!(extent > 0)) return lossless_or_one(report, rest);
        StepSearch search(e_, report.rounds);
        double aim = options_.amount + kPsnrSlack / 2;
        search.find_mse(mse_of(aim));
        if (e_.tree.quantiser.step * e_.tree.map.step <= 2 && better_lossless(search, search.estimate(true).bytes))
            return lossless(report, rest);
        // The estimate is seldom further off than the slack; then it is corrected by what came out.
        for (int attempt = 0;; ++attempt) {
            const double from = 1 - std::pow(0.3, attempt), to = 1 - std::pow(0.3, attempt + 1);
            auto result = emit(e_, report, rest.part(from, to));
            const double step = e_.tree.quantiser.step;
            const bool enough = report.psnr >= options_.amount || step <= 1;
            if ((enough && report.psnr <= options_.amount + kPsnrSlack) || (enough && attempt >= 2) || attempt >= 6) return result;
            const double got = std::min(report.psnr, 400.0);
            if (enough && (step > 1e6 || !std::isfinite(report.psnr))) return result;
            aim = options_.amount + kPsnrSlack / 2;
            search.correct_mse(mse_of(got), mse_of(aim));
            if (e_.tree.quantiser.step == step) return result;
            ++report.rounds;
        }
    }
    std::shared_ptr<const WaveletBricks> lossless_or_one(EncodeReport& report, const Progress& progress) {
        if (is_exact(e_.type(), e_.range())) return lossless(report, progress);
        return emit(e_, report, progress);
    }

    // The smallest step whose bytes are within the budget, to one per cent or so.
    std::shared_ptr<const WaveletBricks> for_budget(EncodeReport& report) {
        const VolumeDesc& volume = e_.tree.bricks.volume;
        const double budget = options_.target == Target::bpv ? options_.amount * double(volume.voxels()) / 8
                                                             : double(volume.dense_bytes()) / options_.amount;
        const Progress rest = progress_.part(0.25, 1);
        StepSearch search(e_, report.rounds);
        search.find_bytes(0.99 * budget, 0);
        if (better_lossless(search, 0.98 * budget)) {
            const Quantiser quantiser = e_.tree.quantiser;
            const ValueMap map = e_.tree.map;
            auto result = lossless(report, rest.part(0, 0.5));
            if (double(result->desc().compressed_bytes) <= budget) return result;
            e_.tree.quantiser = quantiser;
            e_.tree.map = map;
            analyse(e_, true, rest.part(0.5, 0.6));
        }
        std::shared_ptr<const WaveletBricks> best;
        EncodeReport best_report;
        for (int attempt = 0; attempt < 4; ++attempt) {
            const double from = 0.6 + 0.4 * (1 - std::pow(0.3, attempt)), to = 0.6 + 0.4 * (1 - std::pow(0.3, attempt + 1));
            auto result = emit(e_, report, rest.part(attempt == 0 ? 0 : from, to));
            const double got = double(result->desc().compressed_bytes), before = best ? double(best->desc().compressed_bytes) : 0;
            const bool fits = got <= budget, fitted = best && before <= budget;
            if (!best || (fits != fitted ? fits : fits ? got > before : got < before)) {
                best = result;
                best_report = report;
            }
            if ((fits && got > 0.97 * budget) || (fits && e_.tree.quantiser.step <= 1) || e_.tree.quantiser.step > 1e12) break;
            search.correct_bytes(got, (fits ? 0.992 : 0.985) * budget);
            ++report.rounds;
        }
        const int rounds = report.rounds;
        report = best_report;
        report.rounds = rounds;
        return best;
    }

    Encoding e_;
    const EncodeOptions& options_;
    const Progress& progress_;
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
    const Progress all(progress);
    auto result = Encoder(volume, options, stop, all).run(report);
    all(1);
    return result;
}

}  // namespace voxloom::wavelet
