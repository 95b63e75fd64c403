// DICOM, TIFF, HDF5 and raw voxels with a description.
#include <fmt/format.h>

#include "raw_sidecar.h"
#include "reader_test_files.h"
#include "tests/support/volumes.h"

#if VOXLOOM_WITH_HDF5
#include <hdf5.h>
#endif
#if VOXLOOM_WITH_ITK
#include <gdcmTrace.h>
#include <itkGDCMImageIO.h>
#include <itkMetaDataObject.h>
#include <itkTIFFImageIO.h>
#endif

namespace voxloom::testing {
namespace {

namespace fs = std::filesystem;

// --- raw ------------------------------------------------------------------------------------------

TEST(Raw, EveryKeyIsKeptWhicheverOfTheTwoFilesIsNamed) {
    TempFolder folder;
    const std::vector<double> values = ramp(3 * 2 * 2 * 3);
    write_file(folder.path() / "a.raw", "12345" + bytes_of_values<std::uint16_t>(values, true));
    write_file(folder.path() / "a.raw.yaml",
               "dims: [3, 2, 2]\ntype: u16\nendianness: big\ncomponents: 3\ncolor: true\n"
               "spacing: [1, 2, 3.5]\norigin: [4, 5, 6]\ndirection: [0, 1, 0, -1, 0, 0, 0, 0, 1]\n"
               "unit: um\nname: spot\nsignificant_bits: 12\noffset: 5\ncompression: none\n");
    for (const char* name : {"a.raw", "a.raw.yaml"}) {
        VolumeFilePtr file = open_volume_file(folder.path() / name);
        const VolumeDesc& desc = file->desc;
        EXPECT_EQ(desc.dims, Index3(3, 2, 2));
        EXPECT_EQ(desc.type, ScalarType::u16);
        EXPECT_EQ(desc.components, 3);
        EXPECT_TRUE(desc.color);
        EXPECT_EQ(desc.spacing(), glm::dvec3(1, 2, 3.5));
        EXPECT_EQ(desc.origin(), glm::dvec3(4, 5, 6));
        EXPECT_EQ(desc.index_to_world[1], glm::dvec4(-2, 0, 0, 0));
        EXPECT_EQ(desc.unit, "um");
        EXPECT_EQ(desc.name, "spot");
        EXPECT_EQ(desc.significant_bits, 12);
        EXPECT_EQ(file->files.size(), 2u);
        VolumePtr volume = file->volume(0);
        EXPECT_TRUE(volume->reads_by_region());
        EXPECT_EQ(samples(*volume), values);
        expect_regions_agree(*volume);
    }
}

TEST(Raw, FourDimsAreASeriesAndGzipUnpacksToTheSame) {
    TempFolder folder;
    const std::vector<double> values = ramp(4 * 3 * 2 * 5, 0.5);
    const std::string bytes = bytes_of_values<float>(values);
    const std::string yaml = "dims: [4, 3, 2, 5]\ntype: f32\nendianness: little\ntimes: [0, 1, 2, 4, 8]\ntime_unit: h\n";
    write_file(folder.path() / "plain.raw", bytes);
    write_file(folder.path() / "plain.raw.yaml", yaml);
    write_file(folder.path() / "packed.raw", gzip("ab" + bytes));
    write_file(folder.path() / "packed.raw.yaml", yaml + "compression: gzip\noffset: 2\n");
    for (const char* name : {"plain.raw", "packed.raw"}) {
        VolumeFilePtr file = open_volume_file(folder.path() / name);
        EXPECT_EQ(file->times, (std::vector<double>{0, 1, 2, 4, 8}));
        EXPECT_EQ(file->time_unit, "h");
        for (std::int64_t t : {4, 0, 2, 1, 4})
            EXPECT_EQ(samples(*file->volume(t)),
                      std::vector<double>(values.begin() + t * 24, values.begin() + t * 24 + 24));
    }
}

TEST(Raw, SizesMustFitTheFileExactly) {
    TempFolder folder;
    write_file(folder.path() / "a.raw", std::string(24, 'x'));
    write_file(folder.path() / "a.raw.yaml", "dims: [4, 3, 2]\ntype: u8\n");
    EXPECT_EQ(complaint(folder.path() / "a.raw"), "");
    write_file(folder.path() / "a.raw", std::string(23, 'x'));
    EXPECT_NE(complaint(folder.path() / "a.raw").find("cut short"), std::string::npos);
    write_file(folder.path() / "a.raw", std::string(25, 'x'));
    EXPECT_NE(complaint(folder.path() / "a.raw").find("1 more than"), std::string::npos);
    write_file(folder.path() / "a.raw", gzip(std::string(25, 'x')));
    write_file(folder.path() / "a.raw.yaml", "dims: [4, 3, 2]\ntype: u8\ncompression: gzip\n");
    EXPECT_NE(complaint(folder.path() / "a.raw").find("more bytes"), std::string::npos);
    write_file(folder.path() / "a.raw.yaml", "dims: [4, 3, 3]\ntype: u8\ncompression: gzip\n");
    EXPECT_NE(complaint(folder.path() / "a.raw").find("cut short"), std::string::npos);
}

TEST(Raw, AnEmptyVolumeIsLegal) {
    TempFolder folder;
    write_file(folder.path() / "a.raw.yaml", "dims: [4, 0, 2]\ntype: u8\nfile: none.bin\n");
    write_file(folder.path() / "none.bin", "");
    EXPECT_EQ(samples(folder.path() / "a.raw.yaml").size(), 0u);
}

TEST(Raw, DescriptionsThatAreWrongSayWhereAndWhat) {
    const std::pair<const char*, const char*> wrong[] = {
        {"dims: [1, 1, 1]\ntpye: u8\n", "a.raw.yaml:2: unknown key 'tpye'; did you mean 'type'?"},
        {"dims: [1, 1, 1]\n", "type is missing"},
        {"type: u8\n", "dims is missing"},
        {"dims: [1, 1, 1]\ntype: u61\n", "did you mean 'u16'?"},
        {"dims: [1, 1, 1]\ntype: u16\n", "endianness is missing"},
        {"dims: [1, 1, 1]\ntype: u16\nendianness: middle\n", "not one of little, big"},
        {"dims: [1, -1, 1]\ntype: u8\n", "whole number"},
        {"dims: [1, 1.5, 1]\ntype: u8\n", "whole number"},
        {"dims: 7\ntype: u8\n", "must be a list"},
        {"dims: [1000000000, 1000000000, 1000000000]\ntype: u8\n", "do not fit in 63 bits"},
        {"dims: [1000000, 1000000, 100000, 1000000]\ntype: u8\n", "63 bits"},
        {"dims: [1, 1, 1]\ntype: u8\ntype: u8\n", "stands twice"},
        {"dims: [1, 1, 1]\ntype: u8\ncomponents: 5\n", "from 1 to 4"},
        {"dims: [1, 1, 1]\ntype: u8\ncolor: true\n", "3 or 4 components"},
        {"dims: [1, 1, 1]\ntype: u8\nspacing: [1, 1]\n", "3 numbers"},
        {"dims: [1, 1, 1]\ntype: u8\nspacing: [1, .nan, 1]\n", "finite"},
        {"dims: [1, 1, 1, 2]\ntype: u8\ntimes: [1, 1]\n", "must increase"},
        {"dims: [1, 1, 1]\ntype: u8\noffset: -1\n", "whole number"},
        {"dims: [1, 1, 1\n", "not YAML"},
        {"- 1\n", "describes no raw voxels"},
        {"", "describes no raw voxels"},
    };
    for (const auto& [yaml, part] : wrong) {
        try {
            parse_raw_sidecar(yaml, "a.raw.yaml");
            ADD_FAILURE() << yaml;
        } catch (const Error& e) {
            EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
            EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
        }
    }
}

TEST(Raw, VoxelsBeyondFourGibibytesAreReachedWithoutReadingTheRest) {
    TempFolder folder;
    const fs::path path = folder.path() / "large.raw";
    write_file(path, "");
    fs::resize_file(path, std::uint64_t(5) << 30);  // a hole: takes no room on disk
    {
        std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
        file.seekp(std::streamoff((std::uint64_t(5) << 30) - 2));
        file.write("\x11\x22", 2);
    }
    write_file(folder.path() / "large.raw.yaml", "dims: [1024, 1024, 2560]\ntype: u16\nendianness: big\n");
    VolumePtr volume = open_volume_file(path)->volume(0);
    EXPECT_EQ(voxel(*volume, {1023, 1023, 2559}), 0x1122);
    EXPECT_EQ(voxel(*volume, {1022, 1023, 2559}), 0);
}

TEST(NaturalOrder, NumbersCountAsNumbers) {
    EXPECT_TRUE(natural_less("slice2", "slice10"));
    EXPECT_TRUE(natural_less("slice02", "slice10"));
    EXPECT_FALSE(natural_less("slice10", "slice2"));
    EXPECT_TRUE(natural_less("a", "b"));
    EXPECT_TRUE(natural_less("a9z1", "a10a0"));
    EXPECT_TRUE(natural_less("a01", "a1") != natural_less("a1", "a01"));
    EXPECT_FALSE(natural_less("x1", "x1"));
}

// --- HDF5 -----------------------------------------------------------------------------------------

#if VOXLOOM_WITH_HDF5

struct H5 {
    hid_t file;
    explicit H5(const fs::path& path) : file(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT)) {}
    ~H5() { H5Fclose(file); }
    template <class T>
    void dataset(const char* name, std::vector<hsize_t> dims, hid_t stored, hid_t memory,
                 const std::vector<double>& values, std::vector<hsize_t> chunk = {},
                 std::vector<double> element_size = {}) {
        hid_t space = H5Screate_simple(int(dims.size()), dims.data(), nullptr);
        hid_t create = H5Pcreate(H5P_DATASET_CREATE);
        if (!chunk.empty()) {
            H5Pset_chunk(create, int(chunk.size()), chunk.data());
            H5Pset_deflate(create, 6);
        }
        hid_t set = H5Dcreate2(file, name, stored, space, H5P_DEFAULT, create, H5P_DEFAULT);
        std::vector<T> data(values.begin(), values.end());
        H5Dwrite(set, memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, data.data());
        if (!element_size.empty()) {
            hsize_t n = element_size.size();
            hid_t s = H5Screate_simple(1, &n, nullptr);
            hid_t a = H5Acreate2(set, "element_size_um", H5T_IEEE_F64LE, s, H5P_DEFAULT, H5P_DEFAULT);
            H5Awrite(a, H5T_NATIVE_DOUBLE, element_size.data());
            H5Aclose(a);
            H5Sclose(s);
        }
        H5Dclose(set);
        H5Pclose(create);
        H5Sclose(space);
    }
};

TEST(Hdf5, DatasetsAreReadByRegionWithTheirSpacing) {
    TempFolder folder;
    const fs::path path = folder.path() / "a.h5";
    const std::vector<double> values = ramp(7 * 5 * 4);
    {
        H5 h5(path);
        h5.dataset<std::uint16_t>("raw", {4, 5, 7}, H5T_STD_U16BE, H5T_NATIVE_UINT16, values, {2, 3, 3}, {3, 2, 1});
    }
    VolumeFilePtr file = open_volume_file(path);
    EXPECT_EQ(file->desc.dims, Index3(7, 5, 4));
    EXPECT_EQ(file->desc.type, ScalarType::u16);
    EXPECT_EQ(file->desc.spacing(), glm::dvec3(1, 2, 3));
    EXPECT_EQ(file->desc.unit, "um");
    EXPECT_EQ(file->desc.name, "raw");
    VolumePtr volume = file->volume(0);
    EXPECT_TRUE(volume->reads_by_region());
    EXPECT_EQ(samples(*volume), values);
    expect_regions_agree(*volume);
}

TEST(Hdf5, TypesComponentsTimeAndChoiceOfDataset) {
    TempFolder folder;
    const fs::path path = folder.path() / "a.h5";
    const std::vector<double> values = ramp(2 * 3 * 4 * 3);
    {
        H5 h5(path);
        h5.dataset<double>("f64", {2, 3, 12}, H5T_IEEE_F64BE, H5T_NATIVE_DOUBLE, values);
        h5.dataset<double>("vectors", {2, 3, 4, 3}, H5T_IEEE_F32LE, H5T_NATIVE_DOUBLE, values);
        h5.dataset<double>("wide", {2, 3, 12}, H5T_STD_I64LE, H5T_NATIVE_DOUBLE, values);
    }
    std::string message = complaint(path);
    EXPECT_NE(message.find("set 'dataset'"), std::string::npos) << message;
    EXPECT_NE(message.find("/vectors (2 x 3 x 4 x 3)"), std::string::npos) << message;
    ReadOptions options;
    options.dataset = "f46";
    EXPECT_NE(complaint(path, nullptr, options).find("did you mean '/f64'?"), std::string::npos);
    options.dataset = "f64";
    EXPECT_EQ(samples(*open_volume_file(path, options)->volume(0)), values);
    options.dataset = "/vectors";
    EXPECT_EQ(open_volume_file(path, options)->desc.components, 3);
    EXPECT_EQ(open_volume_file(path, options)->desc.dims, Index3(4, 3, 2));
    EXPECT_EQ(samples(*open_volume_file(path, options)->volume(0)), values);
    options.time_axis = 0;
    VolumeFilePtr series = open_volume_file(path, options);
    EXPECT_EQ(series->steps, 2);
    EXPECT_EQ(series->desc.dims, Index3(3, 4, 3));
    EXPECT_EQ(samples(*series->volume(1)), std::vector<double>(values.begin() + 36, values.end()));
    options = {};
    options.dataset = "wide";
    EXPECT_EQ(open_volume_file(path, options)->desc.type, ScalarType::f64);
    EXPECT_EQ(samples(*open_volume_file(path, options)->volume(0)), values);
}

TEST(Hdf5, CutFilesAreNoticed) {
    TempFolder folder;
    {
        H5 h5(folder.path() / "plain.h5");
        h5.dataset<double>("v", {4, 5, 6}, H5T_STD_U16LE, H5T_NATIVE_DOUBLE, ramp(120));
    }
    {
        H5 h5(folder.path() / "packed.h5");
        h5.dataset<double>("v", {4, 5, 6}, H5T_STD_U16LE, H5T_NATIVE_DOUBLE, ramp(120), {2, 5, 3});
    }
    expect_cuts_are_noticed(folder.path() / "plain.h5");
    expect_cuts_are_noticed(folder.path() / "packed.h5");
}

#endif

#if VOXLOOM_WITH_ITK

// --- TIFF -----------------------------------------------------------------------------------------

template <class T>
void write_tiff(const fs::path& path, Index3 dims, int components, const std::vector<double>& values) {
    auto io = itk::TIFFImageIO::New();
    io->SetFileName(path.string());
    io->SetNumberOfDimensions(dims.z > 1 ? 3 : 2);
    for (unsigned a = 0; a < (dims.z > 1 ? 3u : 2u); ++a) {
        io->SetDimensions(a, std::size_t(dims[int(a)]));
        io->SetSpacing(a, 1);
        io->SetOrigin(a, 0);
    }
    io->SetComponentType(itk::ImageIOBase::MapPixelType<T>::CType);
    io->SetPixelType(components == 1 ? itk::IOPixelEnum::SCALAR : itk::IOPixelEnum::RGB);
    io->SetNumberOfComponents(unsigned(components));
    io->SetUseCompression(false);
    std::vector<T> data(values.begin(), values.end());
    itk::ImageIORegion region(dims.z > 1 ? 3 : 2);
    for (unsigned a = 0; a < (dims.z > 1 ? 3u : 2u); ++a) region.SetSize(a, std::size_t(dims[int(a)]));
    io->SetIORegion(region);
    io->Write(data.data());
}

TEST(Tiff, PagesAndFoldersOfSlicesAreVolumes) {
    TempFolder folder;
    const std::vector<double> values = ramp(6 * 5 * 11);
    write_tiff<std::uint16_t>(folder.path() / "pages.tif", {6, 5, 11}, 1, values);
    VolumeFilePtr pages = open_volume_file(folder.path() / "pages.tif");
    EXPECT_EQ(pages->desc.dims, Index3(6, 5, 11));
    EXPECT_EQ(pages->desc.type, ScalarType::u16);
    EXPECT_EQ(samples(*pages->volume(0)), values);

    fs::create_directory(folder.path() / "stack");
    for (int z = 0; z < 11; ++z)  // names without leading zeros: order of numbers, not of letters
        write_tiff<std::uint16_t>(folder.path() / fmt::format("stack/s{}.tif", z), {6, 5, 1}, 1,
                                  std::vector<double>(values.begin() + z * 30, values.begin() + z * 30 + 30));
    VolumeFilePtr stack = open_volume_file(folder.path() / "stack");
    EXPECT_EQ(stack->desc.dims, Index3(6, 5, 11));
    EXPECT_EQ(stack->desc.name, "stack");
    EXPECT_EQ(stack->files.size(), 12u);
    EXPECT_EQ(samples(*stack->volume(0)), values);
    expect_regions_agree(*stack->volume(0));
    EXPECT_TRUE(stack->volume(0)->reads_by_region());

    write_tiff<std::uint16_t>(folder.path() / "stack/s5.tif", {5, 5, 1}, 1, ramp(25));
    EXPECT_NE(complaint(folder.path() / "stack").find("s5.tif"), std::string::npos);
}

TEST(Tiff, ColorsAreComponentsAndAPlaneIsAVolume) {
    TempFolder folder;
    const std::vector<double> values = ramp(4 * 3 * 3);
    write_tiff<std::uint8_t>(folder.path() / "rgb.tif", {4, 3, 1}, 3, values);
    VolumeFilePtr file = open_volume_file(folder.path() / "rgb.tif");
    EXPECT_EQ(file->desc.dims, Index3(4, 3, 1));
    EXPECT_EQ(file->desc.components, 3);
    EXPECT_TRUE(file->desc.color);
    EXPECT_EQ(samples(*file->volume(0)), values);
}

TEST(Tiff, CutFilesAreNoticed) {
    TempFolder folder;
    std::vector<double> values(40 * 30 * 3);
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = double(1 + i * i % 251);
    write_tiff<std::uint8_t>(folder.path() / "plain.tif", {40, 30, 3}, 1, values);
    expect_cuts_are_noticed(folder.path() / "plain.tif");
}

// --- DICOM ----------------------------------------------------------------------------------------

struct DicomSlice {
    std::string series = "1.2.3";
    glm::dvec3 position{0};
    std::string orientation = "1\\0\\0\\0\\1\\0";
    double slope = 1, intercept = 0;
};

// A slice of 6 x 5 unsigned 16-bit voxels, 12 bits in use.
void write_dicom(const fs::path& path, const DicomSlice& slice, const std::vector<double>& values) {
    auto io = itk::GDCMImageIO::New();
    gdcm::Trace::WarningOff();
    io->SetFileName(path.string());
    io->SetNumberOfDimensions(2);
    io->SetDimensions(0, 6);
    io->SetDimensions(1, 5);
    io->SetSpacing(0, 0.5);
    io->SetSpacing(1, 0.75);
    io->SetComponentType(itk::IOComponentEnum::SHORT);
    io->SetPixelType(itk::IOPixelEnum::SCALAR);
    io->SetNumberOfComponents(1);
    io->SetUseCompression(false);
    io->KeepOriginalUIDOn();
    auto& tags = io->GetMetaDataDictionary();
    auto set = [&](const char* tag, const std::string& value) { itk::EncapsulateMetaData<std::string>(tags, tag, value); };
    set("0020|000e", slice.series);
    set("0008|103e", "head " + slice.series);
    set("0008|0060", "CT");
    set("0020|0032", fmt::format("{}\\{}\\{}", slice.position.x, slice.position.y, slice.position.z));
    set("0020|0037", slice.orientation);
    set("0028|1052", fmt::format("{}", slice.intercept));
    set("0028|1053", fmt::format("{}", slice.slope));
    std::vector<std::int16_t> data(values.begin(), values.end());
    itk::ImageIORegion region(2);
    region.SetSize(0, 6);
    region.SetSize(1, 5);
    io->SetIORegion(region);
    io->Write(data.data());
}

std::vector<double> slice_values(int z) {
    std::vector<double> v = ramp(30);
    for (double& x : v) x += 100 * z;
    return v;
}

TEST(Dicom, SlicesAreOrderedByPositionAndPlacedInTheWorld) {
    TempFolder folder;
    std::vector<double> all;
    for (int z = 0; z < 4; ++z) {
        // Names run against positions.
        write_dicom(folder.path() / fmt::format("im{}.dcm", 9 - z), {"1.2.3", {10, 20, 30 + 2.5 * z}}, slice_values(z));
        for (double v : slice_values(z)) all.push_back(v);
    }
    write_file(folder.path() / "notes.txt", "not an image");
    VolumeFilePtr file = open_volume_file(folder.path());
    EXPECT_EQ(file->desc.dims, Index3(6, 5, 4));
    EXPECT_EQ(file->desc.type, ScalarType::i16);
    EXPECT_EQ(file->desc.spacing(), glm::dvec3(0.5, 0.75, 2.5));
    EXPECT_EQ(file->desc.origin(), glm::dvec3(10, 20, 30));
    EXPECT_EQ(file->desc.unit, "mm");
    EXPECT_EQ(file->desc.name, "head 1.2.3");
    EXPECT_TRUE(file->warnings.empty());
    EXPECT_EQ(file->files.size(), 5u);
    EXPECT_EQ(samples(*file->volume(0)), all);
    expect_regions_agree(*file->volume(0));
}

TEST(Dicom, TiltedAndTurnedSlicesKeepTheirMatrix) {
    TempFolder folder;
    for (int z = 0; z < 3; ++z)
        write_dicom(folder.path() / fmt::format("im{}.dcm", z),
                    {"1.2.3", {0, 1.0 * z, 2.0 * z}, "0\\1\\0\\-1\\0\\0"}, slice_values(z));
    const glm::dmat4 m = open_volume_file(folder.path())->desc.index_to_world;
    EXPECT_LT(glm::length(m[0] - glm::dvec4(0, 0.5, 0, 0)), 1e-9);
    EXPECT_LT(glm::length(m[1] - glm::dvec4(-0.75, 0, 0, 0)), 1e-9);
    EXPECT_LT(glm::length(m[2] - glm::dvec4(0, 1, 2, 0)), 1e-9);
}

TEST(Dicom, RescaleIsAppliedAndSlicesOfTheirOwnScaleBecomeFloats) {
    TempFolder folder;
    fs::create_directory(folder.path() / "ct");
    fs::create_directory(folder.path() / "pet");
    for (int z = 0; z < 2; ++z) {
        write_dicom(folder.path() / fmt::format("ct/im{}.dcm", z), {"1.2", {0, 0, 1.0 * z}, "1\\0\\0\\0\\1\\0", 1, -1024}, slice_values(z));
        write_dicom(folder.path() / fmt::format("pet/im{}.dcm", z), {"1.3", {0, 0, 1.0 * z}, "1\\0\\0\\0\\1\\0", 2.0 + z, 0}, slice_values(z));
    }
    // Written values are true ones: the writer divides by the slope, so they come back.
    auto ct = samples(folder.path() / "ct");
    auto pet = open_volume_file(folder.path() / "pet");
    EXPECT_EQ(pet->desc.type, ScalarType::f32);
    auto values = samples(*pet->volume(0));
    ASSERT_EQ(ct.size(), 60u);
    for (std::size_t i = 0; i < 60; ++i) {
        const double truth = slice_values(int(i / 30))[i % 30];
        EXPECT_EQ(ct[i], truth);
        EXPECT_NEAR(values[i], truth, 2.5);  // rounded to whole stored values
    }
}

TEST(Dicom, MissingSlicesAndUnevenSpacingAreWarnedOf) {
    TempFolder folder;
    fs::create_directory(folder.path() / "gap");
    fs::create_directory(folder.path() / "uneven");
    int i = 0;
    for (double z : {0., 1., 2., 4., 5.}) write_dicom(folder.path() / fmt::format("gap/{}.dcm", i++), {"1", {0, 0, z}}, ramp(30));
    for (double z : {0., 1., 2., 3.3, 4.3}) write_dicom(folder.path() / fmt::format("uneven/{}.dcm", i++), {"1", {0, 0, z}}, ramp(30));
    auto gap = open_volume_file(folder.path() / "gap"), uneven = open_volume_file(folder.path() / "uneven");
    ASSERT_EQ(gap->warnings.size(), 1u);
    EXPECT_NE(gap->warnings[0].find("1 slices are missing"), std::string::npos) << gap->warnings[0];
    ASSERT_EQ(uneven->warnings.size(), 1u);
    EXPECT_NE(uneven->warnings[0].find("differ from the usual 1"), std::string::npos) << uneven->warnings[0];
}

TEST(Dicom, SeveralSeriesAreListedAndOneIsChosen) {
    TempFolder folder;
    for (int z = 0; z < 3; ++z) {
        write_dicom(folder.path() / fmt::format("a{}.dcm", z), {"1.2.3", {0, 0, 1.0 * z}}, slice_values(z));
        if (z < 2) write_dicom(folder.path() / fmt::format("b{}.dcm", z), {"1.2.4", {0, 0, 1.0 * z}}, slice_values(z + 5));
    }
    std::string message = complaint(folder.path());
    EXPECT_NE(message.find("1.2.3 ('head 1.2.3', 3 slices)"), std::string::npos) << message;
    EXPECT_NE(message.find("series_uid"), std::string::npos) << message;
    ReadOptions options;
    options.series_uid = "1.2.4";
    VolumeFilePtr file = open_volume_file(folder.path(), options);
    EXPECT_EQ(file->desc.dims.z, 2);
    EXPECT_EQ(samples(*file->volume(0))[0], 500);
    options.series_uid = "1.2.5";
    EXPECT_NE(complaint(folder.path(), nullptr, options).find("holds no series 1.2.5"), std::string::npos);
}

TEST(Dicom, SlicesAtOnePlaceOrTurnedAreRefused) {
    TempFolder folder;
    write_dicom(folder.path() / "a.dcm", {"1", {0, 0, 0}}, ramp(30));
    write_dicom(folder.path() / "b.dcm", {"1", {0, 0, 0}}, ramp(30));
    EXPECT_NE(complaint(folder.path()).find("same place"), std::string::npos);
    write_dicom(folder.path() / "b.dcm", {"1", {0, 0, 1}, "0\\1\\0\\-1\\0\\0"}, ramp(30));
    EXPECT_NE(complaint(folder.path()).find("is turned against"), std::string::npos);
}

TEST(Dicom, CutFilesAreNoticed) {
    TempFolder folder;
    fs::create_directory(folder.path() / "one");
    write_dicom(folder.path() / "one/a.dcm", {"1", {0, 0, 0}}, slice_values(3));
    expect_cuts_are_noticed(folder.path() / "one/a.dcm");
}

#endif

}  // namespace
}  // namespace voxloom::testing
