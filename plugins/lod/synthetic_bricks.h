// Trees without voxels, for tests and benchmarks: a description, and errors by a formula.
#pragma once

#include <cmath>
#include <functional>

#include "core/base/error.h"
#include "core/data/selection.h"

namespace voxloom::lod {

// RMS error of an octant of a brick, as a function of its level and of its middle, 0 to 1 in the volume.
using ErrorFormula = std::function<double(int level, glm::dvec3 middle)>;

class SyntheticBricks final : public Bricks {
  public:
    SyntheticBricks(Index3 dims, glm::ivec3 brick, ErrorFormula error, glm::dvec3 spacing = glm::dvec3(1),
                    bool flat = false)
        : Bricks(describe(dims, brick, spacing, flat)), error_(std::move(error)) {}

    BrickInfo info(BrickId id) const override {
        BrickInfo info;
        info.range = {0, 1};
        info.exact_error = true;
        if (id.level == 0) return info;
        double sum = 0;
        for (int o = 0; o < 8; ++o) {
            const Box box = fine_box_of_octant(desc(), id, o);
            const glm::dvec3 middle = 0.5 * glm::dvec3(box.lo + box.hi) / glm::dvec3(desc().volume.dims);
            const double rms = box.empty() ? 0 : error_(id.level, middle);
            const double squared = rms * rms * double(box.voxels());
            info.octant_l2[std::size_t(o)] = std::sqrt(squared);
            info.max_error = std::max(info.max_error, rms);
            sum += squared;
        }
        info.l2 = std::sqrt(sum);
        return info;
    }
    std::optional<BrickId> parent(BrickId) const override { return std::nullopt; }
    std::vector<DecodedBrick> refine(BrickId, const BrickVoxels*, const std::stop_token&) const override {
        fail("a synthetic tree has no voxels");
    }

  private:
    static BricksDesc describe(Index3 dims, glm::ivec3 brick, glm::dvec3 spacing, bool flat) {
        BricksDesc desc;
        desc.volume.dims = dims;
        desc.volume.type = desc.tree_type = ScalarType::f32;
        desc.volume.set_spacing_origin(spacing, glm::dvec3(0));
        desc.volume.range = ValueRange{0, 1};
        desc.brick = brick;
        desc.levels = pyramid_levels(desc.volume, brick, flat);
        return desc;
    }
    ErrorFormula error_;
};

// Detail near a sphere's surface, twice the error a level: what most scans are like.
inline double shell_error(int level, glm::dvec3 middle) {
    const double r = (glm::distance(middle, glm::dvec3(0.5)) - 0.35) / 0.05;
    return 0.01 * std::exp2(level) * std::exp(-r * r);
}

}  // namespace voxloom::lod
