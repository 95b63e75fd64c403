// Vectors to train a codebook with.
#pragma once

#include <cstddef>
#include <vector>

namespace voxloom::vq {

struct Sample {
    int dim = 0;                 // components of a vector: a multiple of 8
    std::vector<float> numbers;  // the vectors, one after the other; finite
    std::vector<float> weights;  // of each, above 0

    std::size_t size() const { return weights.size(); }
    const float* vector(std::size_t i) const { return numbers.data() + i * std::size_t(dim); }
};

// Equal vectors become one with the sum of their weights, where the first of them stood; those that are zero are left out,
// because the codeword zero is always there.
Sample merged(Sample sample);

}  // namespace voxloom::vq
