#include "plugins/codec-vq/survey.h"

#include <algorithm>
#include <map>

#include "core/base/parallel.h"
#include "plugins/codec-vq/block.h"

namespace voxloom::vq {

namespace {

// Calls f(values) for each block of a component of a brick that is neither constant nor without a number.
template <class T, class F>
void for_each_coded_block(const Channel<const T>& channel, const F& f) {
    const Index3 n = blocks_of(channel.dims);
    for (std::int64_t z = 0; z < n.z; ++z)
        for (std::int64_t y = 0; y < n.y; ++y)
            for (std::int64_t x = 0; x < n.x; ++x) {
                const Block<T> values = read_block(channel, {x, y, z});
                if (all_finite(values) && !is_constant(values)) f(values);
            }
}

struct Finite {
    ValueRange range;
    bool any = false;
    void add(double v) {
        range = any ? ValueRange{std::min(range.min, v), std::max(range.max, v)} : ValueRange{v, v};
        any = true;
    }
};

std::optional<int> middle_of(const std::vector<std::map<int, std::uint64_t>>& counted) {
    std::map<int, std::uint64_t> all;
    std::uint64_t sum = 0;
    for (const auto& brick : counted)
        for (const auto& [exponent, count] : brick) all[exponent] += count, sum += count;
    std::uint64_t below = 0;
    for (const auto& [exponent, count] : all)
        if ((below += count) * 2 >= sum) return exponent;
    return std::nullopt;
}

// A number in [0, 1) for each (seed, i): SplitMix64 (Steele, Lea, Flood 2014).
double uniform(std::uint64_t seed, std::uint64_t i) {
    std::uint64_t z = seed * 0xd1342543de82ef95 + (i + 1) * 0x9e3779b97f4a7c15;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return double((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

// `some` of `all` in increasing order, one from each of as many equal parts.
std::vector<std::uint64_t> chosen(std::uint64_t all, std::uint64_t some, std::uint64_t seed) {
    some = std::min(all, some);
    std::vector<std::uint64_t> picks(some);
    for (std::uint64_t j = 0; j < some; ++j) {
        const std::uint64_t begin = j * all / some, end = (j + 1) * all / some;
        picks[j] = begin + std::min(end - begin - 1, std::uint64_t(uniform(seed, j) * double(end - begin)));
    }
    return picks;
}

}  // namespace

Buffer voxels_of_brick(const Volume& volume, const Box& box, const std::stop_token& stop) {
    check_stop(stop);
    Buffer voxels(box.voxels() * volume.desc().voxel_bytes(), "voxels to encode");
    volume.read(box, voxels.bytes(), stop);
    return voxels;
}

Survey survey(const Volume& volume, const VqIndex& index, const std::stop_token& stop,
              const std::function<void(double)>& progress) {
    const std::size_t count = Box::of(Index3(index.desc.levels[0].bricks)).voxels();
    const int components = volume.desc().components;
    Survey result;
    result.coded.resize(count * std::size_t(components));
    std::vector<Finite> ranges(count);
    std::vector<std::map<int, std::uint64_t>> exponents(count);
    constexpr std::int64_t kBatch = 64;
    for (std::int64_t first = 0; first < std::int64_t(count); first += kBatch) {
        parallel_for(first, std::min(first + kBatch, std::int64_t(count)), 1, [&](std::int64_t lo, std::int64_t hi) {
            for (auto b = std::size_t(lo); b < std::size_t(hi); ++b) {
                const Box box = index.desc.box_of(brick_at(index.desc, b));
                const Buffer voxels = voxels_of_brick(volume, box, stop);
                with_type(volume.desc().type, [&](auto t) {
                    using T = decltype(t);
                    for (const T v : voxels.as<T>())
                        if (std::isfinite(double(v))) ranges[b].add(double(v));
                    for (int c = 0; c < components; ++c)
                        for_each_coded_block<T>({voxels.as<T>().data(), box.dims(), components, c}, [&](const Block<T>& block) {
                            if constexpr (std::is_floating_point_v<T>) ++exponents[b][exponent_of(block)];
                            ++result.coded[b * std::size_t(components) + std::size_t(c)];
                        });
                });
            }
        }, stop);
        progress(double(first) / double(count));
    }
    Finite all;
    for (const Finite& range : ranges)
        if (range.any) {
            all.add(range.range.min);
            all.add(range.range.max);
        }
    result.range = all.range;
    result.middle = middle_of(exponents);
    return result;
}

Sample sample_of(const Volume& volume, const VqIndex& index, const Survey& survey, std::span<const std::size_t> bricks,
                 int component, const EncodeOptions& options, const std::stop_token& stop) {
    const int components = volume.desc().components;
    std::vector<std::uint64_t> begins{0};  // how many coded blocks stand before each brick
    for (const std::size_t b : bricks)
        begins.push_back(begins.back() + survey.coded[b * std::size_t(components) + std::size_t(component)]);
    const std::vector<std::uint64_t> picks = chosen(begins.back(), options.sample, options.seed);
    Sample sample{kVoxels, std::vector<float>(picks.size() * kVoxels), std::vector<float>(picks.size(), 1.0f)};
    parallel_for(0, std::int64_t(bricks.size()), 1, [&](std::int64_t lo, std::int64_t hi) {
        for (auto k = std::size_t(lo); k < std::size_t(hi); ++k) {
            auto pick = std::size_t(std::ranges::lower_bound(picks, begins[k]) - picks.begin());
            if (pick == picks.size() || picks[pick] >= begins[k + 1]) continue;
            const Box box = index.desc.box_of(brick_at(index.desc, bricks[k]));
            const Buffer voxels = voxels_of_brick(volume, box, stop);
            with_type(volume.desc().type, [&](auto t) {
                using T = decltype(t);
                std::uint64_t at = begins[k];
                for_each_coded_block<T>({voxels.as<T>().data(), box.dims(), components, component}, [&](const Block<T>& values) {
                    if (pick == picks.size() || picks[pick] != at++) return;
                    float* numbers = &sample.numbers[pick++ * kVoxels];  // of a block that is kept as it is: zero
                    if (!is_too_wide(values, index.unit)) mean_and_differences(values, index.unit, options.loop == Loop::closed, numbers);
                });
            });
        }
    }, stop);
    return sample;
}

}  // namespace voxloom::vq
