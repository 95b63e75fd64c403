// The integer 5/3 wavelet (Calderbank et al. 1998; Le Gall and Tabatabai) on one box of voxels.
//
// Along a line of n samples, even samples become the low band s, odd ones the high band d:
//   predict  d[i] = x[2i+1] - ((x[2i] + x[2i+2] + p) >> 1)
//   update   s[i] = x[2i]   + ((d[i-1] + d[i] + 2) >> 2)
// with whole-sample mirrors at both ends, whatever the parity of n; n = 1 is left as it is. p = 1 makes
// the rounding of the two steps cancel: with p = 0 (JPEG 2000) every pass brightens the low band by
// a quarter of a unit on the average, and coarse levels of 8-bit data visibly.
//
// Zero details mean linear interpolation. Forward goes x, y, z, inverse z, y, x: integer lifting does
// not commute, so no other order gives the input back.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

namespace voxloom::wavelet {

enum class Rounding : std::uint8_t {
    jpeg2000 = 0,  // p = 0
    unbiased = 1,  // p = 1
};

// ceil(n / 2) on the halved axes: the voxels of the low band.
inline glm::ivec3 low_dims(glm::ivec3 dims, glm::bvec3 halved) {
    return glm::mix(dims, (dims + 1) / 2, halved);
}

// Ends of lines whose samples a neighbouring box has, too. Such a sample passes on unfiltered, as the low
// sample that it is: then whatever becomes of a face depends on the face's samples alone, and both boxes get the
// same. A high end must be an even sample, that is, lines of an odd length.
struct Ends {
    glm::bvec3 lo{false}, hi{false};
};

// Both work in place on dims.x * dims.y * dims.z samples, x fastest. The transformed box has its low
// band in front along each halved axis: band (h_x, h_y, h_z) is the sub-box from h ? low : 0 to
// h ? dims : low. `scratch` grows to the size of the box and can be used again. T is int16_t or int32_t;
// arithmetic wraps, so that any input is safe and lossless, but bands make sense only within the bounds
// of peak_after().
template <class T>
void forward(T* box, glm::ivec3 dims, glm::bvec3 halved, Rounding rounding, std::vector<T>& scratch, Ends shared = {});
template <class T>
void inverse(T* box, glm::ivec3 dims, glm::bvec3 halved, Rounding rounding, std::vector<T>& scratch, Ends shared = {});

// No coefficient, and no sum on the way to one, exceeds this after any number of levels, when the
// input lies in [min, max]. From the L1 norms of the mirrored analysis functionals: low <= 1.836
// and high <= 2.970 along each axis, high bands blind to a constant. Shared ends make them smaller.
double peak_after(double min, double max);

}  // namespace voxloom::wavelet
