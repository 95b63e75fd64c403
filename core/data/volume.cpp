#include "core/data/volume.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <mutex>

#include "core/base/error.h"
#include "core/base/parallel.h"
#include "core/base/text.h"

namespace voxloom {

namespace {

// Slabs of about this many bytes keep streaming reads in the outer caches and cancellation prompt.
constexpr std::uint64_t kSlabBytes = 8u << 20;

std::int64_t slices_per_slab(const VolumeDesc& desc) {
    std::uint64_t slice = std::uint64_t(desc.dims.x) * std::uint64_t(desc.dims.y) * desc.voxel_bytes();
    return std::max<std::int64_t>(1, std::int64_t(kSlabBytes / std::max<std::uint64_t>(slice, 1)));
}

template <class T>
void widen_range(const T* values, std::size_t count, ValueRange& range) {
    T lo = std::numeric_limits<T>::max(), hi = std::numeric_limits<T>::lowest();
    for (std::size_t i = 0; i < count; ++i) {
        if constexpr (std::is_floating_point_v<T>)
            if (!std::isfinite(values[i])) continue;
        lo = std::min(lo, values[i]);
        hi = std::max(hi, values[i]);
    }
    if (lo > hi) return;
    range.min = std::min(range.min, double(lo));
    range.max = std::max(range.max, double(hi));
}

}  // namespace

glm::dvec3 VolumeDesc::spacing() const {
    return {glm::length(glm::dvec3(index_to_world[0])), glm::length(glm::dvec3(index_to_world[1])),
            glm::length(glm::dvec3(index_to_world[2]))};
}

void VolumeDesc::set_spacing_origin(glm::dvec3 spacing, glm::dvec3 origin) {
    index_to_world = glm::dmat4(1.0);
    for (int a = 0; a < 3; ++a) index_to_world[a][a] = spacing[a];
    index_to_world[3] = glm::dvec4(origin, 1.0);
}

std::uint64_t VolumeDesc::dense_bytes() const {
    return checked_product(dims, voxel_bytes(), name.empty() ? "volume" : name);
}

SamplingBox sampling_box(const VolumeDesc& desc) {
    SamplingBox box{glm::dvec3(0.0), glm::dvec3(desc.dims) - 1.0};
    for (int a = 0; a < 3; ++a)
        if (desc.dims[a] == 1) {
            box.lo[a] = -0.5;
            box.hi[a] = 0.5;
        }
    return box;
}

std::string summary(const VolumeDesc& desc) {
    glm::dvec3 s = desc.spacing();
    std::string text = fmt::format("{} x {} x {} {}", desc.dims.x, desc.dims.y, desc.dims.z,
                                   name_of(desc.type));
    if (desc.color)
        text += desc.components == 4 ? " RGBA" : " RGB";
    else if (desc.components > 1)
        text += fmt::format(" x {} components", desc.components);
    text += fmt::format(", spacing {} x {} x {}", shortest(s.x), shortest(s.y), shortest(s.z));
    if (!desc.unit.empty()) text += " " + desc.unit;
    return text;
}

void Volume::read_mask(const Box&, std::span<std::uint8_t> out) const {
    std::fill(out.begin(), out.end(), std::uint8_t(1));
}

DenseVolume::DenseVolume(VolumeDesc desc, Buffer voxels, Buffer mask)
    : Volume(std::move(desc)), voxels_(std::move(voxels)), mask_(std::move(mask)) {
    assert(voxels_.size() == this->desc().dense_bytes());
    assert(this->desc().has_mask == (mask_.size() > 0));
}

void DenseVolume::read(const Box& box, std::span<std::byte> out, const std::stop_token&) const {
    assert(Box::of(desc().dims).contains(box) || box.empty());
    assert(out.size() == box.voxels() * desc().voxel_bytes());
    copy_box(box, voxels_.data(), Box::of(desc().dims), out.data(), box, desc().voxel_bytes());
}

void DenseVolume::read_mask(const Box& box, std::span<std::uint8_t> out) const {
    if (mask_.size() == 0) return Volume::read_mask(box, out);
    copy_box(box, mask_.data(), Box::of(desc().dims), reinterpret_cast<std::byte*>(out.data()), box,
             1);
}

VolumePtr in_memory(VolumePtr volume, const std::stop_token& stop,
                    const std::function<void(double)>& progress) {
    const VolumeDesc& desc = volume->desc();
    if (volume->data() || desc.dense_bytes() == 0) return volume;
    Buffer voxels(desc.dense_bytes(), desc.name.empty() ? "volume" : desc.name);
    Buffer mask;
    if (desc.has_mask) mask = Buffer(desc.voxels(), "validity mask");
    const std::int64_t step = slices_per_slab(desc);
    const std::uint64_t slice = std::uint64_t(desc.dims.x) * std::uint64_t(desc.dims.y);
    for (std::int64_t z = 0; z < desc.dims.z; z += step) {
        check_stop(stop);
        Box slab{{0, 0, z}, {desc.dims.x, desc.dims.y, std::min(z + step, desc.dims.z)}};
        std::uint64_t first = slice * std::uint64_t(z);
        volume->read(slab, voxels.bytes().subspan(first * desc.voxel_bytes(),
                                                  slab.voxels() * desc.voxel_bytes()), stop);
        if (desc.has_mask)
            volume->read_mask(slab, mask.as<std::uint8_t>().subspan(first, slab.voxels()));
        if (progress) progress(double(slab.hi.z) / double(desc.dims.z));
    }
    return std::make_shared<DenseVolume>(desc, std::move(voxels), std::move(mask));
}

ValueRange value_range(const Volume& volume, const std::stop_token& stop) {
    const VolumeDesc& desc = volume.desc();
    if (desc.range) return *desc.range;
    constexpr double inf = std::numeric_limits<double>::infinity();
    ValueRange all{inf, -inf};
    std::mutex mutex;
    // One slab at a time in memory for each thread, however long the range that it was given.
    const std::int64_t step = slices_per_slab(desc), slabs = (desc.dims.z + step - 1) / step;
    parallel_for(0, slabs, 1, [&](std::int64_t first, std::int64_t last) {
        ValueRange mine{inf, -inf};
        for (std::int64_t i = first; i < last; ++i) {
            check_stop(stop);
            const Box slab{{0, 0, i * step},
                           {desc.dims.x, desc.dims.y, std::min((i + 1) * step, desc.dims.z)}};
            Buffer copy;
            const std::byte* data = volume.data();
            if (data) {
                data += std::uint64_t(desc.dims.x) * std::uint64_t(desc.dims.y) *
                        std::uint64_t(slab.lo.z) * desc.voxel_bytes();
            } else {
                copy = Buffer(slab.voxels() * desc.voxel_bytes(), "slab");
                volume.read(slab, copy.bytes(), stop);
                data = copy.data();
            }
            with_type(desc.type, [&](auto t) {
                widen_range(reinterpret_cast<const decltype(t)*>(data),
                            slab.voxels() * std::size_t(desc.components), mine);
            });
        }
        std::lock_guard lock(mutex);
        all = {std::min(all.min, mine.min), std::max(all.max, mine.max)};
    }, stop);
    return all.min > all.max ? ValueRange{} : all;
}

}  // namespace voxloom
