// A codebook from a sample: cells split across their principal axis, then refined by Linde, Buzo and Gray's sweeps.
//
// Schneider, Westermann, Compression Domain Volume Rendering, IEEE Visualization 2003, section 4.
#pragma once

#include <span>
#include <stop_token>
#include <vector>

#include "plugins/codec-vq/sample.h"

namespace voxloom::vq {

struct TrainOptions {
    int codewords = 256;  // at most, the zero vector included; 1 to 256
    int sweeps = 20;      // at most
    double gain = 1e-3;   // sweeps end when the distortion falls by less, relatively
};

struct Codebook {
    int dim = 0;
    std::vector<float> words;  // the first one is zero; as many as the sample has use for
    int count() const { return dim ? int(words.size()) / dim : 0; }
    std::span<const float> word(int i) const { return std::span(words).subspan(std::size_t(i * dim), std::size_t(dim)); }
};

struct Training {
    Codebook book;
    // Weighted sum of the squared distances: after the splits, then after each sweep that made it smaller.
    std::vector<double> distortion;
};

// The same sample gives the same book, whatever the threads. Vectors that are as many as the codewords are all codewords.
Training train(Sample sample, const TrainOptions& options, const std::stop_token& stop = {});

// --- parts of it, for tests ---

// The cells of the sample as ranges of an order of its vectors; neighbours in space tend to be neighbours in it.
struct Cells {
    std::vector<std::size_t> order;
    std::vector<std::size_t> ends;  // of each cell, increasing
};
// Splits the cell with the largest weighted distortion through its centroid, across its principal axis, until there
// are `cells` of them or nothing is left to split. The sample is merged().
Cells split_by_principal_axes(const Sample& sample, int cells, const std::stop_token& stop = {});

}  // namespace voxloom::vq
