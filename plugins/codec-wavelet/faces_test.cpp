// Shared faces: what neighbouring families must agree on, and what that is good for.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "core/data/brick_cache.h"
#include "core/data/convert.h"
#include "core/base/byte_io.h"
#include "plugins/codec-wavelet/encoder.h"
#include "plugins/codec-wavelet/level_store.h"
#include "tests/support/volumes.h"

namespace voxloom::wavelet {
namespace {

using voxloom::testing::make_volume;

EncodeOptions with_shared_faces(CoderKind coder = CoderKind::dense) {
    EncodeOptions options;
    options.coder = coder;
    options.brick = 8;
    options.faces = Faces::shared;
    return options;
}
std::shared_ptr<const WaveletBricks> encoded(const Volume& volume, const EncodeOptions& options) {
    EncodeReport report;
    return encode(volume, options, report);
}
std::vector<std::byte> decoded(const BricksPtr& bricks, int level) {
    BrickCache cache(64 << 20);
    const Box box = Box::of(bricks->desc().levels[std::size_t(level)].dims);
    std::vector<std::byte> voxels(box.voxels() * bricks->desc().volume.voxel_bytes());
    read_region(bricks, level, box, voxels, cache);
    return voxels;
}
std::vector<std::byte> all_of(const Volume& volume) {
    std::vector<std::byte> voxels(volume.desc().dense_bytes());
    volume.read(Box::of(volume.desc().dims), voxels, {});
    return voxels;
}

// Waves, a step and noise; one in forty voxels of floats is not a number.
VolumePtr scene(Index3 dims, ScalarType type, glm::dvec3 spacing) {
    auto [lo, hi] = limits_of(type);
    if (is_float(type)) lo = -3, hi = 1000;
    std::mt19937 random(3);
    return make_volume(dims, type, [&, lo = lo, hi = hi](auto x, auto y, auto z) {
        if (is_float(type) && random() % 40 == 0) return std::numeric_limits<double>::quiet_NaN();
        const double wave = 0.4 + 0.3 * std::sin(double(x) / 5) * std::cos(double(y) / 7 + double(z) / 4);
        return lo + (hi - lo) * (wave + (x + y > 30 ? 0.2 : 0) + 0.05 * double(random() % 1000) / 1000);
    }, spacing);
}

template <class Use>
void for_each_family(const TreeDesc& tree, int level, const Use& use) {
    const glm::ivec3 n = families_of(tree, level);
    for (int z = 0; z < n.z; ++z)
        for (int y = 0; y < n.y; ++y)
            for (int x = 0; x < n.x; ++x) use(FamilyId{level, {x, y, z}});
}

class SharedFaces : public ::testing::TestWithParam<CoderKind> {};
INSTANTIATE_TEST_SUITE_P(Coders, SharedFaces, ::testing::Values(CoderKind::paper, CoderKind::dense, CoderKind::fast),
                         [](const auto& test) { return std::string(name_of(test.param)); });

TEST_P(SharedFaces, LosslessGivesEveryBitBackForEveryTypeSizeAndSpacing) {
    struct Case {
        Index3 dims;
        glm::dvec3 spacing;
    };
    for (int t = 0; t < kScalarTypes; ++t)
        for (const Case& c : {Case{Index3(1), {1, 1, 1}}, Case{{17, 2, 1}, {1, 1, 1}}, Case{{1, 17, 33}, {1, 1, 1}},
                              Case{{37, 18, 17}, {1, 1, 1}}, Case{{33, 19, 18}, {1, 1.3, 2.5}}, Case{{9, 40, 11}, {1000, 1, 1}}}) {
            const VolumePtr volume = scene(c.dims, ScalarType(t), c.spacing);
            ASSERT_EQ(decoded(encoded(*volume, with_shared_faces(GetParam())), 0), all_of(*volume))
                << name_of(ScalarType(t)) << " " << c.dims.x << " " << c.dims.y << " " << c.dims.z;
        }
}

// Every sample that several families decode comes out of all of them alike, at every level.
void expect_agreement(const WaveletBricks& bricks) {
    const TreeDesc& tree = bricks.index().tree;
    const FamilyCodec codec(tree, *bricks.index().coder);
    std::vector<LevelStore> levels(tree.bricks.levels.size());
    std::size_t compared = 0;
    for (int l = tree.top(); l >= 0; --l) {
        LevelStore& here = levels[std::size_t(l)];
        here = LevelStore(tree, l, tree.bricks.volume.components, true);
        std::size_t i = 0;
        for_each_family(tree, l, [&](FamilyId family) {
            const FamilyPlace place = bricks.index().families[std::size_t(l)][i++];
            const Bytes nothing(64);
            ByteReader in(place.size ? bricks.payload().subspan(std::size_t(place.offset), std::size_t(place.size)) : std::span(nothing));
            FamilyCodec::Planes low;
            if (l < tree.top()) low = levels[std::size_t(l) + 1].read(stored_box(tree, {l + 1, family.index}));
            const Box box = box_of(tree, family);
            FamilyCodec::Planes planes(std::size_t(tree.bricks.volume.components), std::vector<std::int32_t>(box.voxels()));
            codec.decode(family, low, in, planes);
            // What lower neighbours have written already is their upper faces.
            for (int a = 0; a < 3; ++a) {
                if (box.lo[a] == 0) continue;
                Box face = box;
                face.hi[a] = face.lo[a] + 1;
                FamilyCodec::Planes mine = planes;
                FamilyCodec::crop(mine, box, face);
                ASSERT_EQ(here.read(face), mine) << "level " << l << ", family " << family.index.x << " "
                                                 << family.index.y << " " << family.index.z << ", axis " << a;
                compared += face.voxels();
            }
            here.write(box, planes, box);
        });
    }
    EXPECT_GT(compared, 0u);
}

TEST_P(SharedFaces, NeighboursDecodeTheSameFacesAtEveryLevelAndRate) {
    for (ScalarType type : {ScalarType::u8, ScalarType::i16, ScalarType::f32})
        for (glm::dvec3 spacing : {glm::dvec3(1), glm::dvec3(1, 1.2, 2.1)}) {
            const VolumePtr volume = scene({45, 33, 34}, type, spacing);
            EncodeOptions options = with_shared_faces(GetParam());
            expect_agreement(*encoded(*volume, options));
            options.target = Target::psnr;
            for (double psnr : {25.0, 45.0}) {
                options.amount = psnr;
                expect_agreement(*encoded(*volume, options));
            }
        }
}

TEST_P(SharedFaces, BricksKeepTheLayerThatTheirNeighboursBeginWith) {
    const VolumePtr volume = scene({45, 33, 34}, ScalarType::u8, {1, 1, 1});
    EncodeOptions options = with_shared_faces(GetParam());
    options.target = Target::psnr;
    options.amount = 35;
    const auto bricks = encoded(*volume, options);
    const BricksDesc& desc = bricks->desc();
    BrickCache cache(64 << 20);
    const auto samples = [&](BrickId id, int axis, std::int64_t layer) {
        const BrickVoxelsPtr brick = cache.get(bricks, id);
        const Box stored{desc.box_of(id).lo, desc.box_of(id).lo + brick->stored};
        Box part = stored;
        for (int a = 0; a < 3; ++a) part.hi[a] = std::min(part.hi[a], desc.box_of(id).hi[a]);
        part.lo[axis] = layer;
        part.hi[axis] = layer + 1;
        EXPECT_LE(layer, stored.hi[axis] - 1);
        std::vector<std::byte> values(part.voxels() * desc.tree_voxel_bytes());
        copy_box(part, brick->voxels.data(), stored, values.data(), part, desc.tree_voxel_bytes());
        return values;
    };
    for (int l = 1; l < int(desc.levels.size()); ++l)
        for (int axis = 0; axis < 3; ++axis) {
            glm::ivec3 step(0);
            step[axis] = 1;
            const glm::ivec3 n = desc.levels[std::size_t(l)].bricks - step;
            for (int z = 0; z < n.z; ++z)
                for (int y = 0; y < n.y; ++y)
                    for (int x = 0; x < n.x; ++x) {
                        const BrickId here{l, {x, y, z}}, next{l, glm::ivec3(x, y, z) + step};
                        const std::int64_t layer = desc.box_of(next).lo[axis];
                        ASSERT_EQ(samples(here, axis, layer), samples(next, axis, layer));
                    }
        }
    EXPECT_GE(desc.levels.size(), 3u);
}

// Largest difference between what families without details decode at level 0, and the level above
// interpolated linearly; the last sample is continued at the border.
double largest_mismatch(Faces faces, glm::dvec3 spacing) {
    const VolumePtr volume = make_volume({53, 38, 34}, ScalarType::i16, [](auto, auto, auto) { return 0.0; }, spacing);
    EncodeOptions options = with_shared_faces();
    options.faces = faces;
    const TreeDesc tree = plan(volume->desc(), options);
    const auto coder = make_coder(options.coder);
    const FamilyCodec codec(tree, *coder);
    const LevelDesc &fine = tree.bricks.levels[0], &coarse = tree.bricks.levels[1];
    std::mt19937 random(8);
    FamilyCodec::Planes noise(1, std::vector<std::int32_t>(Box::of(coarse.dims).voxels()));
    for (auto& v : noise[0]) v = std::int32_t(random() % 20001) - 10000;
    LevelStore above(tree, 1, 1, true);
    above.write(Box::of(coarse.dims), noise, Box::of(coarse.dims));
    double largest = 0;
    for_each_family(tree, 0, [&](FamilyId family) {
        const Box box = box_of(tree, family);
        FamilyCodec::Planes planes(1, std::vector<std::int32_t>(box.voxels()));
        const Bytes nothing(8);
        ByteReader in(nothing);
        codec.decode(family, above.read(stored_box(tree, {1, family.index})), in, planes);
        std::size_t i = 0;
        for (auto z = box.lo.z; z < box.hi.z; ++z)
            for (auto y = box.lo.y; y < box.hi.y; ++y)
                for (auto x = box.lo.x; x < box.hi.x; ++x, ++i) {
                    double value = 0;
                    for (int corner = 0; corner < 8; ++corner) {
                        double weight = 1;
                        Index3 at(x, y, z);
                        for (int a = 0; a < 3; ++a) {
                            const std::int64_t stride = coarse.stride[a] / fine.stride[a], rest = at[a] % stride;
                            const double f = double(rest) / double(stride);
                            weight *= corner >> a & 1 ? f : 1 - f;
                            at[a] = std::min(at[a] / stride + (corner >> a & 1), coarse.dims[a] - 1);
                        }
                        value += weight * noise[0][std::size_t((at.z * coarse.dims.y + at.y) * coarse.dims.x + at.x)];
                    }
                    largest = std::max(largest, std::abs(value - planes[0][i]));
                }
    });
    return largest;
}

TEST(SharedFaces, AbsentDetailsAreLinearInterpolationAcrossFaces) {
    for (glm::dvec3 spacing : {glm::dvec3(1), glm::dvec3(1, 1, 4), glm::dvec3(3, 1, 1)}) {
        EXPECT_LE(largest_mismatch(Faces::shared, spacing), 1.5);  // half a unit a pass
        EXPECT_GT(largest_mismatch(Faces::block, spacing), 1000);
    }
}

TEST(SharedFaces, ARampIsTheSameFromEveryLevel) {
    // Sizes that stay odd: at the volume's own border a line of even length is mirrored.
    const VolumePtr volume = make_volume({65, 33, 49}, ScalarType::i16, [](auto x, auto y, auto z) {
        return double(3 * x + 5 * y - 7 * z);
    });
    EncodeOptions options = with_shared_faces();
    for (Faces faces : {Faces::shared, Faces::block}) {
        options.faces = faces;
        const auto bricks = encoded(*volume, options);
        double largest = 0;
        for (const auto& level : bricks->index().infos)
            for (const BrickInfo& info : level) largest = std::max(largest, info.max_error);
        if (faces == Faces::shared)
            EXPECT_EQ(largest, 0);
        else
            EXPECT_GT(largest, 1);
    }
}

}  // namespace
}  // namespace voxloom::wavelet
