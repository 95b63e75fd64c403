// Codebooks: the search against its definition, the splits, and what training promises.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include "core/base/error.h"
#include "plugins/codec-vq/nearest.h"
#include "plugins/codec-vq/principal_axis.h"
#include "plugins/codec-vq/training.h"

namespace voxloom::vq {
namespace {

// Clouds around a few centres.
Sample clouds(int dim, std::size_t count, unsigned seed = 1, double scale = 1) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    Sample sample;
    sample.dim = dim;
    for (std::size_t i = 0; i < count; ++i) {
        const auto cloud = double(random() % 7);
        for (int c = 0; c < dim; ++c) sample.numbers.push_back(float(scale * (std::sin(cloud * (c + 1)) * 3 + normal(random))));
        sample.weights.push_back(float(1 + random() % 3));
    }
    return sample;
}

double squared(const float* a, const float* b, int dim) {
    double sum = 0;
    for (int c = 0; c < dim; ++c) sum += (double(a[c]) - double(b[c])) * (double(a[c]) - double(b[c]));
    return sum;
}

TEST(Nearest, IsTheNearestWhateverTheGuess) {
    for (const int dim : {8, 64})
        for (const int words : {1, 2, 31, 32, 33, 100, 255, 256}) {
            const Sample book = clouds(dim, std::size_t(words), 2), x = clouds(dim, 103, 3);
            const SearchTable table = search_table(book.numbers, dim);
            std::vector<std::uint8_t> index(x.size()), guessed(x.size());
            std::vector<float> distance(x.size()), again(x.size());
            for (std::size_t i = 0; i < x.size(); ++i) guessed[i] = std::uint8_t(i * 7);
            find_nearest(table, x.numbers.data(), x.size(), index.data(), distance.data());
            find_nearest(table, x.numbers.data(), x.size(), guessed.data(), again.data());
            EXPECT_EQ(index, guessed);
            EXPECT_EQ(distance, again);
            for (std::size_t i = 0; i < x.size(); ++i) {
                double best = 1e300;
                for (int w = 0; w < words; ++w) best = std::min(best, squared(book.vector(std::size_t(w)), x.vector(i), dim));
                EXPECT_NEAR(squared(book.vector(index[i]), x.vector(i), dim), best, 1e-5 * best);
                EXPECT_NEAR(double(distance[i]), best, 1e-5 * best);
            }
        }
}

TEST(Nearest, OfEqualCodewordsTheFirstIsTaken) {
    std::vector<float> words(8 * 70, 5.0f);
    std::fill(words.begin(), words.begin() + 8 * 3, 100.0f);
    const SearchTable table = search_table(words, 8);
    const std::vector<float> x(8 * 5, 4.0f);
    std::vector<std::uint8_t> index = {0, 69, 40, 3, 2};
    std::vector<float> distance(5);
    find_nearest(table, x.data(), 5, index.data(), distance.data());
    for (std::size_t i = 0; i < 5; ++i) {
        EXPECT_EQ(index[i], 3);
        EXPECT_EQ(distance[i], 8.0f);
    }
}

TEST(Samples, EqualVectorsBecomeOneAndZerosNone) {
    Sample sample;
    sample.dim = 8;
    for (const float v : {2.0f, 0.0f, 1.0f, 2.0f, -0.0f, 2.0f}) {
        sample.numbers.insert(sample.numbers.end(), 8, v);
        sample.weights.push_back(2);
    }
    const Sample one = merged(sample);
    ASSERT_EQ(one.size(), 2u);
    EXPECT_EQ(one.vector(0)[0], 2.0f);
    EXPECT_EQ(one.weights[0], 6.0f);
    EXPECT_EQ(one.vector(1)[7], 1.0f);
    EXPECT_EQ(one.weights[1], 2.0f);
    EXPECT_EQ(merged(Sample{8, {}, {}}).size(), 0u);
}

TEST(PrincipalAxis, IsTheLongAxisOfACloudWhereverItPoints) {
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    for (const int dim : {8, 64})
        for (int turn = 0; turn < 6; ++turn) {
            std::vector<double> axis(std::size_t(dim), 0.0);
            double length = 0;
            for (double& a : axis) {
                a = turn == 0 ? 1 : normal(random);
                length += a * a;
            }
            for (double& a : axis) a /= std::sqrt(length);
            Sample sample;
            sample.dim = dim;
            std::vector<std::size_t> all(6000);
            for (std::size_t i = 0; i < all.size(); ++i) {
                const double along = 5 * normal(random);
                for (int c = 0; c < dim; ++c) sample.numbers.push_back(float(7 + along * axis[std::size_t(c)] + 0.3 * normal(random)));
                sample.weights.push_back(1);
                all[i] = i;
            }
            const std::vector<double> found = principal_axis(sample, all, centroid_of(sample, all));
            double cosine = 0;
            for (std::size_t c = 0; c < axis.size(); ++c) cosine += found[c] * axis[c];
            EXPECT_GT(std::abs(cosine), 0.999);
        }
}

// A start at right angles to the long axis finds it all the same: component 0 is the widest one by itself, and
// the others are wider together.
TEST(PrincipalAxis, IsNotTheWidestComponent) {
    Sample sample;
    sample.dim = 8;
    for (int i = 0; i < 4; ++i) {
        const float a = i & 1 ? 1.1f : -1.1f, b = i & 2 ? 1.0f : -1.0f;
        sample.numbers.insert(sample.numbers.end(), {a, b, b, b, b, b, b, b});
        sample.weights.push_back(1);
    }
    const std::vector<std::size_t> all = {0, 1, 2, 3};
    const std::vector<double> found = principal_axis(sample, all, centroid_of(sample, all));
    EXPECT_NEAR(found[0], 0, 1e-3);
    EXPECT_NEAR(std::abs(found[1]), 1 / std::sqrt(7.0), 1e-3);
}

TEST(Splits, OfALineAreIntervalsOfIt) {
    std::mt19937 random(4);
    Sample sample;
    sample.dim = 64;
    std::vector<double> place;
    for (int i = 0; i < 500; ++i) {
        place.push_back(std::pow(double(random() % 1000) / 100, 2));
        for (int c = 0; c < 64; ++c) sample.numbers.push_back(float(place.back() * (c % 5 - 2.3)));
        sample.weights.push_back(1);
    }
    // Two cells: the median order, parted at the mean.
    const Cells two = split_by_principal_axes(sample, 2);
    double mean = 0;
    for (const double p : place) mean += p / 500;
    for (std::size_t k = 0; k < two.ends[0]; ++k)
        EXPECT_EQ(place[two.order[k]] < mean, place[two.order[0]] < mean);
    // Many: each an interval.
    const Cells cells = split_by_principal_axes(sample, 20);
    ASSERT_EQ(cells.ends.size(), 20u);
    std::vector<std::pair<double, double>> intervals;
    std::size_t begin = 0;
    for (const std::size_t end : cells.ends) {
        ASSERT_GT(end, begin);
        intervals.emplace_back(1e9, -1e9);
        for (std::size_t k = begin; k < end; ++k) {
            intervals.back().first = std::min(intervals.back().first, place[cells.order[k]]);
            intervals.back().second = std::max(intervals.back().second, place[cells.order[k]]);
        }
        begin = end;
    }
    EXPECT_EQ(begin, 500u);
    std::ranges::sort(intervals);
    for (std::size_t i = 1; i < intervals.size(); ++i) EXPECT_LT(intervals[i - 1].second, intervals[i].first);
}

TEST(Training, NeverMakesTheDistortionLarger) {
    for (const int dim : {8, 64})
        for (const int codewords : {2, 16, 100}) {
            const Sample sample = clouds(dim, 1000);
            const Training training = train(sample, {codewords, 20, 1e-3});
            EXPECT_EQ(training.book.count(), codewords);
            ASSERT_GE(training.distortion.size(), 2u);
            for (std::size_t i = 1; i < training.distortion.size(); ++i)
                EXPECT_LT(training.distortion[i], training.distortion[i - 1]);
            // And says what it is.
            double sum = 0;
            for (std::size_t i = 0; i < sample.size(); ++i) {
                double best = 1e300;
                for (int w = 0; w < codewords; ++w) best = std::min(best, squared(training.book.word(w).data(), sample.vector(i), dim));
                sum += best * double(sample.weights[i]);
            }
            EXPECT_NEAR(training.distortion.back(), sum, 1e-4 * sum);
            for (const float v : training.book.word(0)) EXPECT_EQ(v, 0);
        }
}

TEST(Training, AsManyCodewordsAsVectorsAreThoseVectors) {
    for (const double scale : {1.0, 1e-12, 1e9}) {
        const Sample sample = clouds(64, 99, 6, scale);
        const Training training = train(sample, {100, 20, 1e-3});
        EXPECT_EQ(training.distortion.back(), 0);
        EXPECT_EQ(training.book.count(), 100);
        std::set<std::vector<float>> words, vectors;
        for (int w = 1; w < 100; ++w) words.emplace(training.book.word(w).begin(), training.book.word(w).end());
        for (std::size_t i = 0; i < 99; ++i) vectors.emplace(sample.vector(i), sample.vector(i) + 64);
        EXPECT_EQ(words, vectors);
    }
}

TEST(Training, OfNothingOrZerosIsZero) {
    for (const std::size_t zeros : {0, 5}) {
        const Training training = train({8, std::vector<float>(8 * zeros, -0.0f), std::vector<float>(zeros, 1.0f)}, {});
        EXPECT_EQ(training.book.words, std::vector<float>(8, 0.0f));
        EXPECT_EQ(training.distortion.back(), 0);
    }
    EXPECT_EQ(train(clouds(8, 20), {1, 20, 1e-3}).book.count(), 1);
}

// Vectors near zero take the pinned codeword for themselves, and one of the others has to look elsewhere.
TEST(Training, CodewordsWithoutVectorsFindNewOnes) {
    Sample sample;
    sample.dim = 8;
    for (int i = 0; i < 40; ++i) {
        const float v = i < 20 ? 0.01f * float(i % 5 - 2) + 0.001f : 100 + float(i * i);
        sample.numbers.insert(sample.numbers.end(), {v, 0, 0, 0, 0, 0, 0, v});
        sample.weights.push_back(i < 20 ? 1e6f : 1.0f);
    }
    const Training training = train(sample, {8, 20, 1e-3});
    std::vector<std::uint8_t> index(40);
    std::vector<float> distance(40);
    find_nearest(search_table(training.book.words, 8), sample.numbers.data(), 40, index.data(), distance.data());
    for (int w = 1; w < training.book.count(); ++w) EXPECT_NE(std::ranges::count(index, w), 0) << w;
}

TEST(Training, ThreadsDoNotChangeIt) {
    std::vector<Training> runs;
    for (const std::size_t threads : {1, 2, 5}) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        runs.push_back(train(clouds(64, 5000), {64, 6, 1e-3}));
    }
    for (const Training& run : runs) {
        EXPECT_EQ(run.book.words, runs[0].book.words);
        EXPECT_EQ(run.distortion, runs[0].distortion);
    }
}

TEST(Training, EndsWhenItIsStopped) {
    std::stop_source stop;
    stop.request_stop();
    EXPECT_THROW(train(clouds(64, 1000), {}, stop.get_token()), Cancelled);
}

}  // namespace
}  // namespace voxloom::vq
