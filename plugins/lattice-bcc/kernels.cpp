#include "plugins/lattice-bcc/kernels.h"

#include "core/base/parallel.h"

namespace voxloom::bcc {

namespace {

constexpr std::array<std::string_view, kKernels> kNames = {"half", "average", "cosine", "linear-box", "dc-spline", "cosine-corrected", "cubic"};

}  // namespace

std::string_view name_of(Kernel kernel) { return kNames[std::size_t(kernel)]; }

std::optional<Kernel> kernel_named(std::string_view name) {
    const auto found = std::ranges::find(kNames, name);
    if (found == kNames.end()) return std::nullopt;
    return Kernel(found - kNames.begin());
}

template <class T>
Samples<T> with_coefficients(const Samples<T>& samples, const std::stop_token& stop) {
    Samples<T> c = samples;
    for (const int grid : {0, 1}) {
        const Index3 n = samples.dims[grid];
        // The nearest sites of A's sample i are those of B from i - 1 to i, and those of B's from i to i + 1.
        const std::int64_t first = grid == 0 ? -1 : 0;
        parallel_for(0, n.z, 1, [&](std::int64_t lo, std::int64_t hi) {
            for (std::int64_t z = lo; z < hi; ++z)
                for (std::int64_t y = 0; y < n.y; ++y)
                    for (std::int64_t x = 0; x < n.x; ++x) {
                        double sum = 0;
                        for (int i = 0; i < 8; ++i)
                            sum += samples.at(1 - grid, x + first + (i & 1), y + first + (i >> 1 & 1), z + first + (i >> 2));
                        c.values[grid][std::size_t((z * n.y + y) * n.x + x)] = T((7 * samples.at(grid, x, y, z) - 0.5 * sum) / 3);
                    }
        }, stop);
    }
    return c;
}

template Samples<float> with_coefficients(const Samples<float>&, const std::stop_token&);
template Samples<double> with_coefficients(const Samples<double>&, const std::stop_token&);

}  // namespace voxloom::bcc
