// The real volumes that are at hand: read, and held against what is known of them.
#if VOXLOOM_WITH_ITK

#include "core/data/value.h"
#include "reader_test_files.h"
#include "series_source.h"
#include "tests/support/volumes.h"

namespace voxloom::testing {
namespace {

namespace fs = std::filesystem;

struct Known {
    const char* name;
    Index3 dims;
    ScalarType type;
    glm::dvec3 spacing;
    double min, max;
};
const Known kKnown[] = {
    {"engine", {256, 256, 128}, ScalarType::u8, {1, 1, 1}, 0, 255},
    {"lobster", {256, 256, 56}, ScalarType::u8, {1, 1, 1.4}, 0, 255},
    {"heptane", {302, 302, 302}, ScalarType::u8, {1, 1, 1}, 0, 255},
    {"tooth", {103, 94, 161}, ScalarType::i16, {1, 1, 1}, 0, 1300},
    {"cranium-ct", {256, 256, 108}, ScalarType::i16, {0.957, 0.957, 1.5}, -1024, 2986},
    {"cthead", {256, 256, 113}, ScalarType::i16, {1, 1, 2}, 0, 3272},
    {"vorticity", {128, 128, 41}, ScalarType::f32, {1, 1, 1}, -0.0002043, 0.0002281},
    {"betagal-cryoem", {100, 100, 100}, ScalarType::f32, {3.54, 3.54, 3.54}, -0.05297, 0.197},
};

TEST(RealFiles, DimsTypeSpacingAndRangeAreTheKnownOnes) {
    VOXLOOM_NEEDS_DATA(data);
    for (const Known& known : kKnown) {
        SCOPED_TRACE(known.name);
        VolumeFilePtr file = open_volume_file(data / (std::string(known.name) + ".nrrd"));
        EXPECT_EQ(file->desc.dims, known.dims);
        EXPECT_EQ(file->desc.type, known.type);
        EXPECT_LT(glm::length(file->desc.spacing() - known.spacing), 1e-3);
        EXPECT_TRUE(file->warnings.empty());
        ValueRange range = value_range(*in_memory(file->volume(0)));
        EXPECT_NEAR(range.min, known.min, 1e-3 * std::abs(known.min) + 1e-9);
        EXPECT_NEAR(range.max, known.max, 1e-3 * std::abs(known.max) + 1e-9);
    }
}

TEST(RealFiles, EveryVolumeOrSeriesOfTheFolderIsDescribed) {
    VOXLOOM_NEEDS_DATA(data);
    int series = 0;
    for (const fs::path& path : files_in(data)) {
        if (path.extension() != ".nrrd") continue;
        SCOPED_TRACE(path.filename().string());
        VolumeFilePtr file = open_volume_file(path);
        series += file->steps > 1;
        EXPECT_GT(file->desc.dense_bytes(), 0u);
    }
    EXPECT_EQ(series, 3);
}

TEST(RealFiles, StepsOfAPackedSeriesAreTheSameInAnyOrder) {
    VOXLOOM_NEEDS_DATA(data);
    SeriesOptions options;
    options.path = data / "fmri-bold-4d.nrrd";
    OpenedSeries opened = open_series(options);
    ASSERT_EQ(opened.series->desc().times.size(), 48u);
    EXPECT_EQ(opened.series->desc().times[3], 6.0);  // every two seconds
    auto step = [&](std::size_t i) { return samples(*std::get<VolumePtr>(opened.series->fetch(i))); };
    const auto last = step(47), first = step(0), middle = step(20), again = step(47);
    EXPECT_EQ(last, again);
    EXPECT_NE(first, middle);
    OpenedSeries other = open_series(options);
    EXPECT_EQ(samples(*std::get<VolumePtr>(other.series->fetch(20))), middle);
    EXPECT_EQ(*std::max_element(first.begin(), first.end()) <= 792, true);
}

TEST(RealFiles, HeadMriOfNiftiIsItsNrrdTurnedToLps) {
    VOXLOOM_NEEDS_DATA(data);
    const fs::path nifti = "/usr/share/mricron/templates/ch2.nii.gz";
    if (!fs::exists(nifti)) GTEST_SKIP() << "mricron-data is not installed";
    VolumeFilePtr file = open_volume_file(nifti);
    EXPECT_EQ(file->desc.dims, Index3(181, 217, 181));
    EXPECT_EQ(file->desc.unit, "mm");
    // The header's RAS rows are (1,0,0,-90) (0,1,0,-125) (0,0,1,-71).
    EXPECT_EQ(file->desc.index_to_world[0], glm::dvec4(-1, 0, 0, 0));
    EXPECT_EQ(file->desc.index_to_world[1], glm::dvec4(0, -1, 0, 0));
    EXPECT_EQ(file->desc.index_to_world[2], glm::dvec4(0, 0, 1, 0));
    EXPECT_EQ(file->desc.index_to_world[3], glm::dvec4(90, 125, -71, 1));
    EXPECT_EQ(samples(*file->volume(0)), samples(data / "mri-ch2.nrrd"));
}

}  // namespace
}  // namespace voxloom::testing

#endif
