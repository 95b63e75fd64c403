// What a value costs by each kernel, and how wrong it is: a plane wave at half of the band limit in a random direction.
#include <benchmark/benchmark.h>

#include <cmath>
#include <numbers>
#include <random>

#include "plugins/lattice-bcc/kernels.h"

namespace voxloom::bcc {
namespace {

constexpr std::int64_t kSide = 128;

void run(benchmark::State& state, Kernel kernel, bool inside) {
    const glm::dvec3 omega = glm::normalize(glm::dvec3(0.36, -0.48, 0.8)) * (std::numbers::pi * kSameBand * 0.5);
    Samples<float> samples;
    for (const int grid : {0, 1}) {
        samples.dims[grid] = Index3(kSide);
        for (std::int64_t z = 0; z < kSide; ++z)
            for (std::int64_t y = 0; y < kSide; ++y)
                for (std::int64_t x = 0; x < kSide; ++x)
                    samples.values[grid].push_back(float(std::sin(glm::dot(omega, glm::dvec3(double(x), double(y), double(z)) + 0.5 * grid))));
    }
    if (kernel == Kernel::cubic) samples = with_coefficients(samples, {});
    const InnerSamples<float> inner(samples);
    std::mt19937 random(1);
    std::uniform_real_distribution<double> place(5, double(kSide) - 6);
    std::vector<double> rows;  // a ray of 64 values each, as renderers take them
    for (int i = 0; i < 256; ++i) rows.push_back(place(random));
    double squares = 0, power = 0;
    std::int64_t values = 0;
    with_kernel(kernel, [&]<Kernel k>() {
        for (auto _ : state)
            for (std::size_t i = 0; i + 2 < rows.size(); ++i)
                for (int n = 0; n < 64; ++n) {
                    const glm::dvec3 p(5 + n, rows[i + 1], rows[i + 2]);
                    const double v = inside ? reconstruct<k>(inner, p) : reconstruct<k>(samples, p);
                    const double truth = std::sin(glm::dot(omega, p));
                    if (values < 16000) squares += (v - truth) * (v - truth), power += truth * truth;
                    benchmark::DoNotOptimize(v);
                    ++values;
                }
    });
    state.SetItemsProcessed(values);
    state.counters["error"] = std::sqrt(squares / power);
}

void add_all() {
    for (int k = 0; k < kKernels; ++k)
        for (const bool inside : {true, false})
            benchmark::RegisterBenchmark((std::string(name_of(Kernel(k))) + (inside ? "/inside" : "/clamped")).c_str(),
                                         [k, inside](benchmark::State& state) { run(state, Kernel(k), inside); });
}

}  // namespace
}  // namespace voxloom::bcc

int main(int argc, char** argv) {
    voxloom::bcc::add_all();
    benchmark::Initialize(&argc, argv);
    benchmark::RunSpecifiedBenchmarks();
}
