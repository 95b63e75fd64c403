// Bottom up: the transform fills all coarser levels.
#pragma once

#include "plugins/codec-wavelet/coefficient_counts.h"
#include "plugins/codec-wavelet/level_store.h"
#include "plugins/codec-wavelet/memory_plan.h"
#include "plugins/codec-wavelet/sample.h"

namespace voxloom::wavelet {

// What the passes over a volume are about, and what the first one leaves for the others.
struct Encoding {
    const Volume& volume;
    const EncodeOptions& options;
    std::stop_token stop;
    MemoryPlan memory;
    TreeDesc tree;                      // map and quantiser change while a step is looked for
    std::vector<LevelStore> original;   // integers of the levels; [0] is not used
    Sample sample;
    CoefficientCounts counts;           // of the details, where a step is looked for
    double transform_seconds = 0;       // CPU time of the last analysis without reading

    ScalarType type() const { return tree.bricks.volume.type; }
    const ValueRange& range() const { return *tree.bricks.volume.range; }
    // Of a family above level 0.
    FamilyCodec::Planes originals(FamilyId family) const;
    Mask mask(FamilyId family) const;
};

// Families of a level whose details are counted, at most.
inline constexpr std::int64_t kCountedFamilies = 2048;

// Reads the volume once. Fills the levels by tree.map and, where the volume's range is not known, the range.
void analyse(Encoding& e, bool counts, const Progress& progress);

}  // namespace voxloom::wavelet
