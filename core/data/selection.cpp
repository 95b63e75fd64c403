#include "core/data/selection.h"

#include <cmath>

#include "core/base/error.h"

namespace voxloom {

void check_selection(const Selection& selection, const BricksDesc& bricks) {
    const BricksDesc& of = *selection.of;
    bool same = of.volume.dims == bricks.volume.dims && of.brick == bricks.brick &&
                of.levels.size() == bricks.levels.size();
    for (std::size_t l = 0; same && l < of.levels.size(); ++l)
        same = of.levels[l].stride == bricks.levels[l].stride;
    if (!same)
        fail("the selection of {} was made for other bricks ({}); wire the same bricks to both",
             selection.policy, summary(of.volume));
}

Box fine_box_of_octant(const BricksDesc& bricks, BrickId id, int octant) {
    if (id.level == 0) return octant == 0 ? bricks.fine_box_of(id) : Box{};
    const glm::ivec3 upper(octant & 1, octant >> 1 & 1, octant >> 2);
    const glm::ivec3 stride = bricks.levels[std::size_t(id.level)].stride;
    const glm::ivec3 finer = bricks.levels[std::size_t(id.level) - 1].stride;
    const glm::ivec3 halves = stride / finer;  // 2 or 1
    if (glm::any(glm::greaterThanEqual(upper, halves))) return {};
    const Index3 size = Index3(bricks.brick) * Index3(finer);
    const Index3 lo = (Index3(id.index) * Index3(halves) + Index3(upper)) * size;
    const Box box{lo, glm::min(lo + size, bricks.volume.dims)};
    return box.empty() ? Box{} : box;
}

glm::dvec3 point_in_box(const VolumeDesc& volume, glm::dvec3 fraction) {
    const SamplingBox box = sampling_box(volume);
    return glm::dvec3(volume.index_to_world * glm::dvec4(glm::mix(box.lo, box.hi, fraction), 1.0));
}

glm::dvec4 plane_through(glm::dvec3 point, glm::dvec3 normal) {
    const double length = glm::length(normal);
    if (!(length > 0) || !std::isfinite(length)) fail("a cutting plane's normal must have a length");
    normal /= length;
    return {normal, -glm::dot(normal, point)};
}

}  // namespace voxloom
