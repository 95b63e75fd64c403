// Selection for a cutting plane: fine near a point of interest, coarser away from it.
#pragma once

#include <optional>
#include <stop_token>

#include "plugins/lod/cut.h"

namespace voxloom::lod {

struct PlaneRule {
    glm::dvec4 plane{0, 0, 1, 0};  // world, |n| = 1
    glm::dvec3 interest{0};        // world
    double kappa = 1;              // 0: the coarsest bricks; infinite: the finest ones everywhere
};

// Whether the plane meets the brick. On a face that two bricks share it meets the one behind it, as
// seen along the normal, so that it is drawn once; at the volume's end the one that is there.
class PlaneTest {
  public:
    PlaneTest(const BricksDesc& bricks, const glm::dvec4& plane)
        : bricks_(bricks), plane_(in_index_space(plane, bricks.volume)) {}
    bool meets(BrickId id) const;

  private:
    const BricksDesc& bricks_;
    glm::dvec4 plane_;  // index coordinates
};

// LaMar et al. 2000, sections 3.2 and 4.1: a brick that the plane meets is drawn when its centre is
// further from the point of interest than kappa times its diagonal ("smaller" in section 4.1 is an
// error of print), and replaced by its finer ones when it is nearer. sight may be null.
Cut select_on_plane(const BricksDesc& bricks, const PlaneRule& rule, const Sight* sight,
                    const std::stop_token& stop = {});

}  // namespace voxloom::lod
