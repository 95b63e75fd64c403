#include "plugins/codec-wavelet/mask_layer.h"

#include <algorithm>

#include "core/base/error.h"
#include "plugins/codec-wavelet/range_coder.h"

namespace voxloom::wavelet {

namespace {

enum class Kind : std::uint8_t { none = 1, plane = 2 };

// Each sample in the context of the four before it in space and of the two before it along x.
template <class Coding>
void code_plane(Coding& coding, Mask& mask, Index3 dims) {
    std::array<Chance, 32> chances;
    const auto row = std::size_t(dims.x), slice = row * std::size_t(dims.y);
    std::size_t i = 0;
    for (std::int64_t z = 0; z < dims.z; ++z)
        for (std::int64_t y = 0; y < dims.y; ++y)
            for (std::int64_t x = 0; x < dims.x; ++x, ++i) {
                const unsigned west = x > 0 ? mask[i - 1] : 1, north = y > 0 ? mask[i - row] : west, up = z > 0 ? mask[i - slice] : north;
                const unsigned far_west = x > 1 ? mask[i - 2] : west, north_east = y > 0 && x + 1 < dims.x ? mask[i - row + 1] : north;
                Chance& chance = chances[west | north << 1 | up << 2 | far_west << 3 | north_east << 4];
                const std::uint32_t p = std::clamp<std::uint32_t>(chance.p, 24, 65512);
                mask[i] = coding.code(mask[i] != 0, p);
                chance.learn(mask[i] != 0, 250);
            }
}

}  // namespace

void encode_mask(const Mask& mask, Index3 dims, Bytes& out) {
    const bool any = std::find(mask.begin(), mask.end(), 1) != mask.end();
    if (any && std::find(mask.begin(), mask.end(), 0) == mask.end()) return;
    out.push_back(std::byte(any ? Kind::plane : Kind::none));
    if (!any) return;
    RangeEncoder encoder(out);
    Mask copy = mask;
    code_plane(encoder, copy, dims);
    encoder.finish();
}

Mask decode_mask(std::span<const std::byte> in, Index3 dims) {
    Mask mask(Box::of(dims).voxels(), 1);
    if (in.empty()) return mask;
    switch (Kind(in[0])) {
        case Kind::none: std::fill(mask.begin(), mask.end(), std::uint8_t(0)); return mask;
        case Kind::plane: break;
        default: fail("its mask is of no known kind");
    }
    RangeDecoder decoder(in.subspan(1));
    code_plane(decoder, mask, dims);
    return mask;
}

Mask low_mask(const Mask& mask, const Shape& shape) {
    Mask from = mask;
    glm::ivec3 dims = shape.dims;
    for (int a = 0; a < 3; ++a) {
        if (!shape.halved[a] || dims[a] == 1) continue;
        glm::ivec3 low = dims;
        low[a] = (dims[a] + 1) / 2;
        const Shape fine{dims}, coarse{low};
        Mask to(coarse.voxels());
        for (int z = 0; z < low.z; ++z)
            for (int y = 0; y < low.y; ++y)
                for (int x = 0; x < low.x; ++x) {
                    glm::ivec3 at(x, y, z);
                    const glm::ivec3 place = at;
                    const int centre = 2 * at[a];
                    std::uint8_t valid = 0;
                    for (int i = std::max(centre - 1, 0); i <= std::min(centre + 1, dims[a] - 1); ++i) {
                        at[a] = i;
                        valid |= from[fine.at(at)];
                    }
                    to[coarse.at(place)] = valid;
                }
        from = std::move(to);
        dims = low;
    }
    return from;
}

}  // namespace voxloom::wavelet
