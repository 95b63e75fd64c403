// Top down, for one quantiser: every level is quantised and restored as the decoder will see it, since the
// coders lean on the restored parent; then all families become bytes, and what they give is measured.
#pragma once

#include "plugins/codec-wavelet/analysis.h"
#include "plugins/codec-wavelet/fine_family.h"

namespace voxloom::wavelet {

// Stands in where no bytes are wanted.
class NoCoder final : public Coder {
  public:
    CoderKind kind() const override { return CoderKind::dense; }
    void encode(const Details&, Bytes&) const override {}
    void decode(std::span<const std::byte>, Details&) const override {}
};

// Voxels that err by more are stored as they are.
double error_bound(const EncodeOptions& options, const TreeDesc& tree);
// Families of the sample that a coder learns from.
std::int64_t families_to_learn_from(CoderKind kind);

// Reads the volume once. Everything of `report` but the rounds is filled in.
std::shared_ptr<const WaveletBricks> emit(const Encoding& e, EncodeReport& report, const Progress& progress);

}  // namespace voxloom::wavelet
