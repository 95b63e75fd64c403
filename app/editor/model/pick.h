// What a place of a picture shows: where in the world that is, and the voxel there.
#pragma once

#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "app/editor/model/plane_control.h"

namespace voxloom::editor {

// What a picture is made of, as its node sees it; immutable, for any thread.
struct PickScene {
    enum class How {
        opacity,     // along a ray, what it meets first; where kVisible of it are hidden behind
        densest,     // along a ray, the first voxel of the greatest extinction: what an x-ray shows most of
        isosurface,  // along a ray, the first voxel beyond the iso-value
        maximum,     // along a ray, the first voxel of the greatest value
        plane        // where a ray meets the plane
    };
    How how = How::opacity;
    CameraPtr camera;
    VolumePtr volume;         // of bricks, their level 0, read through the cache; best one that reads by region
    TransferPtr transfer;     // for opacity and densest
    std::optional<Plane> plane;
    double iso_value = 0;
    int component = 0;        // that is classified; of colours it is their luma
    glm::dvec2 modulation{0}; // gradients between which opacity rises from none to full; both 0: off
    double smoothing = 1.0 / 6;  // of gradients across their axis, (s, 1 - 2 s, s); 1/6 is the renderers' default
};
inline constexpr double kVisible = 0.1;  // opacity

// Of the picture of a node: what is nearest upstream of it. Nothing where a camera or voxels are missing (they may
// have left the cache).
std::optional<PickScene> pick_scene(const Graph& graph, const Registry& registry, const std::string& node,
                                    const Evaluator::State& state);

struct Picked {
    glm::dvec3 world{0.0};
    Index3 voxel{0};             // the nearest
    std::vector<double> values;  // its components
};
// Of the pixel that (x, y) lies in, in a picture of that size. Rays are followed from voxel to voxel, with the
// opacity that renderers compute there (transfer function over values or values and gradients, a colour's own alpha,
// modulation by gradients), so the place is right to a voxel. Null where the ray meets nothing that is seen.
std::shared_ptr<const Picked> pick(const PickScene& scene, glm::ivec2 pixel, glm::ivec2 size, const std::stop_token& stop = {});

// "at 1.5 0 -3 mm   voxel (12, 0, 4)   value 812"
std::string text_of(const Picked& picked, const std::string& unit);

}  // namespace voxloom::editor
