// slicer.plane: a cutting plane through bricks.
#pragma once

#include "core/graph/node.h"

namespace voxloom::slicer {

NodeType plane_node();

// Of both nodes that draw bricks.
inline ParamSpec first_picture_param() {
    return param::real("first_picture", 0.2, "Where bricks are still to be decoded, what is there of them is shown after so "
                                             "long, for people who look; 0: not before everything is there.")
        .range(0, 3600).slider(0, 2).in_unit("s").in_group("speed").for_experts().changes(Affects::cost);
}

}  // namespace voxloom::slicer
