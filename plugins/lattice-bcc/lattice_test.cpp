#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "plugins/lattice-bcc/kernels.h"
#include "plugins/lattice-bcc/nodes.h"
#include "plugins/lattice-bcc/resample.h"
#include "tests/support/run_node.h"
#include "tests/support/volumes.h"

namespace voxloom::bcc {
namespace {

using ::testing::HasSubstr;
using voxloom::testing::make_volume;
using voxloom::testing::NodeRun;
using voxloom::testing::params_from_yaml;
using voxloom::testing::run_node;
using voxloom::testing::voxel;

using Function = std::function<double(glm::dvec3)>;

// Of a function in index coordinates of A.
Samples<double> sampled(Index3 dims, const Function& f) {
    Samples<double> s;
    for (const int grid : {0, 1}) {
        s.dims[grid] = dims;
        for (std::int64_t z = 0; z < dims.z; ++z)
            for (std::int64_t y = 0; y < dims.y; ++y)
                for (std::int64_t x = 0; x < dims.x; ++x) s.values[grid].push_back(f(glm::dvec3(double(x), double(y), double(z)) + 0.5 * grid));
    }
    return s;
}

double value(Kernel kernel, const Samples<double>& s, glm::dvec3 p) {
    double v = 0;
    with_kernel(kernel, [&]<Kernel k>() { v = reconstruct<k>(s, p); });
    return v;
}
Samples<double> prepared(Kernel kernel, const Samples<double>& s) { return kernel == Kernel::cubic ? with_coefficients(s, {}) : s; }

// Far enough from the ends that no kernel sees them.
std::vector<glm::dvec3> points(Index3 dims, int count) {
    std::mt19937 random(3);
    std::vector<glm::dvec3> all;
    for (int i = 0; i < count; ++i) {
        glm::dvec3 p;
        for (int a = 0; a < 3; ++a) p[a] = std::uniform_real_distribution<double>(3, double(dims[a]) - 4)(random);
        all.push_back(p);
    }
    return all;
}

const std::vector<Kernel> kAll = {Kernel::half, Kernel::average, Kernel::cosine, Kernel::linear_box, Kernel::dc_spline, Kernel::cosine_corrected, Kernel::cubic};

TEST(BccKernels, giveConstantsAndLinearFunctionsExactly) {
    const auto constant = sampled({10, 10, 10}, [](glm::dvec3) { return 7.25; });
    const Function plane = [](glm::dvec3 p) { return 3 + 0.7 * p.x - 1.3 * p.y + 0.11 * p.z; };
    const auto linear = sampled({10, 10, 10}, plane);
    for (const Kernel kernel : kAll) {
        const auto c = prepared(kernel, constant), l = prepared(kernel, linear);
        for (const glm::dvec3 p : points({10, 10, 10}, 3000)) {
            ASSERT_NEAR(value(kernel, c, p), 7.25, 1e-13) << name_of(kernel);
            ASSERT_NEAR(value(kernel, l, p), plane(p), 1e-12) << name_of(kernel);
        }
    }
}

TEST(BccKernels, goThroughTheSamplesWhereTheySaySo) {
    std::mt19937 random(11);
    std::normal_distribution<double> normal;
    const auto noise = sampled({9, 9, 9}, [&](glm::dvec3) { return normal(random); });
    for (const Kernel kernel : kAll) {
        const auto s = prepared(kernel, noise);
        double worst = 0;
        for (const int grid : {0, 1})
            for (std::int64_t i = 3; i < 6; ++i)
                for (std::int64_t j = 3; j < 6; ++j)
                    for (std::int64_t k = 3; k < 6; ++k)
                        worst = std::max(worst, std::abs(value(kernel, s, glm::dvec3(double(i), double(j), double(k)) + 0.5 * grid) - noise.at(grid, i, j, k)));
        const bool interpolates = kernel == Kernel::cosine || kernel == Kernel::linear_box || kernel == Kernel::dc_spline || kernel == Kernel::cosine_corrected;
        EXPECT_TRUE(interpolates ? worst < 1e-13 : worst > 0.1) << name_of(kernel) << ": " << worst;
    }
}

TEST(BccKernels, theCorrectedOneIsExactForQuadraticFunctionsAndTheLinearOnesAreNot) {
    const Function bowl = [](glm::dvec3 p) { return p.x * p.x - 2 * p.y * p.y + 0.5 * p.z * p.z + p.x * p.y - p.y * p.z; };
    const auto s = sampled({10, 10, 10}, bowl);
    double linear_box = 0;
    for (const glm::dvec3 p : points({10, 10, 10}, 2000)) {
        ASSERT_NEAR(value(Kernel::cosine_corrected, s, p), bowl(p), 1e-11);
        linear_box = std::max(linear_box, std::abs(value(Kernel::linear_box, s, p) - bowl(p)));
    }
    EXPECT_GT(linear_box, 0.1);
}

TEST(BccKernels, areContinuous) {
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    const auto noise = sampled({9, 9, 9}, [&](glm::dvec3) { return normal(random); });
    for (const Kernel kernel : kAll) {
        const auto s = prepared(kernel, noise);
        for (const glm::dvec3 p : points({9, 9, 9}, 2000)) {
            // Onto planes where pieces meet: of cells, and of the tetrahedra in them.
            glm::dvec3 q = p;
            q.x = std::round(2 * q.x) / 2;
            EXPECT_NEAR(value(kernel, s, q - glm::dvec3(1e-9, 0, 0)), value(kernel, s, q + glm::dvec3(1e-9, 0, 0)), 1e-6) << name_of(kernel);
            q = p;
            q.y = std::floor(q.y) + (q.x - std::floor(q.x));
            EXPECT_NEAR(value(kernel, s, q - glm::dvec3(0, 1e-9, 0)), value(kernel, s, q + glm::dvec3(0, 1e-9, 0)), 1e-6) << name_of(kernel);
        }
    }
}

// Plane waves in random directions: root mean square of the error over that of the wave, at a share of the band limit.
double error_of_waves(Kernel kernel, double share) {
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform(0, 2 * std::numbers::pi);
    double squares = 0, power = 0;
    for (int wave = 0; wave < 60; ++wave) {
        const glm::dvec3 direction = glm::normalize(glm::dvec3(normal(random), normal(random), normal(random)));
        // The band ends at half a cycle a voxel; A's spacing is sqrt(2) voxels.
        const glm::dvec3 omega = direction * (2 * std::numbers::pi * 0.5 * kSameBand * share);
        const double phase = uniform(random);
        const Function f = [&](glm::dvec3 p) { return std::sin(glm::dot(omega, p) + phase); };
        const auto s = prepared(kernel, sampled({9, 9, 9}, f));
        for (const glm::dvec3 p : points({9, 9, 9}, 150)) {
            const double e = value(kernel, s, p) - f(p);
            squares += e * e;
            power += f(p) * f(p);
        }
    }
    return std::sqrt(squares / power);
}

TEST(BccKernels, haveTheErrorsOfPlaneWavesThatTheyAreKnownFor) {
    const std::map<Kernel, std::array<double, 5>> known = {
        {Kernel::average, {.0257, .100, .355, .63, .84}},     {Kernel::cosine, {.0234, .091, .330, .59, .79}},
        {Kernel::dc_spline, {.0167, .065, .249, .48, .70}},   {Kernel::linear_box, {.0143, .057, .222, .44, .67}},
        {Kernel::cosine_corrected, {.0009, .012, .140, .43, .73}}, {Kernel::cubic, {.0019, .027, .276, .69, .94}}};
    const std::array<double, 5> shares = {0.125, 0.25, 0.5, 0.75, 1};
    for (const auto& [kernel, errors] : known)
        for (std::size_t i = 0; i < shares.size(); ++i)
            EXPECT_NEAR(error_of_waves(kernel, shares[i]) / errors[i], 1, 0.1) << name_of(kernel) << " at " << shares[i];
}

TEST(BccKernels, convergeWithTheOrderThatTheyAreSaidToHave) {
    const std::map<Kernel, double> orders = {{Kernel::half, 2}, {Kernel::average, 2}, {Kernel::cosine, 2}, {Kernel::linear_box, 2},
                                             {Kernel::dc_spline, 2}, {Kernel::cosine_corrected, 3}, {Kernel::cubic, 4}};
    for (const auto& [kernel, order] : orders)
        EXPECT_NEAR(std::log2(error_of_waves(kernel, 1.0 / 32) / error_of_waves(kernel, 1.0 / 64)), order, 0.15) << name_of(kernel);
}

TEST(BccKernels, areTheSameWithoutTheEndsWhereverThoseAreFarEnough) {
    std::mt19937 random(2);
    std::normal_distribution<double> normal;
    Samples<double> s;
    s.dims[0] = {11, 9, 12}, s.dims[1] = {10, 9, 11};
    for (const int grid : {0, 1})
        for (std::int64_t i = 0; i < s.dims[grid].x * s.dims[grid].y * s.dims[grid].z; ++i) s.values[grid].push_back(normal(random));
    const InnerSamples<double> inner(s);
    int inside = 0;
    for (const double x : {kReach - 1e-9, kReach + 1e-9, 4.6, 9 - kReach - 1e-9, 9 - kReach + 1e-9})
        for (const double y : {kReach - 1e-9, kReach + 1e-9, 4.4, 8 - kReach - 1e-9, 8 - kReach + 1e-9})
            for (const double z : {kReach - 1e-9, kReach + 1e-9, 5.5, 10 - kReach - 1e-9, 10 - kReach + 1e-9}) {
                const bool holds = inner.holds({x, y, z});
                EXPECT_EQ(holds, x > kReach && x < 9 - kReach && y > kReach && y < 8 - kReach && z > kReach && z < 10 - kReach);
                if (!holds) continue;
                ++inside;
                for (const Kernel kernel : kAll)
                    with_kernel(kernel, [&]<Kernel k>() { EXPECT_EQ((reconstruct<k>(inner, {x, y, z})), (reconstruct<k>(s, {x, y, z}))) << name_of(k); });
            }
    EXPECT_EQ(inside, 27);
}

TEST(BccKernels, takeWhatIsValidWhereSomethingIsNot) {
    auto s = sampled({6, 6, 6}, [](glm::dvec3) { return 2.0; });
    s.values[0][std::size_t((2 * 6 + 2) * 6 + 2)] = std::nan("");
    EXPECT_DOUBLE_EQ(reconstruct_valid(s, {2.1, 2.2, 2.05}), 2);
    EXPECT_TRUE(std::isnan(reconstruct_valid(s, {2, 2, 2}))) << "nothing else has a weight there";
    EXPECT_DOUBLE_EQ(reconstruct_valid(s, {4, 4, 4}), 2);
}

TEST(BccFilters, linesAreStraightToTheirEndsAndSplinesGoThroughTheirSamples) {
    for (const Filter filter : {Filter::b_spline, Filter::catmull_rom, Filter::linear})
        for (const std::int64_t n : {1, 2, 3, 4, 17}) {
            std::vector<double> line, wild;
            for (std::int64_t i = 0; i < n; ++i) line.push_back(3 - 0.5 * double(i)), wild.push_back(std::sin(double(5 * i * i)));
            std::vector<double> c = line, w = wild;
            to_coefficients(filter, c.data(), n);
            to_coefficients(filter, w.data(), n);
            auto at = [&](const std::vector<double>& of, double x) {
                const Taps taps = taps_at(filter, x, n);
                double sum = 0;
                for (int i = 0; i < taps.count; ++i) sum += taps.weights[std::size_t(i)] * of.at(std::size_t(taps.first + i));
                return sum;
            };
            for (double x = 0; x <= double(n - 1); x += 0.125) EXPECT_NEAR(at(c, x), 3 - 0.5 * x, 1e-12) << n;
            for (std::int64_t i = 0; i < n; ++i) EXPECT_NEAR(at(w, double(i)), wild[std::size_t(i)], 1e-12) << n;
            EXPECT_EQ(at(c, double(n) + 5), at(c, double(n - 1)));
        }
}

// Each point of the lattice has eight neighbours at sqrt(3)/2 of A's spacing and six at 1.
TEST(BccLattice, hasTheSitesThatItIsToHave) {
    VolumeDesc engine;
    engine.dims = {256, 256, 128};
    engine.set_spacing_origin({1, 1, 2}, {10, 20, 30});
    const LatticeDesc lattice = lattice_desc(engine, kSameBand, ScalarType::u8);
    const VolumeDesc &a = *lattice.grids[0].grid.volume(), &b = *lattice.grids[1].grid.volume();
    EXPECT_EQ(a.dims, Index3(181, 181, 90));
    EXPECT_EQ(b.dims, Index3(180, 180, 90));
    EXPECT_EQ(problem_with(lattice), "");
    auto world = [](const VolumeDesc& v, glm::dvec3 i) { return glm::dvec3(v.index_to_world * glm::dvec4(i, 1)); };
    EXPECT_EQ(world(a, {0, 0, 0}), glm::dvec3(10, 20, 30));
    const glm::dvec3 between = (world(a, {4, 5, 6}) + world(a, {5, 6, 7})) / 2.0;
    EXPECT_LT(glm::length(world(b, {4, 5, 6}) - between), 1e-12);
    const double density = double(a.voxels() + b.voxels()) / double(engine.voxels());
    EXPECT_NEAR(density, 1 / std::sqrt(2), 0.01);
    EXPECT_EQ(grid_dims({1, 1, 1}, kSameBand).b, Index3(1));
    EXPECT_EQ(grid_dims({0, 5, 5}, kSameBand).a, Index3(0));
    EXPECT_EQ(grid_dims({8, 8, 8}, 0.7).a, Index3(11)) << "a site on the last voxel counts";
}

LatticePtr resampled(const VolumePtr& volume, Filter filter, ScalarType type = ScalarType::f64) {
    return resample(*volume, {filter, kSameBand, type});
}
const Volume& grid(const LatticePtr& lattice, std::size_t i) { return *std::get<VolumePtr>(lattice->grids()[i]); }

TEST(BccResampling, keepsConstantsAndPlanesAndItsPlaceInTheWorld) {
    const VolumePtr plane = make_volume({23, 17, 11}, ScalarType::f64, [](auto x, auto y, auto z) { return 2.0 + 0.5 * double(x) - double(y) + 0.25 * double(z); }, {1, 1, 100});
    for (const Filter filter : {Filter::b_spline, Filter::catmull_rom, Filter::linear}) {
        const LatticePtr lattice = resampled(plane, filter);
        for (const std::size_t g : {0, 1}) {
            const VolumeDesc& desc = grid(lattice, g).desc();
            for (std::int64_t z = 0; z < desc.dims.z; ++z)
                for (std::int64_t x = 0; x < desc.dims.x; ++x) {
                    const glm::dvec3 w(desc.index_to_world * glm::dvec4(double(x), 3, double(z), 1));
                    ASSERT_NEAR(voxel(grid(lattice, g), {x, 3, z}), 2 + 0.5 * w.x - w.y + 0.25 * w.z / 100, 1e-10);
                }
        }
    }
}

TEST(BccResampling, theSplineIsTheBetterFilter) {
    auto f = [](glm::dvec3 p) { return std::sin(0.8 * p.x) * std::cos(0.6 * p.y) + std::sin(0.5 * p.z); };
    const VolumePtr wave = make_volume({40, 40, 40}, ScalarType::f64, [&](auto x, auto y, auto z) { return f({x, y, z}); });
    std::vector<double> errors;
    for (const Filter filter : {Filter::linear, Filter::catmull_rom, Filter::b_spline}) {
        const LatticePtr lattice = resampled(wave, filter);
        double sum = 0;
        for (const std::size_t g : {0, 1})
            for (std::int64_t z = 6; z < 22; ++z)
                for (std::int64_t y = 6; y < 22; ++y)
                    for (std::int64_t x = 6; x < 22; ++x)
                        sum += std::pow(voxel(grid(lattice, g), {x, y, z}) - f(kSameBand * (glm::dvec3(double(x), double(y), double(z)) + 0.5 * double(g))), 2);
        errors.push_back(sum);
    }
    EXPECT_GT(errors[0], 10 * errors[1]);
    EXPECT_GT(errors[1], 10 * errors[2]);
}

TEST(BccResampling, whatIsNotValidReachesNoFurtherThanItsNeighbours) {
    const VolumePtr hole = make_volume({20, 20, 20}, ScalarType::f32, [](auto x, auto y, auto z) {
        return x > 6 && x < 13 && y > 6 && y < 13 && z > 6 && z < 13 ? double(NAN) : 5.0;
    });
    const LatticePtr lattice = resampled(hole, Filter::b_spline, ScalarType::f32);
    int holes = 0;
    for (const std::size_t g : {0, 1}) {
        const Index3 n = grid(lattice, g).desc().dims;
        for (std::int64_t z = 0; z < n.z; ++z)
            for (std::int64_t y = 0; y < n.y; ++y)
                for (std::int64_t x = 0; x < n.x; ++x) {
                    const glm::dvec3 p = kSameBand * (glm::dvec3(double(x), double(y), double(z)) + 0.5 * double(g));
                    const bool inside = glm::all(glm::greaterThan(p, glm::dvec3(7))) && glm::all(glm::lessThan(p, glm::dvec3(12)));
                    const double v = voxel(grid(lattice, g), {x, y, z});
                    EXPECT_TRUE(inside ? std::isnan(v) : std::abs(v - 5) < 1e-6) << v << " at " << p.x << " " << p.y << " " << p.z;
                    holes += inside;
                }
    }
    EXPECT_GT(holes, 20);
}

TEST(BccResampling, aHoleInOneComponentIsNoneInTheOther) {
    std::mt19937 random(4);
    VolumeDesc desc;
    desc.dims = {12, 12, 12};
    desc.type = ScalarType::f64;
    desc.components = 2;
    Buffer both(desc.dense_bytes()), alone(desc.dense_bytes() / 2);
    for (std::size_t i = 0; i < desc.voxels(); ++i) {
        both.as<double>()[2 * i] = alone.as<double>()[i] = double(random() % 1000);
        both.as<double>()[2 * i + 1] = i == 0 ? NAN : 3.0;
    }
    VolumeDesc one = desc;
    one.components = 1;
    const LatticePtr with = resampled(std::make_shared<DenseVolume>(desc, std::move(both)), Filter::b_spline);
    const LatticePtr without = resampled(std::make_shared<DenseVolume>(one, std::move(alone)), Filter::b_spline);
    for (const std::size_t g : {0, 1})
        for (std::int64_t i = 0; i < 7; ++i) EXPECT_EQ(voxel(grid(with, g), {i, 4, i}), voxel(grid(without, g), {i, 4, i}));
}

TEST(BccResampling, valuesAtTheEndOfWhatThereIsStayNumbers) {
    const VolumePtr spike = make_volume({12, 12, 12}, ScalarType::f64, [](auto x, auto y, auto z) { return x == 5 && y == 6 && z == 7 ? 1.5e308 : x == 2 ? -1.7e308 : 1.0; });
    for (const Filter filter : {Filter::b_spline, Filter::catmull_rom}) {
        const LatticePtr lattice = resampled(spike, filter);
        for (const std::size_t g : {0, 1}) {
            const Volume& volume = grid(lattice, g);
            for (std::size_t i = 0; i < volume.desc().voxels(); ++i) ASSERT_TRUE(std::isfinite(reinterpret_cast<const double*>(volume.data())[i])) << g << " " << i;
        }
    }
}

TEST(BccResampling, doesNotDependOnTheFormOfTheVolume) {
    for (const Index3 dims : {Index3(1, 1, 1), Index3(1, 13, 7), Index3(2, 2, 2), Index3(31, 1, 5), Index3(0, 4, 4)}) {
        const VolumePtr volume = make_volume(dims, ScalarType::i16, [](auto, auto, auto) { return -321.0; });
        const LatticePtr lattice = resampled(volume, Filter::b_spline, ScalarType::i16);
        for (const std::size_t g : {0, 1}) {
            EXPECT_EQ(grid(lattice, g).desc().voxels() > 0, volume->desc().voxels() > 0);
            if (grid(lattice, g).desc().voxels() == 0) continue;
            EXPECT_EQ(value_range(grid(lattice, g)), (ValueRange{-321, -321}));
        }
    }
}

TEST(BccResampling, stopsAndTells) {
    const VolumePtr volume = make_volume({30, 30, 30}, ScalarType::u8, [](auto x, auto, auto) { return double(x); });
    std::stop_source stop;
    stop.request_stop();
    EXPECT_THROW(resample(*volume, {Filter::linear}, stop.get_token()), Cancelled);
    std::atomic<double> last{0};
    (void)resample(*volume, {Filter::linear}, {}, [&](double f) { last = std::max(last.load(), f); });
    EXPECT_GT(last, 0.8);
    EXPECT_LE(last, 1);
    EXPECT_THROW(resample(*volume, {std::nullopt}), Error) << "it has no closed form";
}

NodeRun there_and_back(const VolumePtr& volume, const std::string& resampling, const std::string& reconstruction) {
    const NodeType forth = resample_node(), back = reconstruct_node();
    const LatticePtr lattice = run_node(forth, params_from_yaml(forth, resampling), {{"volume", {volume}}}).output<Lattice>("lattice");
    return run_node(back, params_from_yaml(back, reconstruction), {{"lattice", {lattice}}, {"like", {volume}}});
}

TEST(BccNodes, aSmoothVolumeComesBackInEveryTypeAndComponent) {
    for (const ScalarType type : {ScalarType::u8, ScalarType::i16, ScalarType::u32, ScalarType::f32, ScalarType::f64}) {
        const VolumePtr volume = make_volume({24, 20, 28}, type, [](auto x, auto y, auto z) {
            return 60 + 40 * std::sin(0.15 * double(x)) * std::cos(0.2 * double(y)) + 10 * std::sin(0.1 * double(z));
        });
        const VolumePtr back = there_and_back(volume, "{}", "{kernel: cosine-corrected}").volume();
        EXPECT_EQ(back->desc().dims, volume->desc().dims);
        EXPECT_EQ(back->desc().type, type);
        for (std::int64_t i = 4; i < 16; ++i) EXPECT_NEAR(voxel(*back, {i, 9, i}), voxel(*volume, {i, 9, i}), is_float(type) ? 0.2 : 1.2);
    }
}

TEST(BccNodes, componentsAndMasksStayTheirOwn) {
    VolumeDesc desc;
    desc.dims = {12, 12, 12};
    desc.type = ScalarType::u16;
    desc.components = 2;
    desc.has_mask = true;
    Buffer voxels(desc.dense_bytes()), mask(desc.voxels());
    for (std::size_t i = 0; i < desc.voxels(); ++i) {
        voxels.as<std::uint16_t>()[2 * i] = 100;
        voxels.as<std::uint16_t>()[2 * i + 1] = 60000;
        mask.data()[i] = std::byte(i % 12 < 6);
    }
    const auto volume = std::make_shared<DenseVolume>(desc, std::move(voxels), std::move(mask));
    const NodeType forth = resample_node();
    const LatticePtr lattice = run_node(forth, params_from_yaml(forth, "{}"), {{"volume", {VolumePtr(volume)}}}).output<Lattice>("lattice");
    const Volume& a = grid(lattice, 0);
    ASSERT_TRUE(a.desc().has_mask);
    std::vector<std::uint8_t> row(std::size_t(a.desc().dims.x));
    a.read_mask({{0, 4, 4}, {a.desc().dims.x, 5, 5}}, row);
    EXPECT_EQ(row, (std::vector<std::uint8_t>{1, 1, 1, 1, 1, 0, 0, 0})) << "voxel 5 is the last one that is valid, and site 4 lies 5.66 voxels from the first";
    const VolumePtr back = there_and_back(volume, "{}", "{}").volume();
    std::vector<std::uint16_t> pair(2);
    back->read({{3, 5, 5}, {4, 6, 6}}, std::as_writable_bytes(std::span(pair)));
    EXPECT_EQ(pair, (std::vector<std::uint16_t>{100, 60000}));
}

TEST(BccNodes, theClosedFormIsEvaluatedAtTheSites) {
    const NodeType forth = resample_node();
    const VolumePtr ml = run_node(voxloom::testing::built_plugins(), "readers.phantom", "{kind: marschner-lobb, dims: [40, 40, 40], type: f32}").volume();
    ASSERT_TRUE(ml->closed_form());
    double splines_differ = 0;
    const LatticePtr exact = run_node(forth, params_from_yaml(forth, "{filter: closed-form}"), {{"volume", {ml}}}).output<Lattice>("lattice");
    const LatticePtr spline = run_node(forth, params_from_yaml(forth, "{}"), {{"volume", {ml}}}).output<Lattice>("lattice");
    for (const std::size_t g : {0, 1}) {
        const VolumeDesc& desc = grid(exact, g).desc();
        for (std::int64_t z = 0; z < desc.dims.z; ++z)
            for (std::int64_t x = 0; x < desc.dims.x; ++x) {
                const glm::dvec3 world(desc.index_to_world * glm::dvec4(double(x), 11, double(z), 1));
                ASSERT_EQ(float(voxel(grid(exact, g), {x, 11, z})), float(ml->closed_form()->value(world)));
                splines_differ = std::max(splines_differ, std::abs(voxel(grid(exact, g), {x, 11, z}) - voxel(grid(spline, g), {x, 11, z})));
            }
    }
    EXPECT_GT(splines_differ, 0.01);
}

TEST(BccNodes, farBeyondTheLatticeItsEndsAreContinued) {
    const VolumePtr ramp = make_volume({12, 12, 12}, ScalarType::f32, [](auto x, auto, auto) { return 10.0 + double(x); });
    const NodeType forth = resample_node(), back = reconstruct_node();
    const LatticePtr lattice = run_node(forth, params_from_yaml(forth, "{}"), {{"volume", {ramp}}}).output<Lattice>("lattice");
    const double last = voxel(grid(lattice, 0), {7, 5, 5});
    for (const double spacing : {1e3, 1e19, 1e30, 1e300}) {
        const VolumePtr like = make_volume({2, 2, 2}, ScalarType::f32, [](auto...) { return 0.0; }, glm::dvec3(spacing));
        for (const Kernel kernel : kAll) {
            const VolumePtr far = run_node(back, params_from_yaml(back, "{kernel: " + std::string(name_of(kernel)) + "}"), {{"lattice", {lattice}}, {"like", {like}}}).volume();
            EXPECT_NEAR(voxel(*far, {1, 1, 1}), last, 1) << name_of(kernel) << " " << spacing;
            EXPECT_NEAR(voxel(*far, {0, 0, 0}), 10, 1.5) << name_of(kernel) << " " << spacing;
        }
    }
}

TEST(BccNodes, withoutAVolumeToBeLikeTheGridSpansTheLattice) {
    const VolumePtr volume = make_volume({29, 29, 29}, ScalarType::u8, [](auto x, auto, auto) { return double(4 * x); });
    const NodeType forth = resample_node(), back = reconstruct_node();
    const LatticePtr lattice = run_node(forth, params_from_yaml(forth, "{}"), {{"volume", {volume}}}).output<Lattice>("lattice");
    const VolumePtr filled = run_node(back, params_from_yaml(back, "{}"), {{"lattice", {lattice}}}).volume();
    EXPECT_GE(filled->desc().dims.x, 28);
    EXPECT_LE(filled->desc().dims.x, 29);
    EXPECT_NEAR(filled->desc().spacing().x, 1, 1e-12);
    EXPECT_NEAR(voxel(*filled, {20, 3, 3}), 80, 1);
}

TEST(BccNodes, sayWhatTheyCannotTake) {
    const NodeType back = reconstruct_node();
    LatticeDesc other;
    other.kind = "d4*";
    const auto described = voxloom::testing::describe_node(back, params_from_yaml(back, "{}"), {{"lattice", {ValueDesc(other)}}});
    ASSERT_EQ(described.problems.size(), 1u);
    EXPECT_THAT(described.problems[0], HasSubstr("put bcc.resample before"));
}

}  // namespace
}  // namespace voxloom::bcc
