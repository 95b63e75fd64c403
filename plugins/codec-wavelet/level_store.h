// Integers of one level, a plane for each component, written and read in boxes.
#pragma once

#include <vector>

#include "core/base/buffer.h"
#include "plugins/codec-wavelet/tree.h"

namespace voxloom::wavelet {

class LevelStore {
  public:
    LevelStore() = default;
    LevelStore(Index3 dims, int components) : dims_(dims) {
        for (int c = 0; c < components; ++c)
            planes_.emplace_back(checked_product(dims, sizeof(std::int32_t), "a level of the tree"), "a level of the tree");
    }
    Index3 dims() const { return dims_; }
    const std::int32_t* plane(std::size_t component) const { return planes_[component].as<std::int32_t>().data(); }

    // The part `box` of values that fill `values_box`. Disjoint boxes may be written from several threads.
    void write(const Box& box, const FamilyCodec::Planes& values, const Box& values_box) {
        for (std::size_t c = 0; c < planes_.size(); ++c)
            copy_box(box, reinterpret_cast<const std::byte*>(values[c].data()), values_box, planes_[c].data(),
                     Box::of(dims_), sizeof(std::int32_t));
    }
    FamilyCodec::Planes read(const Box& box) const {
        FamilyCodec::Planes values(planes_.size(), std::vector<std::int32_t>(box.voxels()));
        for (std::size_t c = 0; c < planes_.size(); ++c)
            copy_box(box, planes_[c].data(), Box::of(dims_), reinterpret_cast<std::byte*>(values[c].data()), box,
                     sizeof(std::int32_t));
        return values;
    }

  private:
    Index3 dims_{0};
    std::vector<Buffer> planes_;
};

}  // namespace voxloom::wavelet
