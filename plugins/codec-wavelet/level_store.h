// Integers of one level, stored brick by brick, so that a family's are few long runs even in a file.
#pragma once

#include "plugins/codec-wavelet/byte_store.h"
#include "plugins/codec-wavelet/tree.h"

namespace voxloom::wavelet {

class LevelStore {
  public:
    LevelStore() = default;
    // Of so many planes.
    LevelStore(const TreeDesc& tree, int level, int planes, bool in_memory);
    // What the store of a level takes.
    static std::uint64_t bytes(const TreeDesc& tree, int level, int planes);

    // The part `box` of values that fill `values_box`; a store in a file takes whole bricks. Disjoint boxes may be
    // written from several threads.
    void write(const Box& box, const FamilyCodec::Planes& values, const Box& values_box);
    FamilyCodec::Planes read(const Box& box) const;
    // One plane, to a dense array over `box`.
    void read(const Box& box, int plane, std::int32_t* out) const;

  private:
    std::uint64_t place(Index3 brick, int plane) const;
    template <class Use>
    void each_brick(const Box& box, const Use& use) const;

    Index3 dims_{0}, brick_{1}, grid_{0};
    int planes_ = 1;
    ByteStore store_;
};

}  // namespace voxloom::wavelet
