// How coefficients become numbers and back: a dead-zone quantiser with one step for the whole volume, divided by the
// norm of each band's synthesis function; or the paper's bare threshold (section 3.3).
#pragma once

#include "plugins/codec-wavelet/family.h"

namespace voxloom::wavelet {

// step == 0 means that coefficients are kept as they are.
struct Quantiser {
    double step = 0;          // on level 0, in units of the tree: each band's is step / band_norm()
    double threshold = 0;     // the paper's: smaller coefficients are dropped, others kept whole
    // Numbers of magnitude 1, and larger ones, stand for magnitude + centre steps.
    double centre_one = 0, centre_more = 0;
};

// Where the quantiser rounds: |c| / step below kDeadZone gives 0, else the integer part of it and kRoundUp. A wide dead
// zone costs little error, since small coefficients are many, and saves most of their bits.
inline constexpr double kDeadZone = 0.75, kRoundUp = 0.3;
// A number that stands nearly alone in its block costs ten bits or so, more than the error it saves:
// the zone is wider where the numbers of a block of 4^3 add up to 1, 2, or at most 4. One per cent of the rate.
inline constexpr double kDeadZoneOfOne = 1.1, kDeadZoneOfTwo = 0.95, kDeadZoneOfFour = 0.85;
inline constexpr int kQuantBlock = 4;
inline constexpr double kCentreOne = (kDeadZone + 2 - kRoundUp) / 2 - 1 - 0.12;  // less the density's slope
inline constexpr double kCentreMore = 0.5 - kRoundUp - 0.04;

// Both in place, in all bands but the low one. d.step holds the steps of the bands.
void quantise(Details& d, const Quantiser& quantiser);
void dequantise(Details& d, const Quantiser& quantiser);

}  // namespace voxloom::wavelet
