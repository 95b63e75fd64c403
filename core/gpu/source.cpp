#include "core/gpu/source.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <map>
#include <mutex>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/gpu/thread.h"

namespace voxloom::gpu {

namespace {

std::mutex providers_mutex;
std::map<std::string, SourceProvider>& providers() {
    static std::map<std::string, SourceProvider> map;
    return map;
}

const Module kDense = {"source-dense", R"(
uniform sampler3D dense_texture;
uniform vec3 dense_inverse_dims;
uniform ivec3 dense_last;
vec4 fetch_voxel(ivec3 i) { return texelFetch(dense_texture, clamp(i, ivec3(0), dense_last), 0); }
vec4 sample_linear(vec3 p) { return texture(dense_texture, (p + 0.5) * dense_inverse_dims); }
)"};

// Slices converted and uploaded at a time: enough to keep all threads busy, little enough for prompt
// cancellation and small staging memory.
int slices_at_a_time(glm::ivec3 dims, std::size_t texel_bytes) {
    double slice = double(dims.x) * double(dims.y) * double(texel_bytes);
    return int(std::clamp(double(32u << 20) / std::max(slice, 1.0), 1.0, double(std::max(dims.z, 1))));
}

// Voxels [begin, end) to texels, in double before rounding.
template <class T, class Out>
bool convert(const T* voxels, const std::uint8_t* mask, int components, const TexelLayout& l,
             std::size_t begin, std::size_t end, Out* out) {
    const double to_unit = 1.0 / l.scale;
    auto quantise = [](double u) {
        if constexpr (std::is_floating_point_v<Out>)
            return Out(u);
        else
            return Out(std::lround(std::clamp(u, 0.0, 1.0) * 65535.0));
    };
    out += begin * std::size_t(l.channels);
    const int values = l.validity ? l.channels - 1 : l.channels;
    bool found = false;  // one that is not finite
    for (std::size_t i = begin; i < end; ++i) {
        const T* v = voxels + i * std::size_t(components) + l.from;
        bool valid = !mask || mask[i];
        if constexpr (std::is_floating_point_v<T>)
            for (int c = 0; c < std::min(values, components - l.from); ++c) {
                found = found || !std::isfinite(v[c]);
                valid = valid && std::isfinite(v[c]);
            }
        for (int c = 0; c < values; ++c) {
            double value = c < components - l.from ? (double(v[c]) - l.offset) * to_unit : 1.0;
            *out++ = valid ? quantise(value) : Out(0);
        }
        if (l.validity) *out++ = quantise(valid ? 1.0 : 0.0);
    }
    return found;
}

template <class T>
bool any_not_finite(const T* v, std::size_t n) {
    if constexpr (std::is_floating_point_v<T>)
        for (std::size_t i = 0; i < n; ++i)
            if (!std::isfinite(v[i])) return true;
    return false;
}

}  // namespace

void register_source_provider(std::string name, SourceProvider provider) {
    std::lock_guard lock(providers_mutex);
    providers()[std::move(name)] = std::move(provider);
}

std::optional<FieldSource> provided_source(const Value& value, const SourceRequest& request) {
    std::map<std::string, SourceProvider> known;
    {
        std::lock_guard lock(providers_mutex);
        known = providers();
    }
    for (const auto& [name, provider] : known)
        if (auto source = provider(value, request)) return source;
    return std::nullopt;
}

GLenum TexelLayout::internal_format() const {
    if (wide) return channels == 1 ? GL_R32F : channels == 2 ? GL_RG32F : GL_RGBA32F;
    return channels == 1 ? GL_R16 : channels == 2 ? GL_RG16 : GL_RGBA16;
}

GLenum TexelLayout::format() const {
    const GLenum formats[] = {GL_RED, GL_RG, GL_RGB, GL_RGBA};
    return formats[channels - 1];
}

TexelLayout texel_layout(const VolumeDesc& desc, int component, ValueRange range, bool validity, bool between) {
    TexelLayout l;
    // Steps of a texel from one integer to the next.
    const double steps = between ? std::floor(65535 / std::clamp(range.extent(), 1.0, 65535.0)) : 1;
    const bool precise = !between || desc.color || steps * std::max(range.extent(), 1.0) >= 50000;
    l.wide = bytes_of(desc.type) > 2 || !precise;
    l.validity = validity && !desc.color;
    l.from = desc.color ? 0 : component;
    l.channels = desc.color ? 4 : l.validity ? 2 : 1;
    if (desc.color) {
        // Fractions of the type's maximum; floats are fractions as they are.
        l.scale = is_float(desc.type) ? 1.0 : limits_of(desc.type).second;
    } else if (l.wide) {
        l.offset = range.min;
        l.scale = range.max > range.min ? range.max - range.min : 1.0;
        if (!std::isfinite(l.scale))
            fail("the values of this volume span more than a double can hold");
    } else if (between) {
        l.offset = range.min;
        l.scale = 65535 / steps;
    } else {
        // Every integer has its own texel: 8-bit values times 257; signed ones from the smallest on, as
        // small texels are interpolated with small absolute error.
        auto [lo, hi] = limits_of(desc.type);
        l.offset = lo < 0 ? std::clamp(range.min, lo, hi) : lo;
        l.scale = hi - lo;
    }
    return l;
}

bool to_texels(const std::byte* voxels, const std::uint8_t* mask, const VolumeDesc& desc,
               const TexelLayout& l, std::size_t begin, std::size_t end, std::byte* texels) {
    return with_type(desc.type, [&](auto t) {
        auto v = reinterpret_cast<const decltype(t)*>(voxels);
        return l.wide ? convert(v, mask, desc.components, l, begin, end, reinterpret_cast<float*>(texels))
                      : convert(v, mask, desc.components, l, begin, end,
                                reinterpret_cast<std::uint16_t*>(texels));
    });
}

const Module& dense_module() { return kDense; }

void check_fits_texture(const VolumeDesc& desc) {
    const int limit = context_info().max_texture_3d;
    if (desc.dims.x > limit || desc.dims.y > limit || desc.dims.z > limit)
        fail("a volume of {} does not fit into one texture (this OpenGL driver ends at {} a side); "
             "crop it or draw a coarser level of it", summary(desc), limit);
}

VoxelSource upload_dense(const Volume& volume, int component, const std::stop_token& stop,
                         std::uint64_t& bytes) {
    const VolumeDesc& desc = volume.desc();
    const std::byte* data = volume.data();
    const glm::ivec3 dims(desc.dims);
    check_fits_texture(desc);

    bool validity = desc.has_mask;
    if (is_float(desc.type) && !validity) {
        with_type(desc.type, [&](auto t) {
            using T = decltype(t);
            std::atomic<bool> found = false;
            parallel_for(0, std::int64_t(desc.voxels()) * desc.components, 1 << 20,
                         [&](std::int64_t lo, std::int64_t hi) {
                             if (!found && any_not_finite(reinterpret_cast<const T*>(data) + lo,
                                                          std::size_t(hi - lo)))
                                 found = true;
                         }, stop);
            validity = found;
        });
    }
    const bool by_range = !desc.color && (bytes_of(desc.type) > 2 || limits_of(desc.type).first < 0);
    const TexelLayout l = texel_layout(desc, component, by_range ? value_range(volume, stop) : ValueRange{},
                                       validity);

    auto texture = std::make_shared<Texture>(
        make_texture(GL_TEXTURE_3D, l.internal_format(), dims, GL_LINEAR, "the volume"));
    const std::size_t slice = std::size_t(dims.x) * std::size_t(dims.y);
    const int step = slices_at_a_time(dims, l.bytes());
    Buffer staging(slice * std::size_t(step) * l.bytes(), "upload");
    Buffer mask;
    if (desc.has_mask) mask = Buffer(slice * std::size_t(step), "mask");
    for (int z = 0; z < dims.z; z += step) {
        const int n = std::min(step, dims.z - z);
        const std::size_t count = slice * std::size_t(n);
        if (desc.has_mask)
            volume.read_mask({{0, 0, z}, {dims.x, dims.y, z + n}},
                             mask.as<std::uint8_t>().subspan(0, count));
        const std::byte* voxels = data + slice * std::size_t(z) * desc.voxel_bytes();
        const std::uint8_t* valid = desc.has_mask ? mask.as<std::uint8_t>().data() : nullptr;
        parallel_for(0, std::int64_t(count), 1 << 16, [&](std::int64_t lo, std::int64_t hi) {
            to_texels(voxels, valid, desc, l, std::size_t(lo), std::size_t(hi), staging.data());
        }, stop);
        upload(*texture, {0, 0, z}, {dims.x, dims.y, n}, l.format(), l.type(), staging.data());
    }
    check_errors("uploading the volume");
    bytes += texture->bytes;

    VoxelSource source;
    source.glsl = kDense;
    source.linear = true;
    source.color = desc.color;
    source.has_validity = l.validity;
    source.offset = l.offset;
    source.scale = l.scale;
    source.textures = {{"dense_texture", texture}};
    return source;
}

TexturePtr upload_computed(glm::ivec3 dims, GLenum format, std::string_view what,
                           const std::function<void(int z, glm::vec4* out)>& fill,
                           const std::stop_token& stop) {
    auto texture =
        std::make_shared<Texture>(make_texture(GL_TEXTURE_3D, format, dims, GL_LINEAR, what));
    const bool snorm = format == GL_RGBA16_SNORM;
    const std::size_t slice = std::size_t(dims.x) * std::size_t(dims.y);
    const int step = slices_at_a_time(dims, snorm ? 8 : 16);
    Buffer staging(slice * std::size_t(step) * (snorm ? 8 : 16), "upload");
    for (int z = 0; z < dims.z; z += step) {
        const int n = std::min(step, dims.z - z);
        parallel_for(z, z + n, 1, [&](std::int64_t lo, std::int64_t hi) {
            std::vector<glm::vec4> one(snorm ? slice : 0);
            for (std::int64_t k = lo; k < hi; ++k) {
                const std::size_t at = std::size_t(k - z) * slice;
                if (!snorm) {
                    fill(int(k), staging.as<glm::vec4>().data() + at);
                    continue;
                }
                fill(int(k), one.data());
                std::int16_t* out = staging.as<std::int16_t>().data() + at * 4;
                for (const glm::vec4& v : one)
                    for (int c = 0; c < 4; ++c)
                        *out++ = std::int16_t(std::lrint(std::clamp(v[c], -1.0f, 1.0f) * 32767.0f));
            }
        }, stop);
        upload(*texture, {0, 0, z}, {dims.x, dims.y, n}, GL_RGBA, snorm ? GL_SHORT : GL_FLOAT,
               staging.data());
    }
    check_errors("uploading a computed texture");
    return texture;
}

}  // namespace voxloom::gpu
