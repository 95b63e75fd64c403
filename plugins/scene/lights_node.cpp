#include <fmt/format.h>

#include <algorithm>

#include "plugins/scene/nodes.h"

namespace voxloom::scene {

namespace {

// Renderers keep the lights in arrays of this size.
constexpr std::size_t kMaxLights = 8;

constexpr const char* kMethod = R"(
Blinn-Phong: colour x (ambient + diffuse x sum of |n.l|) + specular x sum of max(0, n.h)^shininess,
for each light in its colour. The absolute value lights both sides, because a gradient has no outside.

A **headlight** shines from the eye along the view: whatever the camera sees is lit, and it moves with
the camera. **Directional** lights stand infinitely far away in the direction [x, y, z] of the world;
**point** lights stand at [x, y, z]. A row of six numbers adds the light's colour.

Where the data is flat or noisy, shading shows noise: raise `ambient`, or draw without it.

Reference: J. Blinn, Models of light reflection for computer synthesized pictures, SIGGRAPH 1977.
)";

// Rows of 3 numbers (white) or 6 (with colour). The first problem found, or empty.
std::string problem_with_rows(const Rows& rows, bool directions) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const auto& row = rows[i];
        if (row.size() != 3 && row.size() != 6)
            return fmt::format("row {} has {} numbers; write [x, y, z] or [x, y, z, r, g, b]", i + 1,
                               row.size());
        if (directions && row[0] == 0 && row[1] == 0 && row[2] == 0)
            return fmt::format("row {} has no direction; write where the light comes from", i + 1);
        for (std::size_t k = 3; k < row.size(); ++k)
            if (row[k] < 0)
                return fmt::format("row {} has a negative colour; colours begin at 0", i + 1);
    }
    return {};
}

void add_rows(const Rows& rows, Light::Kind kind, Lights& lights) {
    for (const auto& row : rows) {
        glm::dvec3 position(row[0], row[1], row[2]);
        // Scaled first: a direction of 1e-200 or 1e200 is one like any other.
        if (kind == Light::Kind::directional) {
            glm::dvec3 size = glm::abs(position);
            position = glm::normalize(position / std::max({size.x, size.y, size.z}));
        }
        glm::dvec3 color = row.size() == 6 ? glm::dvec3(row[3], row[4], row[5]) : glm::dvec3(1.0);
        lights.lights.push_back({kind, position, color});
    }
}

void describe_lights(Description& d) {
    const Params& p = d.params();
    for (const char* key : {"directional", "point"})
        if (std::string problem = problem_with_rows(p.rows(key), key[0] == 'd'); !problem.empty())
            d.problem(problem, key);
    std::size_t count = p.rows("directional").size() + p.rows("point").size();
    if (count + (p.real("headlight") > 0) > kMaxLights)
        d.problem(fmt::format("there are more than {} lights; remove some", kMaxLights));
}

void evaluate_lights(Evaluation& ev) {
    const Params& p = ev.params();
    Lights lights;
    lights.lights.clear();
    if (double strength = p.real("headlight"); strength > 0)
        lights.lights.push_back({Light::Kind::headlight, {0, 0, 1}, glm::dvec3(strength)});
    add_rows(p.rows("directional"), Light::Kind::directional, lights);
    add_rows(p.rows("point"), Light::Kind::point, lights);
    lights.ambient = p.real("ambient");
    lights.diffuse = p.real("diffuse");
    lights.specular = p.real("specular");
    lights.shininess = p.real("shininess");
    ev.output("lights", std::make_shared<Lights>(lights));
}

}  // namespace

NodeType lights_node() {
    NodeType node;
    node.id = "scene.lights";
    node.title = "Lights";
    node.doc = "Lights and the material that they fall on, for shaded renderings.";
    node.keywords = {"shading", "headlight", "directional", "point", "ambient", "diffuse", "specular",
                     "material", "Phong"};
    node.outputs = {{"lights", PortType::lights, "The lights."}};
    node.params = {
        param::real("headlight", 1, "Strength of the light that shines from the eye; 0 turns it off.")
            .range(0, 100).slider(0, 2).in_group("Lights"),
        param::rows("directional", 0, {},
                    "Lights far away, one a row: the direction towards it [x, y, z] in the world, and "
                    "if wanted its colour [.., r, g, b].")
            .range(-1e30, 1e30).in_group("Lights"),
        param::rows("point", 0, {},
                    "Lights in the scene, one a row: its place [x, y, z] in the world, and if wanted "
                    "its colour [.., r, g, b].")
            .range(-1e30, 1e30).in_group("Lights"),
        param::real("ambient", Lights{}.ambient, "Share of the colour that is seen without any light.")
            .range(0, 10).slider(0, 1).in_group("Material"),
        param::real("diffuse", Lights{}.diffuse, "Strength of matt reflection.")
            .range(0, 10).slider(0, 1).in_group("Material"),
        param::real("specular", Lights{}.specular, "Strength of the highlights.")
            .range(0, 10).slider(0, 1).in_group("Material"),
        param::real("shininess", Lights{}.shininess, "Exponent of the highlights: large makes them small.")
            .range(1, 1e4).slider(1, 200, Scale::logarithmic).in_group("Material"),
    };
    node.method = kMethod;
    node.describe = describe_lights;
    node.evaluate = evaluate_lights;
    return node;
}

}  // namespace voxloom::scene
