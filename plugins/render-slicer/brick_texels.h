// What of a brick goes to the GPU: texels, made of decoded voxels, and which values lie where in it.
#pragma once

#include <array>
#include <optional>
#include <stop_token>
#include <vector>

#include "core/data/brick_cache.h"
#include "core/data/transfer_function.h"
#include "core/gpu/source.h"

namespace voxloom::slicer {

// What is kept of a voxel.
struct Texels {
    gpu::TexelLayout layout;               // of its value
    std::optional<double> gradient_side;   // a gradient too, smoothed so; see Gradients
    float gradient_scale = 1;              // of its unit, per step of the brick's level
    TransferPtr transfer;                  // colour and optical depth too, where not null ...
    double slab = 1;                       // ... of a slab so thick
    bool mixed = false;                    // towards coarser neighbours the parent is mixed in
    std::uint64_t bytes() const { return layout.bytes() + (gradient_side ? 8 : 0) + (transfer ? 16 : 0); }
};

// How much of its parent is mixed into a brick's texels at each corner; see SelectedBrick.
using CornerBlend = std::array<float, 8>;

struct WantedBrick {
    BrickId id;
    CornerBlend blend{};
    bool blends() const { return blend != CornerBlend{}; }
};

// Voxels of level 0 around a block that a square of pixels may meet together with it. Around a brick one more is
// decoded, as the last of them lie between two voxels.
inline constexpr int kReach = 3, kAround = kReach + 1;

// Where the texels of a brick and its apron go, x fastest; null where they are not kept.
struct TexelRows {
    std::byte* values;
    std::int16_t* gradients;  // 4 a voxel
    glm::vec4* colours;
};
struct FilledBrick {
    // Smallest and largest value within that reach of each block of `block` cells, x fastest; lo > hi where
    // nothing is valid. Where the parent is mixed in, its values count as well.
    std::vector<glm::vec2> ranges;
    bool found_invalid = false;  // a value that is not finite
};
// Decodes through the cache of decoded bricks. [any thread]
//
// The parent is mixed in by shares that are trilinear between the corners, at the brick's own voxels. Where the
// share is 1 that is what the parent shows everywhere, since a cell of the parent is whole cells of the brick: a
// face between levels is the same from both sides. The shares are those of LaMar et al., 2000, section 4.2.
// `blends[0]` is the brick's; the others are those of its neighbours before it (bit a: along axis a), whose last
// voxels are in the apron.
FilledBrick fill_texels(const BricksPtr& bricks, BrickId brick, const std::array<CornerBlend, 8>& blends, const Texels& texels,
                        Apron apron, glm::ivec3 block, const TexelRows& out, const std::stop_token& stop);
// Of a neighbour before a brick that nobody wants: shares go on as they are on the brick's faces.
CornerBlend continued(const CornerBlend& blend, int neighbour);

}  // namespace voxloom::slicer
