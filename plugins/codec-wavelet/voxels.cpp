#include "plugins/codec-wavelet/voxels.h"

#include <algorithm>
#include <cmath>

#include "core/base/parallel.h"
#include "core/data/convert.h"

namespace voxloom::wavelet {

VoxelTile::VoxelTile(const Volume& volume, const Box& box, const std::stop_token& stop) {
    const std::size_t each = volume.desc().voxel_bytes();
    const bool masked = volume.desc().has_mask;
    if (volume.data() && !masked) {
        view_ = {Box::of(volume.desc().dims), volume.data(), each};
        return;
    }
    voxels_ = Buffer(box.voxels() * each, "voxels to encode");
    if (masked) mask_ = Buffer(box.voxels(), "mask of the voxels");
    view_ = {box, voxels_.data(), each, masked ? mask_.as<std::uint8_t>().data() : nullptr};
    const Index3 n = box.dims();
    const std::uint64_t slice = std::uint64_t(n.x) * std::uint64_t(n.y);
    parallel_for(box.lo.z, box.hi.z, std::max<std::int64_t>(1, n.z / 8), [&](std::int64_t lo, std::int64_t hi) {
        const Box part{{box.lo.x, box.lo.y, lo}, {box.hi.x, box.hi.y, hi}};
        const std::uint64_t first = slice * std::uint64_t(lo - box.lo.z);
        volume.read(part, voxels_.bytes().subspan(first * each, part.voxels() * each), stop);
        if (masked) volume.read_mask(part, mask_.as<std::uint8_t>().subspan(first, part.voxels()));
    }, stop);
}

Mask mask_of(const VoxelView& voxels, const Box& box) {
    Mask mask(box.voxels(), 1);
    if (voxels.mask)
        copy_box(box, reinterpret_cast<const std::byte*>(voxels.mask), voxels.box, reinterpret_cast<std::byte*>(mask.data()), box, 1);
    return mask;
}

namespace {

// Small integers, shifted: no way through floating point.
template <class T>
void shifted_row(const T* from, std::size_t count, std::size_t components, int shift, std::int32_t* to) {
    if (components == 1)  // apart, for the compiler's sake
        for (std::size_t i = 0; i < count; ++i) to[i] = std::int32_t(from[i]) * (1 << shift);
    else
        for (std::size_t i = 0; i < count; ++i) to[i] = std::int32_t(from[i * components]) * (1 << shift);
}

template <class Row>
void each_row(const Box& box, const Row& row) {
    std::size_t at = 0;
    for (std::int64_t z = box.lo.z; z < box.hi.z; ++z)
        for (std::int64_t y = box.lo.y; y < box.hi.y; ++y, at += std::size_t(box.hi.x - box.lo.x)) row(y, z, at);
}

// Along the line of `count` items of `size` numbers each, `stride` apart: unknown items get a known one's
// numbers, in between two the nearer one's. True when something is known.
bool fill_line(std::int32_t* values, std::uint8_t* known, std::int64_t count, std::size_t size, const std::vector<std::uint8_t>& has) {
    const auto first = std::find(has.begin(), has.end(), 1);
    if (first == has.end()) return false;
    std::int64_t last = first - has.begin();
    for (std::int64_t i = 0; i < count; ++i) {
        if (has[std::size_t(i)]) {
            last = i;
            continue;
        }
        std::int64_t from = last;
        if (i > last) {  // the gap's other end, if it has one
            std::int64_t next = i;
            while (next < count && !has[std::size_t(next)]) ++next;
            if (next < count && next - i < i - last) from = next;
        }
        std::copy_n(values + std::size_t(from) * size, size, values + std::size_t(i) * size);
        std::fill_n(known + std::size_t(i) * size, size, std::uint8_t(1));
    }
    return true;
}

// Gives numbers without a value (known[i] == 0) one from the nearest along x, y, z, or `otherwise` where nothing
// is known at all.
void fill_unknown(std::vector<std::int32_t>& plane, std::vector<std::uint8_t>& known, Index3 dims, std::int32_t otherwise) {
    if (std::find(known.begin(), known.end(), 0) == known.end()) return;
    const auto x = std::size_t(dims.x), slice = x * std::size_t(dims.y);
    std::vector<std::uint8_t> rows(static_cast<std::size_t>(dims.y)), slices(static_cast<std::size_t>(dims.z)), row(x);
    for (std::size_t z = 0; z < slices.size(); ++z) {
        for (std::size_t y = 0; y < rows.size(); ++y) {
            const std::size_t at = z * slice + y * x;
            row.assign(known.begin() + std::ptrdiff_t(at), known.begin() + std::ptrdiff_t(at + x));
            rows[y] = fill_line(&plane[at], &known[at], dims.x, 1, row);
        }
        slices[z] = fill_line(&plane[z * slice], &known[z * slice], dims.y, x, rows);
    }
    if (!fill_line(plane.data(), known.data(), dims.z, slice, slices)) std::fill(plane.begin(), plane.end(), otherwise);
}

// The inside of a family's box, and each shared face, edge and corner.
void fill_parts(const Shape& shape, std::vector<std::int32_t>& plane, std::vector<std::uint8_t>& known, std::int32_t otherwise) {
    if (std::find(known.begin(), known.end(), 0) == known.end()) return;
    std::array<std::vector<int>, 3> at;
    for (int a = 0; a < 3; ++a) at[std::size_t(a)] = cuts(shape.dims[a], shape.shared.lo[a], shape.shared.hi[a], shape.dims[a]);
    const Box box = Box::of(shape.dims);
    for (std::size_t k = 0; k + 1 < at[2].size(); ++k)
        for (std::size_t j = 0; j + 1 < at[1].size(); ++j)
            for (std::size_t i = 0; i + 1 < at[0].size(); ++i) {
                const Box part{{at[0][i], at[1][j], at[2][k]}, {at[0][i + 1], at[1][j + 1], at[2][k + 1]}};
                std::vector<std::int32_t> values(part.voxels());
                std::vector<std::uint8_t> is_known(part.voxels());
                const auto bytes = [](auto& v) { return reinterpret_cast<std::byte*>(v.data()); };
                copy_box(part, bytes(plane), box, bytes(values), part, sizeof(std::int32_t));
                copy_box(part, bytes(known), box, bytes(is_known), part, 1);
                fill_unknown(values, is_known, part.dims(), otherwise);
                copy_box(part, bytes(values), part, bytes(plane), box, sizeof(std::int32_t));
            }
}

}  // namespace

void integers_of(const TreeDesc& tree, const VoxelView& voxels, FamilyId family, FamilyCodec::Planes& planes) {
    const VolumeDesc& volume = tree.bricks.volume;
    const Box box = box_of(tree, family);
    const auto components = std::size_t(volume.components), row = std::size_t(box.dims().x);
    planes.resize(components);
    for (auto& plane : planes) plane.resize(box.voxels());
    const int shift = tree.map.shift();
    if (!is_float(volume.type) && bytes_of(volume.type) <= 2 && shift >= 0 && !voxels.mask) {
        with_type(volume.type, [&](auto t) {
            each_row(box, [&](std::int64_t y, std::int64_t z, std::size_t at) {
                const auto* from = reinterpret_cast<const decltype(t)*>(voxels.row(box.lo.x, y, z));
                for (std::size_t c = 0; c < components; ++c) shifted_row(from + c, row, components, shift, planes[c].data() + at);
            });
        });
        return;
    }
    std::vector<double> values(row * components);
    std::vector<std::vector<std::uint8_t>> known(components, std::vector<std::uint8_t>(box.voxels()));
    each_row(box, [&](std::int64_t y, std::int64_t z, std::size_t at) {
        to_double(volume.type, voxels.row(box.lo.x, y, z), values.size(), values.data());
        const std::uint8_t* valid = voxels.mask_row(box.lo.x, y, z);
        for (std::size_t c = 0; c < components; ++c)
            for (std::size_t i = 0; i < row; ++i) {
                const double v = values[i * components + c];
                known[c][at + i] = std::isfinite(v) && (!valid || valid[i]);
                planes[c][at + i] = known[c][at + i] ? tree.map.tree(v) : 0;
            }
    });
    const double middle = volume.range ? volume.range->min / 2 + volume.range->max / 2 : 0;
    for (std::size_t c = 0; c < components; ++c) fill_parts(shape_of(tree, family), planes[c], known[c], tree.map.tree(middle));
}

}  // namespace voxloom::wavelet
