// Named colour maps of the field.
#pragma once

#include <glm/glm.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace voxloom::scene {

// Colours at positions from 0 to 1, linear between. Display-referred (sRGB) numbers, 0 to 1.
struct ColorMap {
    struct Knot {
        double position;
        glm::dvec3 color;
    };
    std::vector<Knot> knots;          // increasing, from 0 to 1
    glm::dvec3 at(double t) const;    // clamped to 0..1
};

const std::vector<std::string>& color_map_names();
// One of color_map_names(); asking for another is a programming mistake.
const ColorMap& color_map(std::string_view name);

}  // namespace voxloom::scene
