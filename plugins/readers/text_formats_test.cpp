// NRRD, MetaImage and NIfTI: what a header says, and what damage does.
#if VOXLOOM_WITH_ITK

#include <fmt/format.h>

#include "reader_test_files.h"
#include "tests/support/volumes.h"
#include "text_header.h"

namespace voxloom::testing {
namespace {

namespace fs = std::filesystem;

template <class T>
std::string nrrd_type() {
    if constexpr (std::is_same_v<T, std::int64_t>) return "int64";
    else if constexpr (std::is_same_v<T, std::uint64_t>) return "uint64";
    else {
        constexpr const char* names[] = {"uint8", "int8", "uint16", "int16",
                                         "uint32", "int32", "float", "double"};
        return names[int(scalar_type_of<T>)];
    }
}

template <class T>
std::string nrrd(const std::string& sizes, const std::string& more, const std::vector<double>& values,
                 bool big_endian = false) {
    auto axes = std::count(sizes.begin(), sizes.end(), ' ') + 1;
    return fmt::format("NRRD0004\n# by hand\ntype: {}\ndimension: {}\nsizes: {}\nendian: {}\n{}\n",
                       nrrd_type<T>(), axes, sizes, big_endian ? "big" : "little", more) +
           bytes_of_values<T>(values, big_endian);
}

template <class T>
class NrrdOfType : public ::testing::Test {};
using AllTypes = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                  std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(NrrdOfType, AllTypes);

TYPED_TEST(NrrdOfType, VoxelsComeBackInBothByteOrdersByRegionAndThroughGzip) {
    TempFolder folder;
    const std::vector<double> values = ramp(7 * 5 * 3);
    for (bool big : {false, true}) {
        write_file(folder.path() / "a.nrrd", nrrd<TypeParam>("7 5 3", "encoding: raw\n", values, big));
        VolumeFilePtr file = open_volume_file(folder.path() / "a.nrrd");
        EXPECT_EQ(file->desc.type, scalar_type_of<TypeParam>);
        VolumePtr volume = file->volume(0);
        EXPECT_TRUE(volume->reads_by_region());
        EXPECT_EQ(samples(*volume), values);
        expect_regions_agree(*volume);

        std::string header = nrrd<TypeParam>("7 5 3", "encoding: gzip\n", {}, big);
        write_file(folder.path() / "b.nrrd", header + gzip(bytes_of_values<TypeParam>(values, big)));
        VolumePtr packed = open_volume_file(folder.path() / "b.nrrd")->volume(0);
        EXPECT_FALSE(packed->reads_by_region());
        EXPECT_EQ(packed->resident_bytes(), 0u);
        EXPECT_EQ(samples(*packed), values);
        EXPECT_EQ(packed->resident_bytes(), packed->desc().dense_bytes());
        EXPECT_NE(packed->data(), nullptr);
        expect_regions_agree(*packed);
    }
}

TEST(Nrrd, SixtyFourBitIntegersBecomeDoublesOrAClearError) {
    TempFolder folder;
    const fs::path path = folder.path() / "wide.nrrd";
    std::vector<double> values = ramp(8);
    values[3] = -0x1p53;
    write_file(path, nrrd<std::int64_t>("2 2 2", "encoding: raw\n", values));
    VolumeFilePtr file = open_volume_file(path);
    EXPECT_EQ(file->desc.type, ScalarType::f64);
    EXPECT_EQ(samples(*file->volume(0)), values);
    values[3] = 0x1p60;
    write_file(path, nrrd<std::int64_t>("2 2 2", "encoding: raw\n", values));
    std::string message = complaint(path);
    EXPECT_NE(message.find("no exact double"), std::string::npos) << message;
}

TEST(Nrrd, TextHexAndBzip2AreReadWhole) {
    TempFolder folder;
    const fs::path path = folder.path() / "text.nrrd";
    write_file(path, nrrd<float>("2 2 1", "encoding: ascii\n", {}) + "1 2.5\n-3 4e2\n");
    EXPECT_EQ(samples(path), (std::vector<double>{1, 2.5, -3, 400}));
    write_file(folder.path() / "hex.nrrd", nrrd<std::uint8_t>("2 2 1", "encoding: hex\n", {}) + "01ff10a0\n");
    EXPECT_EQ(samples(folder.path() / "hex.nrrd"), (std::vector<double>{1, 255, 16, 160}));
}

TEST(Nrrd, SpacingOriginObliqueDirectionsUnitAndNameAreKept) {
    TempFolder folder;
    const fs::path path = folder.path() / "oblique.nrrd";
    const std::string fields =
        "encoding: raw\nspace: left-posterior-superior\nspace directions: (0,2,0) (-3,0,0) (0.5,0,4)\n"
        "space origin: (10,20,30)\nspace units: \"mm\" \"mm\" \"mm\"\ncontent: a small box\n";
    write_file(path, nrrd<std::uint8_t>("3 2 2", fields, ramp(12)));
    const VolumeDesc& desc = open_volume_file(path)->desc;
    const glm::dmat4 expected(0, 2, 0, 0, -3, 0, 0, 0, 0.5, 0, 4, 0, 10, 20, 30, 1);
    for (int c = 0; c < 4; ++c)
        EXPECT_LT(glm::length(desc.index_to_world[c] - expected[c]), 1e-12) << c;
    EXPECT_EQ(desc.unit, "mm");
    EXPECT_EQ(desc.name, "a small box");
}

TEST(Nrrd, RasIsTurnedToLps) {
    TempFolder folder;
    const fs::path path = folder.path() / "ras.nrrd";
    write_file(path, nrrd<std::uint8_t>("2 2 2",
               "encoding: raw\nspace: right-anterior-superior\n"
               "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (5,6,7)\n", ramp(8)));
    const glm::dmat4 m = open_volume_file(path)->desc.index_to_world;
    EXPECT_EQ(m[0], glm::dvec4(-1, 0, 0, 0));
    EXPECT_EQ(m[1], glm::dvec4(0, -1, 0, 0));
    EXPECT_EQ(m[2], glm::dvec4(0, 0, 1, 0));
    EXPECT_EQ(m[3], glm::dvec4(-5, -6, 7, 1));
}

TEST(Nrrd, ColorsAndVectorsAreComponentsWhereverTheirAxisStands) {
    TempFolder folder;
    const std::vector<double> values = ramp(3 * 2 * 2 * 2);
    const fs::path first = folder.path() / "first.nrrd", last = folder.path() / "last.nrrd";
    write_file(first, nrrd<std::uint8_t>("3 2 2 2", "encoding: raw\nkinds: RGB-color domain domain domain\n", values));
    VolumeFilePtr file = open_volume_file(first);
    EXPECT_EQ(file->desc.components, 3);
    EXPECT_TRUE(file->desc.color);
    EXPECT_EQ(file->desc.dims, Index3(2));
    EXPECT_EQ(samples(*file->volume(0)), values);
    EXPECT_TRUE(file->volume(0)->reads_by_region());

    std::vector<double> planar(values.size());
    for (std::size_t i = 0; i < 8; ++i)
        for (std::size_t c = 0; c < 3; ++c) planar[c * 8 + i] = values[i * 3 + c];
    write_file(last, nrrd<std::uint8_t>("2 2 2 3", "encoding: raw\nkinds: domain domain domain vector\n", planar));
    file = open_volume_file(last);
    EXPECT_EQ(file->desc.components, 3);
    EXPECT_FALSE(file->desc.color);
    EXPECT_EQ(samples(*file->volume(0)), values);
}

TEST(Nrrd, DetachedDataIsFoundNamedAndReadByRegionFromSeveralFiles) {
    TempFolder folder;
    const std::vector<double> values = ramp(4 * 3 * 6);
    const std::string bytes = bytes_of_values<std::uint16_t>(values);
    const std::string start = "NRRD0004\ntype: uint16\ndimension: 3\nsizes: 4 3 6\nendian: little\nencoding: raw\n";
    write_file(folder.path() / "all.raw", "skip" + bytes);
    write_file(folder.path() / "one.nhdr", start + "byte skip: 4\ndata file: all.raw\n");
    EXPECT_EQ(samples(folder.path() / "one.nhdr"), values);
    auto files = open_volume_file(folder.path() / "one.nhdr")->files;
    EXPECT_NE(std::find(files.begin(), files.end(), folder.path() / "all.raw"), files.end());

    std::string list = "data file: LIST\n";
    for (int z = 0; z < 6; ++z) {
        const std::string name = fmt::format("part{:02}.raw", z);
        write_file(folder.path() / name, std::string_view(bytes).substr(std::size_t(z) * 24, 24));
        list += name + "\n";
    }
    write_file(folder.path() / "list.nhdr", start + list);
    write_file(folder.path() / "pattern.nhdr", start + "data file: part%02d.raw 0 5 1\n");
    for (const char* name : {"list.nhdr", "pattern.nhdr"}) {
        VolumePtr volume = open_volume_file(folder.path() / name)->volume(0);
        EXPECT_TRUE(volume->reads_by_region());
        EXPECT_EQ(samples(*volume), values) << name;
        expect_regions_agree(*volume);
        EXPECT_EQ(open_volume_file(folder.path() / name)->files.size(), 7u);
    }
    fs::remove(folder.path() / "part01.raw");
    std::string message = complaint(folder.path() / "list.nhdr");
    EXPECT_NE(message.find("part01.raw"), std::string::npos) << message;
}

TEST(Nrrd, PlanesLinesAndSingleVoxelsAreVolumes) {
    TempFolder folder;
    const fs::path path = folder.path() / "flat.nrrd";
    write_file(path, nrrd<std::uint8_t>("5 3", "encoding: raw\nspacings: 2 0.5\n", ramp(15)));
    EXPECT_EQ(open_volume_file(path)->desc.dims, Index3(5, 3, 1));
    EXPECT_EQ(open_volume_file(path)->desc.spacing(), glm::dvec3(2, 0.5, 1));
    EXPECT_EQ(samples(path), ramp(15));
    write_file(path, nrrd<std::uint8_t>("1 1 1", "encoding: raw\n", {42}));
    EXPECT_EQ(samples(path), std::vector<double>{42});
}

TEST(Nrrd, NanAndInfinityStayInTheVoxels) {
    TempFolder folder;
    const fs::path path = folder.path() / "nan.nrrd";
    write_file(path, nrrd<float>("2 1 1", "encoding: raw\n", {NAN, -INFINITY}, true));
    auto v = samples(path);
    EXPECT_TRUE(std::isnan(v[0]));
    EXPECT_EQ(v[1], -INFINITY);
}

TEST(Nrrd, CutFilesAreNoticedWhateverTheEncoding) {
    TempFolder folder;
    std::vector<double> values(9 * 8 * 7);
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = double(i * i % 30011);
    write_file(folder.path() / "raw.nrrd", nrrd<std::int16_t>("9 8 7", "encoding: raw\n", values));
    write_file(folder.path() / "gzip.nrrd", nrrd<std::int16_t>("9 8 7", "encoding: gzip\n", {}) +
                                            gzip(bytes_of_values<std::int16_t>(values)));
    for (const char* name : {"raw.nrrd", "gzip.nrrd"}) {
        SCOPED_TRACE(name);
        expect_cuts_are_noticed(folder.path() / name);
    }
    // Of a text only the last number can lose digits unnoticed: here it has one.
    values.back() = 1;
    std::string text;
    for (double v : values) text += fmt::format("{} ", v);
    write_file(folder.path() / "text.nrrd", nrrd<std::int16_t>("9 8 7", "encoding: text\n", {}) + text);
    expect_cuts_are_noticed(folder.path() / "text.nrrd");
}

TEST(Nrrd, DamagedCompressedDataIsAnError) {
    TempFolder folder;
    const fs::path path = folder.path() / "damaged.nrrd";
    std::string packed = gzip(bytes_of_values<float>(ramp(1000, 0.37)));
    packed[packed.size() / 2] ^= 0x55;
    write_file(path, nrrd<float>("10 10 10", "encoding: gzip\n", {}) + packed);
    std::string message = complaint(path);
    EXPECT_NE(message.find("damaged"), std::string::npos) << message;
    expect_sentence(message, path);
}

TEST(Nrrd, MembersOfAGzipStreamFollowOneAnother) {
    TempFolder folder;
    const fs::path path = folder.path() / "members.nrrd";
    const std::string bytes = bytes_of_values<std::uint8_t>(ramp(300));
    write_file(path, nrrd<std::uint8_t>("300 1 1", "encoding: gzip\n", {}) +
                     gzip(bytes.substr(0, 100)) + gzip(bytes.substr(100)));
    EXPECT_EQ(samples(path), ramp(300));
}

TEST(Nrrd, SizesThatAreNoneAreNamed) {
    TempFolder folder;
    const fs::path path = folder.path() / "odd.nrrd";
    for (const char* sizes : {"4 -4 4", "4 0 4", "4 4.5 4", "4 x 4", "18446744073709551615 1 1", "4000000000 4000000000 4000000000"}) {
        write_file(path, nrrd<double>(sizes, "encoding: raw\n", ramp(8)));
        EXPECT_NE(complaint(path).find(fmt::format("sizes: {}", sizes)), std::string::npos) << complaint(path);
    }
}

TEST(Nrrd, SizesThatOverflowOrPromiseMoreThanThereIsAreRefusedWithoutReading) {
    TempFolder folder;
    const fs::path path = folder.path() / "huge.nrrd";
    for (const char* sizes : {"4000000000 4000000000 4000000000", "100000 100000 100000",
                              "9223372036854775807 2 2", "18446744073709551615 1 1"})
        for (const char* encoding : {"raw", "gzip", "ascii"}) {
            write_file(path, nrrd<double>(sizes, fmt::format("encoding: {}\n", encoding), ramp(8)));
            EXPECT_THROW(open_volume_file(path), Error) << sizes << " " << encoding;
            expect_sentence(complaint(path), path);
        }
}

TEST(Nrrd, WrongHeadersAreOneSentence) {
    TempFolder folder;
    const fs::path path = folder.path() / "wrong.nrrd";
    for (const char* text : {"hello", "NRRD0004\n", "NRRD0004\ntype: uint8\n\n",
                             "NRRD0004\ntype: cube\ndimension: 3\nsizes: 1 1 1\nencoding: raw\n\nabc",
                             "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 1 1\nencoding: raw\n\nabc",
                             "NRRD0004\ntype: uint8\ndimension: 3\nsizes: -1 1 1\nencoding: raw\n\nabc",
                             "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 1 1 1\nencoding: lzma\n\nabc",
                             "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 1 1 1\nencoding: raw\nno field\n\nabc"}) {
        write_file(path, text);
        std::string message = complaint(path);
        EXPECT_FALSE(message.empty()) << text;
        expect_sentence(message, path);
    }
}

TEST(Nrrd, SeveralTimesAreForSeries) {
    TempFolder folder;
    const fs::path path = folder.path() / "four.nrrd";
    write_file(path, nrrd<std::uint8_t>("2 2 2 3", "encoding: raw\nspacings: 1 1 2 0.25\n"
               "units: \"mm\" \"mm\" \"mm\" \"s\"\nkinds: domain domain domain time\n", ramp(24)));
    VolumeFilePtr file = open_volume_file(path);
    EXPECT_EQ(file->steps, 3);
    EXPECT_EQ(file->times, (std::vector<double>{0, 0.25, 0.5}));
    EXPECT_EQ(file->time_unit, "s");
    EXPECT_EQ(file->desc.unit, "mm");
    for (std::int64_t t = 0; t < 3; ++t) {
        VolumePtr step = file->volume(t);
        EXPECT_TRUE(step->reads_by_region());
        const std::vector<double> all = ramp(24);
        EXPECT_EQ(samples(*step), std::vector<double>(all.begin() + t * 8, all.begin() + t * 8 + 8));
    }
}

// --- MetaImage -----------------------------------------------------------------------------------

std::string meta(const std::string& dims, const std::string& more, const std::string& data) {
    return fmt::format("ObjectType = Image\nNDims = 3\nDimSize = {}\nElementType = MET_SHORT\n{}"
                       "ElementDataFile = {}\n", dims, more, data);
}

TEST(MetaImage, LocalDetachedAndCompressedGiveTheSameVoxels) {
    TempFolder folder;
    const std::vector<double> values = ramp(5 * 4 * 3, -7);
    const std::string little = bytes_of_values<std::int16_t>(values), big = bytes_of_values<std::int16_t>(values, true);
    const std::string place = "ElementSpacing = 1 2 3\nOffset = 4 5 6\n";
    write_file(folder.path() / "local.mha", meta("5 4 3", place + "BinaryData = True\n", "LOCAL") + little);
    write_file(folder.path() / "big.mha", meta("5 4 3", place + "BinaryData = True\nBinaryDataByteOrderMSB = True\n", "LOCAL") + big);
    write_file(folder.path() / "data.raw", "header" + little);
    write_file(folder.path() / "detached.mhd", meta("5 4 3", place + "BinaryData = True\nHeaderSize = 6\n", "data.raw"));
    const std::string packed = gzip(little, 15);
    write_file(folder.path() / "packed.mha", meta("5 4 3", place + fmt::format(
        "BinaryData = True\nCompressedData = True\nCompressedDataSize = {}\n", packed.size()), "LOCAL") + packed);
    write_file(folder.path() / "end.raw", "anything before" + little);
    write_file(folder.path() / "end.mhd", meta("5 4 3", place + "BinaryData = True\nHeaderSize = -1\n", "end.raw"));
    for (const char* name : {"local.mha", "big.mha", "detached.mhd", "packed.mha", "end.mhd"}) {
        SCOPED_TRACE(name);
        VolumeFilePtr file = open_volume_file(folder.path() / name);
        EXPECT_EQ(file->desc.dims, Index3(5, 4, 3));
        EXPECT_EQ(file->desc.type, ScalarType::i16);
        EXPECT_EQ(file->desc.spacing(), glm::dvec3(1, 2, 3));
        EXPECT_EQ(file->desc.origin(), glm::dvec3(4, 5, 6));
        EXPECT_EQ(file->desc.unit, "mm");
        EXPECT_EQ(samples(*file->volume(0)), values);
        expect_regions_agree(*file->volume(0));
    }
    EXPECT_TRUE(open_volume_file(folder.path() / "detached.mhd")->volume(0)->reads_by_region());
    EXPECT_EQ(open_volume_file(folder.path() / "detached.mhd")->files.size(), 2u);
    fs::remove(folder.path() / "data.raw");
    EXPECT_NE(complaint(folder.path() / "detached.mhd").find("data.raw"), std::string::npos);
}

TEST(MetaImage, CutFilesAreNoticed) {
    TempFolder folder;
    const std::string bytes = bytes_of_values<std::int16_t>(ramp(9 * 8 * 7, 3));
    write_file(folder.path() / "raw.mha", meta("9 8 7", "BinaryData = True\n", "LOCAL") + bytes);
    const std::string packed = gzip(bytes, 15);
    write_file(folder.path() / "packed.mha", meta("9 8 7", fmt::format(
        "BinaryData = True\nCompressedData = True\nCompressedDataSize = {}\n", packed.size()), "LOCAL") + packed);
    expect_cuts_are_noticed(folder.path() / "raw.mha");
    expect_cuts_are_noticed(folder.path() / "packed.mha");
}

TEST(MetaImage, WrongHeadersAreOneSentence) {
    TempFolder folder;
    const fs::path path = folder.path() / "wrong.mha";
    for (const std::string& text : {std::string("hello"), std::string("ObjectType = Image\n"),
                                    meta("5 4", "", "LOCAL"), meta("-5 4 3", "", "LOCAL"),
                                    meta("5000000000 4000000000 3000000000", "", "LOCAL"),
                                    std::string("NDims = 30\nDimSize = 1\nElementType = MET_SHORT\nElementDataFile = LOCAL\n"),
                                    std::string("ObjectType = Image\nNDims = 3\nDimSize = 2 2 2\nElementType = MET_CUBE\nElementDataFile = LOCAL\nabcdefgh")}) {
        write_file(path, text);
        std::string message = complaint(path);
        EXPECT_FALSE(message.empty()) << text;
        expect_sentence(message, path);
    }
}

// --- NIfTI ---------------------------------------------------------------------------------------

struct NiftiFields {
    std::vector<int> dims{3, 5, 4, 3, 1, 1, 1, 1};
    int type = 4, bits = 16;
    float slope = 0, inter = 0;
    const char* magic = "n+1";
    float offset = 352;
    bool big = false;
};

std::string nifti_header(const NiftiFields& f) {
    std::string h(352, '\0');
    auto put = [&](std::size_t at, const std::string& bytes) { h.replace(at, bytes.size(), bytes); };
    auto shorts = [&](std::size_t at, std::vector<double> v) { put(at, bytes_of_values<std::int16_t>(v, f.big)); };
    auto floats = [&](std::size_t at, std::vector<double> v) { put(at, bytes_of_values<float>(v, f.big)); };
    put(0, bytes_of_values<std::int32_t>({348}, f.big));
    shorts(40, std::vector<double>(f.dims.begin(), f.dims.end()));
    shorts(70, {double(f.type), double(f.bits)});
    floats(76, {1, 1, 2, 3, 0.5, 1, 1, 1});
    floats(108, {f.offset, f.slope, f.inter});
    h[123] = 2 | 8;  // mm, s
    shorts(252, {0, 1});  // sform
    floats(280, {1, 0, 0, 10, 0, 2, 0, 20, 0, 0, 3, 30});
    put(344, f.magic);
    return h;
}

TEST(Nifti, PlainPackedPairedAndBigEndianGiveTheSameVoxels) {
    TempFolder folder;
    const std::vector<double> values = ramp(60, -3);
    const std::string bytes = bytes_of_values<std::int16_t>(values);
    NiftiFields f, big, pair;
    big.big = true;
    pair.magic = "ni1";
    pair.offset = 0;
    write_file(folder.path() / "plain.nii", nifti_header(f) + bytes);
    write_file(folder.path() / "packed.nii.gz", gzip(nifti_header(f) + bytes));
    write_file(folder.path() / "big.nii", nifti_header(big) + bytes_of_values<std::int16_t>(values, true));
    write_file(folder.path() / "pair.hdr", nifti_header(pair));
    write_file(folder.path() / "pair.img", bytes);
    for (const char* name : {"plain.nii", "packed.nii.gz", "big.nii", "pair.hdr", "pair.img"}) {
        SCOPED_TRACE(name);
        VolumeFilePtr file = open_volume_file(folder.path() / name);
        EXPECT_EQ(file->desc.dims, Index3(5, 4, 3));
        EXPECT_EQ(file->desc.type, ScalarType::i16);
        EXPECT_EQ(file->desc.unit, "mm");
        EXPECT_EQ(file->desc.name, std::string(name).substr(0, std::string(name).find('.')));
        // RAS turned to LPS
        EXPECT_LT(glm::length(file->desc.index_to_world[1] - glm::dvec4(0, -2, 0, 0)), 1e-6);
        EXPECT_LT(glm::length(file->desc.index_to_world[3] - glm::dvec4(-10, -20, 30, 1)), 1e-6);
        EXPECT_EQ(samples(*file->volume(0)), values);
        expect_regions_agree(*file->volume(0));
    }
    EXPECT_EQ(open_volume_file(folder.path() / "pair.hdr")->files.size(), 2u);
    fs::remove(folder.path() / "pair.img");
    EXPECT_NE(complaint(folder.path() / "pair.hdr").find("pair.img"), std::string::npos);
}

TEST(Nifti, ScaledValuesAreScaled) {
    TempFolder folder;
    NiftiFields f;
    f.slope = 0.5;
    f.inter = 100;
    write_file(folder.path() / "scaled.nii", nifti_header(f) + bytes_of_values<std::int16_t>(ramp(60)));
    VolumeFilePtr file = open_volume_file(folder.path() / "scaled.nii");
    EXPECT_TRUE(is_float(file->desc.type));
    auto v = samples(*file->volume(0));
    for (std::size_t i = 0; i < v.size(); ++i) EXPECT_EQ(v[i], 100 + 0.5 * ramp(60)[i]);
}

TEST(Nifti, TimesComeFromTheFourthAxis) {
    TempFolder folder;
    NiftiFields f;
    f.dims = {4, 5, 4, 3, 6, 1, 1, 1};
    const std::vector<double> values = ramp(360);
    const std::string all = nifti_header(f) + bytes_of_values<std::int16_t>(values);
    write_file(folder.path() / "t.nii", all);
    write_file(folder.path() / "t.nii.gz", gzip(all));
    for (const char* name : {"t.nii", "t.nii.gz"}) {
        VolumeFilePtr file = open_volume_file(folder.path() / name);
        ASSERT_EQ(file->steps, 6);
        EXPECT_EQ(file->times[2], 1.0);
        EXPECT_EQ(file->time_unit, "s");
        for (std::int64_t t : {5, 0, 3, 4, 1})
            EXPECT_EQ(samples(*file->volume(t)),
                      std::vector<double>(values.begin() + t * 60, values.begin() + t * 60 + 60));
    }
}

TEST(Nifti, CutFilesAndWrongHeadersAreNoticed) {
    TempFolder folder;
    NiftiFields f;
    f.dims = {3, 9, 8, 7, 1, 1, 1, 1};
    const std::string all = nifti_header(f) + bytes_of_values<std::int16_t>(ramp(504, 5));
    write_file(folder.path() / "raw.nii", all);
    write_file(folder.path() / "packed.nii.gz", gzip(all));
    f.slope = 2;
    write_file(folder.path() / "scaled.nii", nifti_header(f) + bytes_of_values<std::int16_t>(ramp(504, 5)));
    write_file(folder.path() / "scaled2.nii.gz", gzip(nifti_header(f) + bytes_of_values<std::int16_t>(ramp(504, 5))));
    for (const char* name : {"raw.nii", "packed.nii.gz", "scaled.nii", "scaled2.nii.gz"}) {
        SCOPED_TRACE(name);
        expect_cuts_are_noticed(folder.path() / name);
    }
    const fs::path path = folder.path() / "wrong.nii";
    std::vector<NiftiFields> wrong(4);
    wrong[0].offset = -5;
    wrong[1].type = 32;  // complex
    wrong[1].bits = 64;
    wrong[2].dims = {3, 32767, 32767, 32767, 1, 1, 1, 1};
    wrong[3].dims = {3, -5, 4, 3, 1, 1, 1, 1};
    for (std::size_t i = 0; i < wrong.size(); ++i) {
        write_file(path, nifti_header(wrong[i]) + std::string(200, 'x'));
        std::string message = complaint(path);
        EXPECT_FALSE(message.empty()) << i;
        expect_sentence(message, path);
    }
}

// --- what is known without a library --------------------------------------------------------------

TEST(OpenFile, WhatIsNotThereEmptyOrUnknownIsSaidPlainly) {
    TempFolder folder;
    EXPECT_NE(complaint(folder.path() / "none.nrrd").find("is not there"), std::string::npos);
    write_file(folder.path() / "empty.nrrd", "");
    EXPECT_NE(complaint(folder.path() / "empty.nrrd").find("is empty"), std::string::npos);
    write_file(folder.path() / "what.xyz", "some text");
    EXPECT_NE(complaint(folder.path() / "what.xyz").find("what.xyz.yaml"), std::string::npos);
    fs::create_directory(folder.path() / "bare");
    EXPECT_NE(complaint(folder.path() / "bare").find("without images"), std::string::npos);
}

TEST(OpenFile, AChangedFileIsReadAnew) {
    TempFolder folder;
    const fs::path path = folder.path() / "a.nrrd";
    write_file(path, nrrd<std::uint8_t>("2 2 2", "encoding: raw\n", ramp(8)));
    VolumeFilePtr before = open_volume_file(path);
    EXPECT_EQ(open_volume_file(path), before);
    write_file(path, nrrd<std::uint8_t>("3 2 2", "encoding: raw\n", ramp(12)));
    EXPECT_EQ(open_volume_file(path)->desc.dims, Index3(3, 2, 2));
}

}  // namespace
}  // namespace voxloom::testing

#endif
