// Draws a volume by view-aligned slabs: from a scene to a picture.
#pragma once

#include <string>

#include "core/data/camera.h"
#include "core/data/image.h"
#include "core/data/transfer_function.h"
#include "core/graph/node.h"

namespace voxloom::slicer {

struct Settings {
    enum class Reconstruction { nearest, trilinear, tricubic };
    enum class Classification { pre, post, pre_integrated };
    enum class Compositing { over, mip, x_ray, isosurface };
    enum class Gradient { central, sobel, isotropic };
    glm::ivec2 size{512};
    double slice_distance = 1;
    Reconstruction reconstruction = Reconstruction::trilinear;
    Classification classification = Classification::pre_integrated;
    Compositing compositing = Compositing::over;
    Gradient gradient = Gradient::isotropic;
    bool gradient_stored = true;
    bool shading = false;
    glm::dvec2 modulation{0};
    double iso_value = 0;
    int component = 0;
    bool ray_length = true;     // opacity for the length of the ray between two planes
    int table_size = 256;
    double early_termination = 0.999;
    bool skipping = true;
    int block_size = 8;
    glm::dvec4 background{0, 0, 0, 1};
    std::uint64_t gpu_bytes = 0;
    double first_picture = 0;   // seconds until what is decoded of bricks is shown; 0: not before all is
};

struct Scene {
    Value source;               // Volume or Bricks
    SelectionPtr selection;     // of the bricks that are drawn; null: all of level 0
    TransferPtr transfer;
    CameraPtr camera;
    LightsPtr lights;           // null: the default ones
    Settings settings;
};

// [OpenGL thread] Counters, progress, provisional pictures and drawing time go to `ev`.
ImagePtr render(const Scene& scene, Evaluation& ev);

}  // namespace voxloom::slicer
