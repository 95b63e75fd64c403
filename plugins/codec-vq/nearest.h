// The nearest codeword of many vectors: the loop that training and encoding spend their time in.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace voxloom::vq {

inline constexpr int kMostCodewords = 256;

// A codebook laid out for the search: the first component of all codewords, then the second, and so on, each row filled
// up with numbers that are far from every vector.
struct SearchTable {
    int dim = 0, count = 0, stride = 0;
    std::vector<float> columns;  // dim rows of `stride` numbers
};
// `words` holds 1 to 256 codewords of `dim` finite components each, one after the other; dim is a multiple of 8.
SearchTable search_table(std::span<const float> words, int dim);

// For each of `count` vectors (dim components each) the codeword with the smallest squared distance, of equal ones the
// first, and that distance. `index` holds guesses on entry: a good one saves time and changes nothing. Components are
// at most 1e10 in size. Sums are made in one order, so results are the same bit for bit on every processor.
void find_nearest(const SearchTable& table, const float* vectors, std::size_t count, std::uint8_t* index, float* distance);

}  // namespace voxloom::vq
