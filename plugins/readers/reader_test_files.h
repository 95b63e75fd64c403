// Small files of each format, written by hand, for the readers' tests.
#pragma once

#include <gtest/gtest.h>
#include <zlib.h>

#include <bit>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/data/volume.h"
#include "volume_file.h"

namespace voxloom::testing {

inline void write_file(const std::filesystem::path& path, std::string_view bytes) {
    std::ofstream out(path, std::ios::binary);
    out.write(bytes.data(), std::streamsize(bytes.size()));
    ASSERT_TRUE(out.good()) << path;
}

inline std::string read_file(const std::filesystem::path& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

// The bytes of values of type T, in the byte order asked for.
template <class T>
std::string bytes_of_values(const std::vector<double>& values, bool big_endian = false) {
    std::string bytes;
    for (double v : values) {
        T t = T(v);
        std::string word(reinterpret_cast<const char*>(&t), sizeof t);
        if (big_endian != (std::endian::native == std::endian::big))
            word = std::string(word.rbegin(), word.rend());
        bytes += word;
    }
    return bytes;
}

inline std::string gzip(std::string_view bytes, int window = 15 + 16) {
    z_stream z{};
    deflateInit2(&z, 6, Z_DEFLATED, window, 8, Z_DEFAULT_STRATEGY);
    std::string out(deflateBound(&z, uLong(bytes.size())) + 64, '\0');
    std::string in(bytes);
    z.next_in = reinterpret_cast<Bytef*>(in.data());
    z.avail_in = uInt(in.size());
    z.next_out = reinterpret_cast<Bytef*>(out.data());
    z.avail_out = uInt(out.size());
    deflate(&z, Z_FINISH);
    out.resize(out.size() - z.avail_out);
    deflateEnd(&z);
    return out;
}

// 0, 1, 2, ... scaled so that neighbours differ and bytes are not alike.
inline std::vector<double> ramp(std::size_t count, double scale = 1) {
    std::vector<double> v(count);
    for (std::size_t i = 0; i < count; ++i) v[i] = double(i % 101) * scale;
    return v;
}

// All samples of a volume as doubles, read in one go.
inline std::vector<double> samples(const Volume& volume) {
    Buffer all(volume.desc().dense_bytes());
    volume.read(Box::of(volume.desc().dims), all.bytes(), {});
    std::vector<double> values;
    with_type(volume.desc().type, [&](auto t) {
        for (auto v : all.as<decltype(t)>()) values.push_back(double(v));
    });
    return values;
}
inline std::vector<double> samples(const std::filesystem::path& path) {
    return samples(*open_volume_file(path)->volume(0));
}

// Reading any box gives what cutting it from the whole gives.
inline void expect_regions_agree(const Volume& volume) {
    const std::vector<double> all = samples(volume);
    const Index3 dims = volume.desc().dims;
    const auto c = std::size_t(volume.desc().components);
    std::vector<Box> boxes = {{{0, 0, dims.z - 1}, dims}, {dims - Index3(1), dims}};
    Index3 lo = dims / std::int64_t(3), hi = glm::max(lo + Index3(1), dims - dims / std::int64_t(4));
    boxes.push_back({lo, hi});
    boxes.push_back({{0, lo.y, 0}, {dims.x, hi.y, dims.z}});
    for (const Box& box : boxes) {
        Buffer part(box.voxels() * volume.desc().voxel_bytes());
        volume.read(box, part.bytes(), {});
        with_type(volume.desc().type, [&](auto t) {
            auto got = part.as<decltype(t)>();
            std::size_t i = 0;
            for (auto z = box.lo.z; z < box.hi.z; ++z)
                for (auto y = box.lo.y; y < box.hi.y; ++y)
                    for (auto x = box.lo.x; x < box.hi.x; ++x)
                        for (std::size_t k = 0; k < c; ++k, ++i)
                            ASSERT_EQ(double(got[i]),
                                      all[std::size_t((z * dims.y + y) * dims.x + x) * c + k]);
        });
    }
}

// What opening or reading `path` says, or empty when it works; the samples then, where wanted.
inline std::string complaint(const std::filesystem::path& path, std::vector<double>* got = nullptr,
                             const ReadOptions& options = {}) {
    try {
        std::vector<double> v = samples(*open_volume_file(path, options)->volume(0));
        if (got) *got = v;
        return {};
    } catch (const Error& e) {
        return e.what();
    }
}

// A message for people: names the file, one line, nothing of ITK's insides.
inline void expect_sentence(const std::string& message, const std::filesystem::path& path) {
    EXPECT_NE(message.find(path.filename().string()), std::string::npos) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    EXPECT_EQ(message.find("itk"), std::string::npos) << message;
    EXPECT_EQ(message.find("0x"), std::string::npos) << message;
    EXPECT_LT(message.size(), 600u) << message;
}

// Cuts a file at many lengths: each either is an error in one sentence, or changes no voxel.
inline void expect_cuts_are_noticed(const std::filesystem::path& path, std::size_t steps = 60) {
    const std::string whole = read_file(path);
    const std::vector<double> truth = samples(path);
    std::size_t refused = 0;
    for (std::size_t i = 0; i < steps; ++i) {
        std::size_t length = i < steps / 2 ? whole.size() * i / (steps / 2)
                                           : whole.size() - 1 - (i - steps / 2);
        if (length >= whole.size()) continue;
        std::filesystem::path cut = path.parent_path() / ("cut" + std::to_string(length) + path.filename().string());
        write_file(cut, std::string_view(whole).substr(0, length));
        std::vector<double> got;
        std::string message = complaint(cut, &got);
        if (message.empty()) {
            EXPECT_EQ(got, truth) << "cut to " << length << " of " << whole.size();
        } else {
            ++refused;
            expect_sentence(message, cut);
        }
        std::filesystem::remove(cut);
    }
    EXPECT_GE(refused, steps / 2);
}

}  // namespace voxloom::testing
