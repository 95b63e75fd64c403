#include "plugins/codec-vq/sample.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "core/base/hash.h"

namespace voxloom::vq {

Sample merged(Sample sample) {
    const std::size_t bytes = std::size_t(sample.dim) * sizeof(float);
    for (float& number : sample.numbers) number += 0.0f;  // -0 becomes 0, so that equal vectors have equal bytes
    std::vector<std::pair<std::uint64_t, std::size_t>> order;
    order.reserve(sample.size());
    for (std::size_t i = 0; i < sample.size(); ++i) {
        const float* x = sample.vector(i);
        if (std::all_of(x, x + sample.dim, [](float v) { return v == 0; })) continue;
        order.emplace_back(hash_bytes(std::as_bytes(std::span(x, std::size_t(sample.dim)))).lo, i);
    }
    std::ranges::sort(order);

    // Vectors that share a hash and differ stay apart, which costs nothing but time.
    std::vector<std::size_t> kept;
    for (std::size_t k = 0; k < order.size(); ++k) {
        const std::size_t i = order[k].second;
        if (k > 0 && order[k].first == order[k - 1].first &&
            std::memcmp(sample.vector(i), sample.vector(kept.back()), bytes) == 0)
            sample.weights[kept.back()] += sample.weights[i];
        else
            kept.push_back(i);
    }
    std::ranges::sort(kept);
    for (std::size_t k = 0; k < kept.size(); ++k) {
        std::memmove(sample.numbers.data() + k * std::size_t(sample.dim), sample.vector(kept[k]), bytes);
        sample.weights[k] = sample.weights[kept[k]];
    }
    sample.numbers.resize(kept.size() * std::size_t(sample.dim));
    sample.weights.resize(kept.size());
    return sample;
}

}  // namespace voxloom::vq
