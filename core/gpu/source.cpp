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

struct Layout {
    int channels = 1;       // of the texture
    int from = 0;           // first component
    bool wide = false;      // float instead of 16-bit integer texels
    bool validity = false;
    double offset = 0, scale = 1;
};

GLenum format_of(const Layout& l) {
    if (l.wide) return l.channels == 1 ? GL_R32F : l.channels == 2 ? GL_RG32F : GL_RGBA32F;
    return l.channels == 1 ? GL_R16 : l.channels == 2 ? GL_RG16 : GL_RGBA16;
}

// Voxels [begin, end) to texels, in double before rounding.
template <class T, class Out>
void convert(const T* voxels, const std::uint8_t* mask, int components, const Layout& l,
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
    for (std::size_t i = begin; i < end; ++i) {
        const T* v = voxels + i * std::size_t(components) + l.from;
        bool valid = !mask || mask[i];
        if constexpr (std::is_floating_point_v<T>)
            for (int c = 0; c < std::min(values, components - l.from); ++c)
                valid = valid && std::isfinite(v[c]);
        for (int c = 0; c < values; ++c) {
            double value = c < components - l.from ? (double(v[c]) - l.offset) * to_unit : 1.0;
            *out++ = valid ? quantise(value) : Out(0);
        }
        if (l.validity) *out++ = quantise(valid ? 1.0 : 0.0);
    }
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

    Layout l;
    l.wide = bytes_of(desc.type) > 2;
    l.validity = desc.has_mask;
    if (is_float(desc.type) && !l.validity) {
        with_type(desc.type, [&](auto t) {
            using T = decltype(t);
            std::atomic<bool> found = false;
            parallel_for(0, std::int64_t(desc.voxels()) * desc.components, 1 << 20,
                         [&](std::int64_t lo, std::int64_t hi) {
                             if (!found && any_not_finite(reinterpret_cast<const T*>(data) + lo,
                                                          std::size_t(hi - lo)))
                                 found = true;
                         }, stop);
            l.validity = found;
        });
    }
    // Colour with invalid voxels keeps no room for validity: they are black and, where there is an
    // alpha, transparent.
    l.from = desc.color ? 0 : component;
    if (desc.color) l.validity = false;
    l.channels = desc.color ? 4 : l.validity ? 2 : 1;

    if (desc.color) {
        // Fractions of the type's maximum; floats are fractions as they are.
        l.scale = is_float(desc.type) ? 1.0 : limits_of(desc.type).second;
    } else if (l.wide) {
        ValueRange range = value_range(volume, stop);
        l.offset = range.min;
        l.scale = range.max > range.min ? range.max - range.min : 1.0;
        if (!std::isfinite(l.scale))
            fail("the values of this volume span more than a double can hold");
    } else {
        // Every integer has its own texel: 8-bit values times 257; signed ones from the smallest on, as
        // small texels are interpolated with small absolute error.
        auto [lo, hi] = limits_of(desc.type);
        l.offset = lo < 0 ? std::clamp(value_range(volume, stop).min, lo, hi) : lo;
        l.scale = hi - lo;
    }

    auto texture = std::make_shared<Texture>(
        make_texture(GL_TEXTURE_3D, format_of(l), dims, GL_LINEAR, "the volume"));
    const std::size_t slice = std::size_t(dims.x) * std::size_t(dims.y);
    const int step = slices_at_a_time(dims, std::size_t(l.channels) * (l.wide ? 4 : 2));
    Buffer staging(slice * std::size_t(step) * std::size_t(l.channels) * (l.wide ? 4 : 2), "upload");
    Buffer mask;
    if (desc.has_mask) mask = Buffer(slice * std::size_t(step), "mask");
    for (int z = 0; z < dims.z; z += step) {
        const int n = std::min(step, dims.z - z);
        const std::size_t count = slice * std::size_t(n);
        if (desc.has_mask)
            volume.read_mask({{0, 0, z}, {dims.x, dims.y, z + n}},
                             mask.as<std::uint8_t>().subspan(0, count));
        with_type(desc.type, [&](auto t) {
            using T = decltype(t);
            auto voxels = reinterpret_cast<const T*>(data) +
                          slice * std::size_t(z) * std::size_t(desc.components);
            auto valid = desc.has_mask ? mask.as<std::uint8_t>().data() : nullptr;
            parallel_for(0, std::int64_t(count), 1 << 16, [&](std::int64_t lo, std::int64_t hi) {
                if (l.wide)
                    convert(voxels, valid, desc.components, l, std::size_t(lo), std::size_t(hi),
                            staging.as<float>().data());
                else
                    convert(voxels, valid, desc.components, l, std::size_t(lo), std::size_t(hi),
                            staging.as<std::uint16_t>().data());
            }, stop);
        });
        const GLenum channels[] = {GL_RED, GL_RG, GL_RGB, GL_RGBA};
        upload(*texture, {0, 0, z}, {dims.x, dims.y, n}, channels[l.channels - 1],
               l.wide ? GL_FLOAT : GL_UNSIGNED_SHORT, staging.data());
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
