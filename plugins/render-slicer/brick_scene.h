// What is drawn of Bricks: which brick is seen where, and all of it on the GPU.
//
// Space is a grid of cells, each as large as the smallest thing drawn: a brick, or an octant of one that
// finer bricks have replaced in part. A cell names a page, the brick or the octant that it lies in, or
// none; a page says where its brick lies in the atlas, what it blends into, and how far apart its slices
// are. So a ray walks from page to page, and a fragment draws all of them. Bricks of one level that lie side
// by side in the atlas are one page; where that is all there is, it is drawn as a volume is.
#pragma once

#include "core/base/hash.h"
#include "core/data/selection.h"
#include "core/gpu/source.h"
#include "plugins/render-slicer/atlas.h"
#include "plugins/render-slicer/pages.h"

namespace voxloom {
class Evaluation;
}

namespace voxloom::slicer {

// Which blocks of space can be seen, in the bricks that are drawn there, and how far to leap; as for a dense
// volume. It depends on no camera.
struct BrickOccupancy {
    gpu::TexturePtr texture;         // null: nothing is seen
    glm::vec3 block_size{1.0f};      // index coordinates
    glm::ivec3 blocks{0};
    std::size_t seen = 0;            // blocks
};

struct BrickScene {
    std::shared_ptr<const gpu::FieldSource> field;  // source-bricks, or source-level where it is one level
    std::shared_ptr<const Atlas> atlas;
    ValueRange range;                // of every value that any brick can hold
    std::shared_ptr<const BrickOccupancy> occupancy;  // null: there are no bricks
    bool one_level = false;          // one page is all there is
    glm::vec3 cell_size{1.0f};       // index coordinates
    glm::ivec3 cells{0};
    glm::vec3 slot_at{0.0f}, slot_lo{0.0f}, slot_hi{0.0f}, scale{1.0f};  // of the one page; slot_lo: of all
    glm::vec3 brick_size{1.0f}, brick_hi{0.0f};  // voxels of a brick; the last one of them in its slot
    bool blended = false;            // on some page the shader mixes in its parent
    int steps = 1;                   // slices of pages are 1, 2, ... 2^(steps-1) planes apart; of one level:
    int step = 1;                    // so many

    void set(const gpu::Program& program) const;
};

struct BrickRequest {
    int component = 0;
    Apron apron;
    std::optional<double> gradient_side;  // gradients are stored
    TransferPtr transfer;                 // not null: colours are, of slabs so thick
    double slab = 1;
    // Whether anything with values between lo and hi is seen, where none is below `least`.
    std::function<bool(double least, double lo, double hi)> visible;
    Hash visible_key;                // of all that the answer depends on
    // Bricks that blend get their parents mixed in when they are loaded; else the shader mixes the two. What
    // is interpolated linearly between voxels may be.
    bool mix_when_loaded = false;
    // Whether rays may come to a box of voxels of level 0. Null: pages are not joined, each is a brick.
    std::function<bool(const Box&)> in_view;
    std::uint64_t gpu_bytes = 0;     // that bricks and all tables may take at once ...
    std::uint64_t table_bytes = 0;   // ... and, for each distance of slices, tables that are not made here
};

// What a picture draws of its bricks and where they go; nothing is decoded yet.
struct BrickPlan {
    BricksPtr bricks;
    ValueRange range;                // of every value that any brick can hold
    std::vector<Page> pages;         // empty: nothing can be seen
    std::vector<WantedBrick> wanted;
    PageGrid grid;                   // of the pages, before any are joined
    std::shared_ptr<Atlas> atlas;
    std::vector<BrickId> missing() const;  // on the GPU
};
// selection null: everything at level 0. [OpenGL thread]
BrickPlan plan_bricks(const BricksPtr& bricks, const Selection* selection, const BrickRequest& request, Evaluation& ev);
// Everything wanted is decoded and uploaded, or, of `what_is_there`, what is decoded already: a brick that is
// not gives way to its nearest ancestor that is. [OpenGL thread]
BrickScene load_bricks(BrickPlan& plan, const BrickRequest& request, Evaluation& ev, bool what_is_there = false);

}  // namespace voxloom::slicer
