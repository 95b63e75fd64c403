#include "plugins/codec-baseline/samples.h"

#include <algorithm>

namespace voxloom::baseline {

std::string problem_with_samples(const VolumeDesc& volume) {
    if (is_float(volume.type)) return "it codes integers, and these voxels are floating point";
    if (volume.range && volume.range->extent() >= 65536)
        return "it codes integers of up to 16 bits, and these voxels span more";
    return {};
}

std::vector<std::uint16_t> samples_of(const Form& form, std::span<const std::byte> voxels) {
    if (form.bits() > kSampleBits) fail("pictures have up to {} bits, and these voxels span {}", kSampleBits, form.bits());
    const std::size_t components = std::size_t(form.components), count = form.values() / components;
    const std::int64_t low = form.low(), high = std::int64_t(form.range.max);
    std::vector<std::uint16_t> samples(form.values());
    with_type(form.type, [&](auto t) {
        const auto* values = reinterpret_cast<const decltype(t)*>(voxels.data());
        std::uint16_t* to = samples.data();
        for (std::size_t c = 0; c < components; ++c)
            for (std::size_t i = 0; i < count; ++i)
                *to++ = std::uint16_t(std::clamp(std::int64_t(values[i * components + c]), low, high) - low);
    });
    return samples;
}

void voxels_of(const Form& form, std::span<const std::uint16_t> samples, std::span<std::byte> voxels) {
    if (form.bits() > kSampleBits) fail("it has more than {} bits", kSampleBits);
    const std::size_t components = std::size_t(form.components), count = form.values() / components;
    const std::int64_t low = form.low(), most = std::int64_t(form.range.max) - low;
    with_type(form.type, [&](auto t) {
        using T = decltype(t);
        T* values = reinterpret_cast<T*>(voxels.data());
        const std::uint16_t* from = samples.data();
        for (std::size_t c = 0; c < components; ++c)
            for (std::size_t i = 0; i < count; ++i)
                values[i * components + c] = T(low + std::min<std::int64_t>(*from++, most));
    });
}

}  // namespace voxloom::baseline
