// What a shader can fetch and sample from: the GLSL belongs to the plugin that owns the data.
//
// Coordinates in GLSL are index coordinates of the source: voxel i sits at i. A texel is a vec4:
//   x        value, mapped so that value = offset + scale * x (VoxelSource::offset, scale)
//   y        validity where `has_validity`: x is then the value times validity, so that an
//            interpolated x/y renormalises the weights of the valid voxels
//   xyzw     RGB(A), each mapped to 0..1 by the same offset and scale, where `color`
#pragma once

#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "core/data/value.h"
#include "core/gpu/objects.h"
#include "core/gpu/program.h"

namespace voxloom::gpu {

struct SourceTexture {
    std::string sampler;
    TexturePtr texture;
};

// GLSL that defines   vec4 fetch_voxel(ivec3 i)       (i is clamped to the dims by the function)
// and, with linear,   vec4 sample_linear(vec3 p)      (p in index coordinates, clamped)
struct VoxelSource {
    Module glsl;
    bool linear = false;      // without it a reconstruction pays eight fetches
    bool color = false;
    bool has_validity = false;
    double offset = 0, scale = 1;
    std::vector<SourceTexture> textures;
};

// What can be sampled. With own kernels (lattices) the GLSL also defines
//     vec4 reconstruct(vec3 p)     and     vec3 gradient(vec3 p)     per index step, in the units of x
// and the parameters for reconstruction and gradients do not apply.
struct FieldSource {
    VoxelSource voxels;
    bool own_kernels = false;
};

struct SourceRequest {
    int component = 0;
    std::stop_token stop;
};

// Answers for the values that it knows, nothing for the others. [OpenGL thread]
using SourceProvider = std::function<std::optional<FieldSource>(const Value&, const SourceRequest&)>;
void register_source_provider(std::string name, SourceProvider provider);
// The first provider's answer, in order of name. [OpenGL thread]
std::optional<FieldSource> provided_source(const Value& value, const SourceRequest& request);

// How voxels become texels. Integers of up to 16 bits keep every value exactly in R16; wider types and
// floats become R32F over a range, mapped in double. Voxels that are not finite or not valid take a
// second channel where there is one, and are 0.
struct TexelLayout {
    int channels = 1;       // of the texture
    int from = 0;           // first component
    bool wide = false;      // float instead of 16-bit integer texels
    bool validity = false;
    double offset = 0, scale = 1;

    GLenum internal_format() const;
    GLenum format() const;
    GLenum type() const { return wide ? GL_FLOAT : GL_UNSIGNED_SHORT; }
    std::size_t bytes() const { return std::size_t(channels) * (wide ? 4 : 2); }
};
// `range` is that of the values, used where the type alone does not say. Throws Error where it is more
// than a double can hold. Colours have no room for validity: invalid voxels are black and, where there
// is an alpha, transparent. `between`: values between two integers are kept too, within 1e-5 of the range, which all
// of them must lie in.
TexelLayout texel_layout(const VolumeDesc& desc, int component, ValueRange range, bool validity, bool between = false);
// Voxels [begin, end) of a dense array of desc.type to texels; mask may be null. True when one of them
// is not finite.
bool to_texels(const std::byte* voxels, const std::uint8_t* mask, const VolumeDesc& desc,
               const TexelLayout& layout, std::size_t begin, std::size_t end, std::byte* texels);

// Throws Error when a volume exceeds what one 3-D texture can hold here.
void check_fits_texture(const VolumeDesc& desc);

// The dense one: a volume in one 3-D texture. `bytes` receives what was uploaded.
// Throws Error when the volume exceeds the driver's limits. [OpenGL thread]
VoxelSource upload_dense(const Volume& volume, int component, const std::stop_token& stop,
                         std::uint64_t& bytes);

// The GLSL of a dense 3-D texture, as upload_dense's: samplers and uniforms are named dense_texture,
// dense_inverse_dims (vec3) and dense_last (ivec3, the last voxel).
const Module& dense_module();

// Uploads a dense array of vec4 computed slice by slice, for stored gradients and classified voxels:
// fill(z, out) writes dims.x * dims.y texels; it is called from several threads.
TexturePtr upload_computed(glm::ivec3 dims, GLenum format, std::string_view what,
                           const std::function<void(int z, glm::vec4* out)>& fill,
                           const std::stop_token& stop);

}  // namespace voxloom::gpu
