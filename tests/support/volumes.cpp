#include "tests/support/volumes.h"

#include <stdlib.h>

#include <algorithm>
#include <cmath>

#include "core/base/error.h"

namespace voxloom::testing {

namespace fs = std::filesystem;

VolumePtr make_volume(Index3 dims, ScalarType type,
                      const std::function<double(std::int64_t, std::int64_t, std::int64_t)>& f,
                      glm::dvec3 spacing) {
    VolumeDesc desc;
    desc.dims = dims;
    desc.type = type;
    desc.set_spacing_origin(spacing, glm::dvec3(0.0));
    Buffer voxels(desc.dense_bytes());
    with_type(type, [&](auto t) {
        using T = decltype(t);
        auto [lo, hi] = limits_of(type);
        T* out = reinterpret_cast<T*>(voxels.data());
        for (std::int64_t z = 0; z < dims.z; ++z)
            for (std::int64_t y = 0; y < dims.y; ++y)
                for (std::int64_t x = 0; x < dims.x; ++x) {
                    double v = f(x, y, z);
                    *out++ = std::is_floating_point_v<T> ? T(v)
                                                         : T(std::clamp(std::nearbyint(v), lo, hi));
                }
    });
    return std::make_shared<DenseVolume>(desc, std::move(voxels));
}

double voxel(const Volume& volume, Index3 i) {
    Buffer one(volume.desc().voxel_bytes());
    volume.read({i, i + Index3(1)}, one.bytes(), {});
    return with_type(volume.desc().type, [&](auto t) {
        return double(one.as<decltype(t)>()[0]);
    });
}

TempFolder::TempFolder() {
    std::string name = (fs::temp_directory_path() / "voxloom-XXXXXX").string();
    if (!mkdtemp(name.data())) fail("no temporary folder can be made from {}", name);
    path_ = name;
}

TempFolder::~TempFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
}

fs::path real_data() {
    if (const char* folder = std::getenv("VOXLOOM_DATA")) return folder;
    fs::path beside = fs::path(VOXLOOM_SOURCE_DIR).parent_path() / "shared/data";
    return fs::is_directory(beside) ? beside : fs::path();
}

}  // namespace voxloom::testing
