// What the tests of this plugin share.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <vector>

#include "core/data/brick_cache.h"
#include "core/data/convert.h"
#include "plugins/codec-vq/encoder.h"
#include "tests/support/volumes.h"

namespace voxloom::vq {

// Any number of components; f gives the value of voxel i's component c.
inline VolumePtr volume_of(Index3 dims, ScalarType type, int components, const std::function<double(Index3, int)>& f) {
    VolumeDesc desc;
    desc.dims = dims;
    desc.type = type;
    desc.components = components;
    desc.name = "tested";
    desc.set_spacing_origin({1, 1, 1000}, {-3, 0.5, 7});
    std::vector<double> values;
    for (std::int64_t z = 0; z < dims.z; ++z)
        for (std::int64_t y = 0; y < dims.y; ++y)
            for (std::int64_t x = 0; x < dims.x; ++x)
                for (int c = 0; c < components; ++c) values.push_back(f({x, y, z}, c));
    Buffer voxels(desc.dense_bytes());
    from_double(values.data(), values.size(), type, voxels.data());
    return std::make_shared<DenseVolume>(desc, std::move(voxels));
}

// Smooth, with an edge and a little noise, within 7 or 12 bits.
inline VolumePtr scene(Index3 dims, ScalarType type = ScalarType::i16, int components = 1) {
    auto random = std::make_shared<std::mt19937>(7);
    const double scale = bytes_of(type) == 1 ? 1.0 / 32 : 1;
    return volume_of(dims, type, components, [=](Index3 i, int c) {
        const double v = 1500 + 900 * std::sin(0.2 * double(i.x) + c) * std::cos(0.15 * double(i.y)) + 3 * double(i.z) +
                         (i.x > i.y + 4 ? 600 : 0) + double((*random)() % 64);
        return v * scale;
    });
}

inline std::vector<std::byte> bytes_of_volume(const Volume& volume) {
    std::vector<std::byte> bytes(volume.desc().dense_bytes());
    volume.read(Box::of(volume.desc().dims), bytes, {});
    return bytes;
}
inline std::vector<std::byte> decoded(const BricksPtr& bricks) {
    BrickCache cache(64 << 20);
    const VolumeDesc& volume = bricks->desc().volume;
    std::vector<std::byte> bytes(volume.dense_bytes());
    read_region(bricks, 0, Box::of(volume.dims), bytes, cache);
    return bytes;
}
inline std::vector<double> numbers(const std::vector<std::byte>& bytes, ScalarType type) {
    std::vector<double> values(bytes.size() / bytes_of(type));
    to_double(type, bytes.data(), values.size(), values.data());
    return values;
}

struct Encoded {
    VqBricksPtr bricks;
    EncodeReport report;
};
inline Encoded encoded(const Volume& volume, const EncodeOptions& options) {
    Encoded result;
    result.bricks = encode(volume, options, result.report);
    return result;
}
// Small bricks and codebooks: what is tested does not depend on the encoder's effort.
inline EncodeOptions small(int codewords = 16, Loop loop = Loop::closed, int brick = 8) {
    EncodeOptions options;
    options.codewords = codewords;
    options.loop = loop;
    options.brick = brick;
    return options;
}

inline Bytes file_of(const VqBricks& bricks) {
    Bytes file = front_of(bricks.index(), bricks.payload().size());
    file.insert(file.end(), bricks.payload().begin(), bricks.payload().end());
    return file;
}

}  // namespace voxloom::vq
