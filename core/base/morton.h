// An order of places in which what is near stays near.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>

namespace voxloom {

// Bits of x, y and z in turns, x lowest; all of them from 0 to 2^21 - 1.
inline std::uint64_t morton(glm::ivec3 p) {
    std::uint64_t code = 0;
    for (int bit = 0; bit < 21; ++bit)
        for (int a = 0; a < 3; ++a) code |= std::uint64_t(p[a] >> bit & 1) << (3 * bit + a);
    return code;
}

}  // namespace voxloom
