// The tree of families: where each stands, how its bytes become voxels, and, for the encoder, back.
//
// The family (l, i) holds the bricks of level l whose parent is brick i of level l + 1. The root family
// (top, 0) holds the one brick of the coarsest level; its low band is taken further apart down to a single
// voxel, so that nothing is stored as it is.
//
// Families end at the faces of their bricks, where lines are mirrored: a coarse level drawn in place of a finer
// one, interpolated across the face, then misses it by up to half a cell. With shared faces a family takes
// in the first layer of its upper neighbours' samples, too. Both do the same to the face between them
// (Ends of lifting.h), and zero details are linear interpolation across it. The face's details are
// stored with either family, which costs a few per cent; a family still needs no sibling.
//
// Bytes of a family: for each component the coder's bytes, length first; at level 0 then the distances and
// the patches of exact_layer.h, the former with their length. A family without any is not stored.
#pragma once

#include <memory>
#include <string>

#include "core/data/bricks.h"
#include "plugins/codec-wavelet/coder.h"
#include "plugins/codec-wavelet/quantiser.h"
#include "plugins/codec-wavelet/value_map.h"

namespace voxloom::wavelet {

enum class Faces : std::uint8_t { block = 0, shared = 1 };

struct FamilyId {
    int level = 0;        // of the children
    glm::ivec3 index{0};  // of the parent
};

struct TreeDesc {
    BricksDesc bricks;
    Rounding rounding = Rounding::unbiased;
    Faces faces = Faces::block;
    CoderKind coder = CoderKind::dense;
    ValueMap map;
    bool split = true;        // details are split along axes that are not halved
    bool distances = false;   // level 0 has exact distances: lossless though the map is not exact
    Quantiser quantiser;
    std::string provenance;

    int top() const { return int(bricks.levels.size()) - 1; }
    bool empty() const { return bricks.volume.voxels() == 0; }
    // Does the tree hold integers that the voxels do not tell?
    bool has_state() const { return !map.identity() || is_float(bricks.tree_type); }
};

// What decoded bricks hold: the coarse levels of integers overshoot their type.
ScalarType tree_type_of(ScalarType type);

glm::ivec3 families_of(const TreeDesc& tree, int level);      // grid
FamilyId family_of(const TreeDesc& tree, BrickId brick);
Box own_box(const TreeDesc& tree, FamilyId family);            // of its bricks, in its level
Box box_of(const TreeDesc& tree, FamilyId family);             // of what it codes: shared faces, too
Shape shape_of(const TreeDesc& tree, FamilyId family);         // of box_of(); not of the root
// What is kept of a decoded brick: above level 0 all that its children's family needs, which is one more layer
// where faces are shared.
Box stored_box(const TreeDesc& tree, BrickId brick);

class FamilyCodec {
  public:
    // `coder` must outlive the codec.
    FamilyCodec(const TreeDesc& tree, const Coder& coder) : tree_(tree), coder_(coder) {}

    // One plane of integers (shape.voxels(), x fastest) for each component.
    using Planes = std::vector<std::vector<std::int32_t>>;
    // Keeps the part `to` of the box `from`.
    static void crop(Planes& planes, const Box& from, const Box& to);

    // --- encoder ---
    // Transforms, quantises and restores: `planes` hold the samples of the family's box and become what the
    // decoder will get. `low` are the decoded parent's, empty for the root. `use` sees each plane's
    // details (not the root's).
    enum class After { restored, spoiled };  // spoiled saves the way back, where nobody looks at `planes` again
    template <class Use>
    void restore(FamilyId family, const Planes& low, Planes& planes, const Use& use, After after = After::restored) const;
    // The same, and appends the coder's bytes.
    void encode(FamilyId family, const Planes& low, Planes& planes, Bytes& out, After after = After::restored) const;

    // --- decoder ---
    // Bytes of the coder's part are taken off `in`.
    void decode(FamilyId family, const Planes& low, ByteReader& in, Planes& planes) const;

    // Voxels of the volume's type, components interleaved, from the tree's integers; clamped to the
    // volume's range, where it is known, and its type.
    void to_voxels(const Planes& planes, std::size_t count, std::byte* out) const;
    // The same for the brick `part` of planes of `box`, in tree_type; only for small integers: types of up to 16 bits
    // whose voxels are the tree's integers, shifted.
    bool has_small_integers() const;
    void to_brick(const Planes& planes, const Box& box, const Box& part, std::byte* out) const;

  private:
    Details details_of(FamilyId family, const std::vector<std::int32_t>& low, std::int32_t* box) const;
    void set_steps(Details& d, glm::ivec3 fine_stride) const;
    void rebuild(Details& d) const;
    void encode_root(std::vector<std::int32_t>& plane, glm::ivec3 dims, glm::ivec3 stride, Bytes& out) const;
    void decode_root(std::vector<std::int32_t>& plane, glm::ivec3 dims, glm::ivec3 stride, ByteReader& in) const;

    const TreeDesc& tree_;
    const Coder& coder_;
};

template <class Use>
void FamilyCodec::restore(FamilyId family, const Planes& low, Planes& planes, const Use& use, After after) const {
    Bytes nothing;
    for (std::size_t c = 0; c < planes.size(); ++c) {
        if (family.level == tree_.top()) {
            const LevelDesc& level = tree_.bricks.levels.back();
            encode_root(planes[c], glm::ivec3(level.dims), level.stride, nothing);
            continue;
        }
        thread_local std::vector<std::int32_t> scratch;
        Details d = details_of(family, low[c], planes[c].data());
        split_family(d.q, d.shape, tree_.rounding, scratch);
        quantise(d, tree_.quantiser);
        use(d);
        if (after == After::spoiled) continue;
        rebuild(d);
        join_family(d.q, d.shape, tree_.rounding, scratch);
    }
}

}  // namespace voxloom::wavelet
