// Ready-made control points.
#pragma once

#include <string_view>
#include <vector>

#include "plugins/scene/classification.h"

namespace voxloom::scene {

struct Preset {
    std::string_view name;
    bool relative;  // values from 0 to 1 of the data's range; else Hounsfield units
    std::vector<ControlPoint> points;
};
const std::vector<Preset>& presets();
// Null when there is none of this name.
const Preset* find_preset(std::string_view name);

}  // namespace voxloom::scene
