#include "plugins/codec-vq/training.h"

#include <algorithm>
#include <cassert>
#include <numeric>

#include "core/base/parallel.h"
#include "plugins/codec-vq/nearest.h"
#include "plugins/codec-vq/principal_axis.h"

namespace voxloom::vq {

namespace {

constexpr std::int64_t kGrain = 512;  // vectors a thread takes at a time

// --- splitting ---

struct Cell {
    std::size_t begin = 0, end = 0;
    std::vector<double> centroid;
    double distortion = 0;
};

Cell cell_of(const Sample& sample, std::span<const std::size_t> order, std::size_t begin, std::size_t end) {
    Cell cell{begin, end, centroid_of(sample, order.subspan(begin, end - begin)), 0};
    for (std::size_t k = begin; k < end && end - begin > 1; ++k) {
        const float* x = sample.vector(order[k]);
        double squares = 0;
        for (std::size_t c = 0; c < cell.centroid.size(); ++c) {
            const double d = double(x[c]) - cell.centroid[c];
            squares += d * d;
        }
        cell.distortion += double(sample.weights[order[k]]) * squares;
    }
    return cell;
}

// Reorders the cell's members so that those on the lower side of the plane come first; where the upper ones begin.
std::size_t divide(const Sample& sample, std::vector<std::size_t>& order, const Cell& cell) {
    const std::span members(order.data() + cell.begin, cell.end - cell.begin);
    const std::vector<double> axis = principal_axis(sample, members, cell.centroid);
    const auto is_low = [&](std::size_t i) {
        double along = 0;
        for (std::size_t c = 0; c < axis.size(); ++c) along += (double(sample.vector(i)[c]) - cell.centroid[c]) * axis[c];
        return along <= 0;
    };
    return std::size_t(std::stable_partition(members.begin(), members.end(), is_low) - members.begin()) + cell.begin;
}

// --- sweeps ---

struct Assignment {
    std::vector<std::uint8_t> index;
    std::vector<float> distance;
    double distortion = 0;
};

void assign(const Sample& sample, const Codebook& book, Assignment& a, const std::stop_token& stop) {
    const SearchTable table = search_table(book.words, book.dim);
    parallel_for(0, std::int64_t(sample.size()), kGrain, [&](std::int64_t lo, std::int64_t hi) {
        for (std::int64_t at = lo; at < hi; at += kGrain) {
            check_stop(stop);
            const auto i = std::size_t(at);
            find_nearest(table, sample.vector(i), std::size_t(std::min(kGrain, hi - at)), &a.index[i], &a.distance[i]);
        }
    }, stop);
    a.distortion = 0;
    for (std::size_t i = 0; i < sample.size(); ++i) a.distortion += double(sample.weights[i]) * double(a.distance[i]);
}

// The vectors of each codeword in their order, as ranges of one list.
Cells members_of(const Assignment& a, int codewords) {
    Cells cells;
    cells.ends.assign(std::size_t(codewords), 0);
    for (const std::uint8_t i : a.index) ++cells.ends[i];
    std::inclusive_scan(cells.ends.begin(), cells.ends.end(), cells.ends.begin());
    std::vector<std::size_t> at(cells.ends.size());
    std::copy(cells.ends.begin(), cells.ends.end() - 1, at.begin() + 1);
    cells.order.resize(a.index.size());
    for (std::size_t i = 0; i < a.index.size(); ++i) cells.order[at[a.index[i]]++] = i;
    return cells;
}

std::span<const std::size_t> members(const Cells& cells, int cell) {
    const std::size_t begin = cell ? cells.ends[std::size_t(cell) - 1] : 0;
    return std::span(cells.order).subspan(begin, cells.ends[std::size_t(cell)] - begin);
}

void set_word(Codebook& book, int word, std::span<const double> centroid) {
    for (std::size_t c = 0; c < centroid.size(); ++c) book.words[std::size_t(word * book.dim) + c] = float(centroid[c]);
}

// Every codeword but zero to the centroid of its vectors; those without any to the vectors that are worst off.
void move_words(const Sample& sample, const Assignment& a, Codebook& book) {
    const Cells cells = members_of(a, book.count());
    parallel_for(1, book.count(), 1, [&](std::int64_t lo, std::int64_t hi) {
        for (int word = int(lo); word < int(hi); ++word)
            if (!members(cells, word).empty()) set_word(book, word, centroid_of(sample, members(cells, word)));
    });
    std::vector<int> empty;
    for (int word = 1; word < book.count(); ++word)
        if (members(cells, word).empty()) empty.push_back(word);
    if (empty.empty()) return;
    const auto cost = [&](std::size_t i) { return double(sample.weights[i]) * double(a.distance[i]); };
    std::vector<std::size_t> worst(sample.size());
    std::iota(worst.begin(), worst.end(), std::size_t(0));
    const std::size_t some = std::min(empty.size(), worst.size());
    std::partial_sort(worst.begin(), worst.begin() + std::ptrdiff_t(some), worst.end(), [&](std::size_t i, std::size_t j) {
        return cost(i) != cost(j) ? cost(i) > cost(j) : i < j;
    });
    for (std::size_t k = 0; k < some; ++k)
        std::copy_n(sample.vector(worst[k]), book.dim, book.words.begin() + empty[k] * book.dim);
}

Codebook book_of(const Sample& sample, const Cells& cells) {
    Codebook book;
    book.dim = sample.dim;
    book.words.assign((cells.ends.size() + 1) * std::size_t(sample.dim), 0.0f);
    for (int cell = 0; cell < int(cells.ends.size()); ++cell)
        set_word(book, cell + 1, centroid_of(sample, members(cells, cell)));
    return book;
}

}  // namespace

Cells split_by_principal_axes(const Sample& sample, int count, const std::stop_token& stop) {
    Cells result;
    result.order.resize(sample.size());
    std::iota(result.order.begin(), result.order.end(), std::size_t(0));
    if (sample.size() == 0 || count < 1) return result;
    std::vector<Cell> cells{cell_of(sample, result.order, 0, sample.size())};
    while (int(cells.size()) < count) {
        check_stop(stop);
        Cell& widest = *std::ranges::max_element(cells, {}, &Cell::distortion);
        if (!(widest.distortion > 0)) break;
        const std::size_t middle = divide(sample, result.order, widest);
        if (middle == widest.begin || middle == widest.end) {
            widest.distortion = 0;  // no plane parts what is left: differences below rounding
            continue;
        }
        const Cell upper = cell_of(sample, result.order, middle, widest.end);
        widest = cell_of(sample, result.order, widest.begin, middle);
        cells.push_back(upper);
    }
    std::ranges::sort(cells, {}, &Cell::begin);
    for (const Cell& cell : cells) result.ends.push_back(cell.end);
    return result;
}

Training train(Sample all, const TrainOptions& options, const std::stop_token& stop) {
    assert(options.codewords >= 1 && options.codewords <= kMostCodewords);
    const Sample sample = merged(std::move(all));
    Training training;
    training.book = book_of(sample, split_by_principal_axes(sample, options.codewords - 1, stop));
    Assignment assignment{std::vector<std::uint8_t>(sample.size()), std::vector<float>(sample.size()), 0};
    assign(sample, training.book, assignment, stop);
    training.distortion = {assignment.distortion};
    for (int sweep = 0; sweep < options.sweeps && assignment.distortion > 0; ++sweep) {
        Codebook next = training.book;
        move_words(sample, assignment, next);
        assign(sample, next, assignment, stop);
        const double before = training.distortion.back();
        if (!(assignment.distortion < before)) break;  // what is left is rounding: the book before is as good
        training.book = std::move(next);
        training.distortion.push_back(assignment.distortion);
        if (before - assignment.distortion < options.gain * before) break;
    }
    return training;
}

}  // namespace voxloom::vq
