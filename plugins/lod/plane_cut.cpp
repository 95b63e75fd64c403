#include "plugins/lod/plane_cut.h"

#include <cmath>

#include "core/base/error.h"

namespace voxloom::lod {

bool PlaneTest::meets(BrickId id) const {
    const Box box = bricks_.fine_box_of(id);
    const Region region = region_of(bricks_.volume, box);
    const Reach r = reach(region, plane_);
    const double rounding = 1e-12 * (r.half + std::abs(plane_.w));
    if (std::abs(r.centre) > r.half + rounding) return false;
    if (r.centre > -r.half + rounding) return true;
    // It touches the corner that is furthest along the normal: the brick beyond takes it, if there is one.
    for (int a = 0; a < 3; ++a) {
        if (plane_[a] > 0 && box.hi[a] < bricks_.volume.dims[a]) return false;
        if (plane_[a] < 0 && box.lo[a] > 0) return false;
    }
    return true;
}

namespace {

class PlaneCut {
  public:
    PlaneCut(const BricksDesc& bricks, const PlaneRule& rule, const Sight* sight, const std::stop_token& stop)
        : bricks_(bricks), rule_(rule), sight_(sight), stop_(stop), test_(bricks, rule.plane),
          cut_(coarsest_cut(bricks)) {}

    Cut run() {
        for (std::int32_t root : cut_.roots) refine(root);
        return std::move(cut_);
    }

  private:
    void refine(std::int32_t index) {
        if (++visited_ % 1024 == 0) check_stop(stop_);
        const BrickId id = cut_.nodes[std::size_t(index)].id;
        const Region region = region_of(bricks_.volume, bricks_.fine_box_of(id));
        if (!test_.meets(id) || (sight_ && !sight_->sees(region))) {
            cut_.nodes[std::size_t(index)].drawn = false;
            return;
        }
        if (id.level == 0 || far_enough(id)) return;
        for (const BrickId& finer : bricks_.finer(id)) {
            const auto child = std::int32_t(cut_.nodes.size());
            cut_.nodes.push_back(whole_node(bricks_, finer));
            cut_.nodes[std::size_t(index)].child[std::size_t(bricks_.octant_of(finer))] = child;
            refine(child);
        }
    }
    // Of the whole brick, so that bricks cut off by the volume's end are not finer than their neighbours.
    bool far_enough(BrickId id) const {
        const glm::dvec3 size = glm::dvec3(bricks_.brick) *
                                glm::dvec3(bricks_.levels[std::size_t(id.level)].stride);
        const glm::dvec3 centre = size * (glm::dvec3(id.index) + 0.5);
        const glm::dmat4& m = bricks_.volume.index_to_world;
        double diagonal = 0;
        for (int corner = 0; corner < 4; ++corner) {
            const glm::dvec3 d(corner & 1 ? -size.x : size.x, corner & 2 ? -size.y : size.y, size.z);
            diagonal = std::max(diagonal, glm::length(glm::dmat3(m) * d));
        }
        return glm::distance(glm::dvec3(m * glm::dvec4(centre, 1.0)), rule_.interest) > rule_.kappa * diagonal;
    }

    const BricksDesc& bricks_;
    const PlaneRule& rule_;
    const Sight* sight_;
    const std::stop_token& stop_;
    PlaneTest test_;
    Cut cut_;
    std::size_t visited_ = 0;
};

}  // namespace

Cut select_on_plane(const BricksDesc& bricks, const PlaneRule& rule, const Sight* sight,
                    const std::stop_token& stop) {
    return PlaneCut(bricks, rule, sight, stop).run();
}

}  // namespace voxloom::lod
