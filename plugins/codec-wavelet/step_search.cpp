#include "plugins/codec-wavelet/step_search.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/base/parallel.h"
#include "plugins/codec-wavelet/emission.h"

namespace voxloom::wavelet {

namespace {

// A tenth of what there is, within limits: enough for a ratio, which is what is asked of small volumes.
std::size_t families_to_try(const TreeDesc& tree) {
    return std::size_t(std::min(std::clamp<std::int64_t>(family_count(tree, 0) / 10, 32, 192), sample_size(tree)));
}

// Of each class of the sample as many as it has families, the more active counting more (Neyman's allocation, damped,
// since coarse steps make all errors alike).
std::array<std::size_t, Sample::kClasses> allot(const std::array<Sample::Class, Sample::kClasses>& classes, std::size_t families) {
    std::array<double, Sample::kClasses> share{};
    double all = 0;
    for (std::size_t c = 0; c < share.size(); ++c) all += share[c] = double(classes[c].seen) * std::exp2(double(c) / 2);
    std::array<std::size_t, Sample::kClasses> count{};
    for (std::size_t c = 0; c < share.size(); ++c)
        count[c] = std::min(classes[c].kept.size(), std::max<std::size_t>(3, std::size_t(double(families) * share[c] / all)));
    return count;
}

constexpr double kLeast = 1e-300;

}  // namespace

StepSearch::StepSearch(Encoding& e, int& rounds) : e_(e), rounds_(rounds), counts_(e.tree) {
    const TreeDesc& tree = e.tree;
    families_.resize(std::size_t(tree.top()) + 1);
    const auto& classes = e.sample.classes();
    const auto count = allot(classes, families_to_try(tree));
    for (std::size_t c = 0; c < classes.size(); ++c)
        for (std::size_t i = 0; i < count[c]; ++i)
            families_[0].push_back({classes[c].kept[i].family, double(classes[c].seen) / double(count[c]), classes[c].kept[i]});
    const auto by_number = [](const Tried& a, const Tried& b) { return a.family < b.family; };
    std::sort(families_[0].begin(), families_[0].end(), by_number);
    // An ancestor stands for its share of those below it.
    for (int l = 0; l < tree.top(); ++l) {
        const double share = double(family_count(tree, l + 1)) / double(family_count(tree, l));
        std::map<std::int64_t, double> above;
        const glm::i64vec3 n(families_of(tree, l + 1));
        for (const Tried& one : families_[std::size_t(l)]) {
            const glm::i64vec3 parent(family_of(tree, {l + 1, family_at(tree, l, one.family).index}).index);
            above[(parent.z * n.y + parent.y) * n.x + parent.x] += one.weight * share;
        }
        for (const auto& [family, weight] : above) families_[std::size_t(l) + 1].push_back({family, weight, {}});
    }
    const NoCoder none;
    set_step(0);
    std::vector<std::int32_t> scratch;
    sweep(FamilyCodec(tree, none), Order::given, [&](FamilyId family, std::size_t k, const FamilyCodec::Planes&, FamilyCodec::Planes& planes, const VoxelView& voxels) {
        if (family.level == tree.top()) return;
        if (family.level == 0) integers_of(tree, voxels, family, planes);
        const Shape shape = shape_of(tree, family);
        CoefficientCounts::Bands bands;
        for (auto& plane : planes) {
            split_family(plane.data(), shape, tree.rounding, scratch);
            bands.add(shape, plane.data());
        }
        counts_.add(family.level, bands, families_[std::size_t(family.level)][k].weight);
    });
}

void StepSearch::set_step(double step) {
    Quantiser& q = e_.tree.quantiser;
    q = {};
    if (step <= 0) return;
    q.step = step;
    q.centre_one = kCentreOne;
    q.centre_more = kCentreMore;
}

// Top down, level by level: use(family, its place in families_, the restored parent's samples, its own integers, which
// may be spoiled, its voxels). At level 0 there are voxels and no integers yet, above it the other way round.
template <class Use>
void StepSearch::sweep(const FamilyCodec& codec, Order order, const Use& use) {
    const TreeDesc& tree = e_.tree;
    std::vector<FamilyCodec::Planes> above, here;
    for (int l = tree.top(); l >= 0; --l) {
        const auto& families = families_[std::size_t(l)];
        here.assign(families.size(), {});
        const auto one = [&](std::size_t k) {
            check_stop(e_.stop);
            const FamilyId family = family_at(tree, l, families[k].family);
            FamilyCodec::Planes low;
            if (l < tree.top()) {
                const Box parent = parent_box(tree, family);
                const FamilyId owner = family_of(tree, {l + 1, family.index});
                const auto& up = families_[std::size_t(l) + 1];
                std::size_t at = 0;
                while (family_at(tree, l + 1, up[at].family).index != owner.index) ++at;
                for (const auto& plane : above[at]) {
                    low.emplace_back(parent.voxels());
                    copy_box(parent, reinterpret_cast<const std::byte*>(plane.data()), box_of(tree, owner),
                             reinterpret_cast<std::byte*>(low.back().data()), parent, sizeof(std::int32_t));
                }
            }
            thread_local FamilyCodec::Planes planes;
            if (l == 0) {
                Buffer buffer;
                const VoxelView voxels = e_.sample.get(tree, families[k].kept, buffer);
                return use(family, k, low, planes, voxels);
            }
            planes = e_.originals(family);
            const std::int32_t half = shift_ > 0 ? 1 << (shift_ - 1) : 0;
            if (shift_ > 0)
                for (auto& plane : planes)
                    for (std::int32_t& v : plane) v = (v + half) >> shift_;
            here[k] = planes;
            use(family, k, low, planes, VoxelView());
            if (!keeps_integers(tree)) codec.restore(family, low, here[k], [](const Details&) {});
        };
        if (order == Order::any)
            parallel_for(0, std::int64_t(families.size()), 1, [&](std::int64_t lo, std::int64_t hi) {
                for (std::int64_t k = lo; k < hi; ++k) one(std::size_t(k));
            }, e_.stop);
        else
            for (std::size_t k = 0; k < families.size(); ++k) one(k);
        above = std::move(here);
        here.clear();
    }
}

Estimate StepSearch::estimate(bool with_bytes) {
    ++rounds_;
    const TreeDesc& tree = e_.tree;
    const NoCoder none;
    const auto coder = with_bytes ? make_coder(e_.options.coder) : nullptr;
    const FamilyCodec codec(tree, coder ? *coder : static_cast<const Coder&>(none));
    if (with_bytes) {
        if (families_to_learn_from(coder->kind()) > 0)
            sweep(codec, Order::given, [&](FamilyId family, std::size_t, const FamilyCodec::Planes& low, FamilyCodec::Planes& planes, const VoxelView& voxels) {
                if (family.level == 0) integers_of(tree, voxels, family, planes);
                if (family.level < tree.top())
                    codec.restore(family, low, planes, [&](const Details& d) { coder->train(d); }, FamilyCodec::After::spoiled);
            });
        coder->finish_training();
    }
    struct Part {
        std::size_t bytes = 0;
        double squares = 0;
        std::uint64_t finite = 0;
    };
    std::vector<std::vector<Part>> parts;
    for (const auto& families : families_) parts.emplace_back(families.size());
    sweep(codec, Order::any, [&](FamilyId family, std::size_t k, const FamilyCodec::Planes& low, FamilyCodec::Planes& planes, const VoxelView& voxels) {
        Part& part = parts[std::size_t(family.level)][k];
        if (family.level > 0) {
            if (!with_bytes) return;
            Bytes out;
            codec.encode(family, low, planes, out, FamilyCodec::After::spoiled);
            part.bytes = out.size();
        } else {
            const EncodedFamily encoded = encode_fine(codec, tree, family, voxels, low, error_bound(e_.options, tree), nullptr);
            for (const MeasuredBrick& brick : encoded.bricks) {
                part.squares += brick.squares;
                part.finite += brick.finite;
            }
            part.bytes = encoded.bytes.size();
        }
    });
    double squares = 0, finite = 0, bytes = with_bytes ? double(coder->tables().size()) : 0;
    for (std::size_t l = parts.size(); l-- > 0;)
        for (std::size_t k = 0; k < parts[l].size(); ++k) {
            const double weight = families_[l][k].weight;
            bytes += weight * double(parts[l][k].bytes);
            squares += weight * parts[l][k].squares;
            finite += weight * double(parts[l][k].finite);
        }

    Estimate result{finite > 0 ? squares / finite : 0, 0};
    // What the sample is short of, or has too much of; where not all details are counted it knows better.
    const bool all_counted = family_count(tree, 0) <= kCountedFamilies;
    const auto ratio = [&](auto model) {
        if (!all_counted || e_.counts.empty() || counts_.empty()) return 1.0;
        const double all = (e_.counts.*model)(tree), some = (counts_.*model)(tree);
        return all > 0 && some > 0 ? all / some : 1.0;
    };
    result.mse *= ratio(&CoefficientCounts::squares);
    if (!with_bytes) return result;
    double head = 512;  // lengths, checksums and statistics
    for (int l = 0; l <= tree.top(); ++l)
        head += 6.0 * double(family_count(tree, l)) + 6.0 * double(Box::of(Index3(tree.bricks.levels[std::size_t(l)].bricks)).voxels());
    result.bytes = bytes * ratio(&CoefficientCounts::bits) + head;
    return result;
}

double StepSearch::lossless_bytes() {
    const Quantiser quantiser = std::exchange(e_.tree.quantiser, {});
    const ValueMap map = std::exchange(e_.tree.map, map_of(e_.type(), e_.range(), 0));
    shift_ = std::max(0, std::ilogb(e_.tree.map.step) - std::ilogb(map.step));
    const double bytes = estimate(true).bytes;
    shift_ = 0;
    e_.tree.quantiser = quantiser;
    e_.tree.map = map;
    return bytes;
}

// Newton's method on logarithms with the slope of the last two trials, kept within what is known to be too fine and
// too coarse. measure() grows with the step, nearly `slope` times as fast.
void StepSearch::find(double start, double goal, double slope, const std::function<double()>& measure) {
    constexpr double close = 0.005;  // 0.02 dB, half a per cent of the bytes
    double x = std::log(std::max(1.0, start)), last_x = 0, last_off = 0;
    double finest = 0, coarsest = std::log(1e12);
    for (int round = 0; round < 10; ++round) {
        set_step(std::exp(x));
        const double off = measure() - goal;
        if (std::abs(off) < close || coarsest - finest < 0.0005) return;
        if (off > 0 && x <= 0) return;  // nothing is finer
        (off < 0 ? finest : coarsest) = x;
        if (round > 0 && x != last_x) slope = std::clamp((off - last_off) / (x - last_x), slope / 3, slope * 3);
        last_x = x;
        last_off = off;
        x = std::clamp(x - off / slope, finest + 0.02 * (coarsest - finest), coarsest - 0.02 * (coarsest - finest));
        if (finest == 0 && off > 0) x = std::max(0.0, last_x - off / slope);
    }
}

// The step at which the model of all details meets the goal. It is never asked of a voxel.
double StepSearch::start_of(double goal, const std::function<double()>& model) {
    double lo = 0, hi = std::log(double(1 << 26));
    for (int i = 0; i < 30; ++i) {
        const double middle = (lo + hi) / 2;
        set_step(std::exp(middle));
        (model() < goal ? lo : hi) = middle;
    }
    return std::exp((lo + hi) / 2);
}

void StepSearch::find_mse(double mse) {
    const CoefficientCounts& counts = e_.counts.empty() ? counts_ : e_.counts;
    const double unit = e_.tree.map.step * e_.tree.map.step;
    double start = std::sqrt(12 * mse / unit);
    if (!counts.empty()) start = start_of(mse, [&] { return counts.squares(e_.tree) * unit; });
    find(start, std::log(std::max(mse, kLeast)), 1.6, [&] { return std::log(std::max(estimate(false).mse, kLeast)); });
}

void StepSearch::find_bytes(double bytes, double overhead) {
    const CoefficientCounts& counts = e_.counts.empty() ? counts_ : e_.counts;
    const double voxels = double(e_.tree.bricks.volume.voxels());
    double start = std::max(1.0, e_.range().extent() / e_.tree.map.step / 64);
    if (!counts.empty()) start = start_of(-bytes, [&] { return -counts.bits(e_.tree) * voxels / 8; });
    find(start, -std::log(bytes), 0.8, [&] { return -std::log(estimate(true).bytes + overhead); });
}

// The sample knows how the error changes with the step better than how large it is.
void StepSearch::correct_mse(double got, double wanted) {
    const double step = e_.tree.quantiser.step, thought = estimate(false).mse;
    if (!(thought > 0 && got > 0)) return set_step(std::max(1.0, step * std::pow(wanted / std::max(got, kLeast), 1 / 1.6)));
    find(step, std::log(std::max(wanted * thought / got, kLeast)), 1.6, [&] { return std::log(std::max(estimate(false).mse, kLeast)); });
}

void StepSearch::correct_bytes(double got, double wanted) {
    set_step(std::max(1.0, e_.tree.quantiser.step * std::pow(got / wanted, 1 / 0.8)));
}

}  // namespace voxloom::wavelet
