// Small volumes made in memory for tests.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <functional>

#include "core/data/volume.h"

namespace voxloom::testing {

// A dense volume whose voxel (x, y, z) is f(x, y, z), rounded and clamped to the type.
VolumePtr make_volume(Index3 dims, ScalarType type,
                      const std::function<double(std::int64_t, std::int64_t, std::int64_t)>& f,
                      glm::dvec3 spacing = glm::dvec3(1.0));

// Voxel as double, first component.
double voxel(const Volume& volume, Index3 i);

// A folder of its own, removed at the end of the scope.
class TempFolder {
  public:
    TempFolder();
    ~TempFolder();
    const std::filesystem::path& path() const { return path_; }

  private:
    std::filesystem::path path_;
};

// Folder of real volumes ($VOXLOOM_DATA, else ../shared/data beside the source folder); empty where
// it is not there: tests that need it skip, saying so.
std::filesystem::path real_data();
#define VOXLOOM_NEEDS_DATA(variable)                                     \
    const std::filesystem::path variable = ::voxloom::testing::real_data(); \
    if (variable.empty()) GTEST_SKIP() << "no folder of real volumes (set VOXLOOM_DATA)"

}  // namespace voxloom::testing
