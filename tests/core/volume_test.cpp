#include "core/data/volume.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/error.h"
#include "tests/support/volumes.h"

namespace voxloom {
namespace {

using testing::make_volume;
using testing::voxel;

// What a file is: read by region, in slabs, never as a whole.
class Streamed final : public Volume {
  public:
    explicit Streamed(VolumePtr dense) : Volume(dense->desc()), dense_(std::move(dense)) {}
    void read(const Box& box, std::span<std::byte> out, const std::stop_token& stop) const override {
        dense_->read(box, out, stop);
    }
    void read_mask(const Box& box, std::span<std::uint8_t> out) const override { dense_->read_mask(box, out); }

  private:
    VolumePtr dense_;
};

TEST(DenseVolume, ReadsAnyBox) {
    const VolumePtr volume =
        make_volume({7, 5, 3}, ScalarType::i32, [](auto x, auto y, auto z) { return double(x + 10 * y + 100 * z); });
    std::vector<std::int32_t> out(2 * 3 * 2);
    volume->read({{4, 1, 1}, {6, 4, 3}}, std::as_writable_bytes(std::span(out)), {});
    auto v = out.begin();
    for (int z = 1; z < 3; ++z)
        for (int y = 1; y < 4; ++y)
            for (int x = 4; x < 6; ++x) EXPECT_EQ(*v++, x + 10 * y + 100 * z);
}

TEST(InMemory, IsTheVolumeItselfOrACopyWithItsMask) {
    VolumeDesc desc;
    desc.dims = {600, 500, 40};  // more than one slab
    desc.type = ScalarType::u8;
    desc.has_mask = true;
    Buffer voxels(desc.dense_bytes()), mask(desc.voxels());
    for (std::size_t i = 0; i < voxels.size(); ++i) {
        voxels.as<std::uint8_t>()[i] = std::uint8_t(i * 2654435761u >> 13);
        mask.as<std::uint8_t>()[i] = i % 3 != 0;
    }
    const auto dense = std::make_shared<DenseVolume>(desc, std::move(voxels), std::move(mask));
    EXPECT_EQ(in_memory(dense), dense);
    double last = 0;
    const VolumePtr copy = in_memory(std::make_shared<Streamed>(dense), {}, [&](double fraction) {
        EXPECT_GT(fraction, last);
        last = fraction;
    });
    EXPECT_EQ(last, 1);
    EXPECT_TRUE(std::equal(dense->data(), dense->data() + desc.dense_bytes(), copy->data()));
    std::vector<std::uint8_t> a(desc.voxels()), b(desc.voxels());
    dense->read_mask(Box::of(desc.dims), a);
    copy->read_mask(Box::of(desc.dims), b);
    EXPECT_EQ(a, b);

    std::stop_source stop;
    EXPECT_THROW(in_memory(std::make_shared<Streamed>(dense), stop.get_token(), [&](double) { stop.request_stop(); }),
                 Cancelled);
}

TEST(InMemory, TakesEmptyAndSingleVoxelVolumes) {
    for (Index3 dims : {Index3(0), Index3(0, 3, 3), Index3(1)}) {
        const auto streamed =
            std::make_shared<Streamed>(make_volume(dims, ScalarType::f64, [](auto, auto, auto) { return 3.0; }));
        EXPECT_EQ(in_memory(streamed)->desc().dims, dims);
    }
}

TEST(ValueRangeOf, IsExactForEveryTypeAndItsLimits) {
    for (int i = 0; i < kScalarTypes; ++i) {
        const auto [lowest, highest] = limits_of(ScalarType(i));
        const VolumePtr limits = make_volume({40, 30, 20}, ScalarType(i), [lo = lowest, hi = highest](auto x, auto y, auto z) {
            return x == 39 && y == 29 && z == 19 ? hi : x + y + z == 5 ? lo : 1.0;
        });
        EXPECT_EQ(value_range(*limits), (ValueRange{lowest, highest}));
        EXPECT_EQ(value_range(Streamed(limits)), (ValueRange{lowest, highest}));
        const VolumePtr one = make_volume({1, 1, 1}, ScalarType(i), [](auto, auto, auto) { return 7.0; });
        EXPECT_EQ(value_range(*one), (ValueRange{7, 7}));
    }
}

TEST(ValueRangeOf, LeavesOutNanAndInfinityButNotDenormals) {
    const double inf = std::numeric_limits<double>::infinity(), nan = std::nan("");
    for (ScalarType type : {ScalarType::f32, ScalarType::f64}) {
        const double tiny = type == ScalarType::f32 ? double(std::numeric_limits<float>::denorm_min())
                                                    : std::numeric_limits<double>::denorm_min();
        const VolumePtr volume = make_volume({30, 20, 10}, type, [&](auto x, auto y, auto z) {
            const double all[] = {nan, inf, -inf, tiny, -tiny, 0.0, -0.0};
            return all[(x + y + z) % 7];
        });
        EXPECT_EQ(value_range(*volume), (ValueRange{-tiny, tiny}));
        const VolumePtr nothing = make_volume({9, 9, 9}, type, [&](auto x, auto, auto) { return x % 2 ? nan : inf; });
        EXPECT_EQ(value_range(*nothing), ValueRange{});
    }
    EXPECT_EQ(value_range(*make_volume({0, 5, 5}, ScalarType::u8, [](auto, auto, auto) { return 1.0; })), ValueRange{});
}

TEST(VolumeDescription, RefusesSizesThatDoNotFit) {
    VolumeDesc desc;
    desc.name = "giant";
    desc.dims = Index3(std::int64_t(1) << 21);
    EXPECT_THROW(desc.dense_bytes(), Error);
    desc.dims = {1 << 20, 1 << 20, 1 << 20};
    desc.type = ScalarType::u8;
    EXPECT_EQ(desc.dense_bytes(), std::uint64_t(1) << 60);
}

TEST(VolumeDescription, SpacingIsTheLengthOfAStepWhateverTheDirection) {
    VolumeDesc desc;
    desc.index_to_world = glm::dmat4{{0, 3, 4, 0}, {-2, 0, 0, 0}, {0, 0, 1e-9, 0}, {1, 2, 3, 1}};
    EXPECT_EQ(desc.spacing(), glm::dvec3(5, 2, 1e-9));
    EXPECT_EQ(desc.origin(), glm::dvec3(1, 2, 3));
}

}  // namespace
}  // namespace voxloom
