#include "plugins/codec-wavelet/level_store.h"

#include <cassert>

namespace voxloom::wavelet {

namespace {

// Thin levels have thin bricks.
Index3 stored_brick(const TreeDesc& tree, int level) {
    return glm::min(Index3(tree.bricks.brick), tree.bricks.levels[std::size_t(level)].dims);
}

}  // namespace

std::uint64_t LevelStore::bytes(const TreeDesc& tree, int level, int planes) {
    const Index3 brick = stored_brick(tree, level), dims = tree.bricks.levels[std::size_t(level)].dims;
    const std::uint64_t each = Box::of(brick).voxels() * sizeof(std::int32_t) * std::uint64_t(planes);
    return checked_product((dims + brick - Index3(1)) / brick, each, "a level of the tree");
}

LevelStore::LevelStore(const TreeDesc& tree, int level, int planes, bool in_memory)
    : dims_(tree.bricks.levels[std::size_t(level)].dims), brick_(stored_brick(tree, level)),
      grid_((dims_ + brick_ - Index3(1)) / brick_), planes_(planes),
      store_(bytes(tree, level, planes), in_memory, "a level of the tree") {}

std::uint64_t LevelStore::place(Index3 brick, int plane) const {
    const std::int64_t i = (brick.z * grid_.y + brick.y) * grid_.x + brick.x;
    return (std::uint64_t(i) * std::uint64_t(planes_) + std::uint64_t(plane)) * Box::of(brick_).voxels() *
           sizeof(std::int32_t);
}

// use(index of the brick, its box)
template <class Use>
void LevelStore::each_brick(const Box& box, const Use& use) const {
    const Index3 first = box.lo / brick_, last = (box.hi - Index3(1)) / brick_;
    for (std::int64_t z = first.z; z <= last.z; ++z)
        for (std::int64_t y = first.y; y <= last.y; ++y)
            for (std::int64_t x = first.x; x <= last.x; ++x) {
                const Index3 at(x, y, z), lo = at * brick_;
                use(at, Box{lo, glm::min(lo + brick_, dims_)});
            }
}

void LevelStore::write(const Box& box, const FamilyCodec::Planes& values, const Box& values_box) {
    thread_local std::vector<std::int32_t> brick;
    each_brick(box, [&](Index3 at, const Box& own) {
        const Box part = intersect(own, box);
        for (int c = 0; c < planes_; ++c) {
            const auto* from = reinterpret_cast<const std::byte*>(values[std::size_t(c)].data());
            if (std::byte* to = store_.at(place(at, c))) {
                copy_box(part, from, values_box, to, own, sizeof(std::int32_t));
                continue;
            }
            assert(part == own);
            brick.resize(own.voxels());
            copy_box(own, from, values_box, reinterpret_cast<std::byte*>(brick.data()), own, sizeof(std::int32_t));
            store_.write(place(at, c), std::as_bytes(std::span(brick)));
        }
    });
}

void LevelStore::read(const Box& box, int plane, std::int32_t* out) const {
    thread_local std::vector<std::int32_t> brick;
    each_brick(box, [&](Index3 at, const Box& own) {
        const std::byte* from = store_.at(place(at, plane));
        if (!from) {
            brick.resize(own.voxels());
            store_.read(place(at, plane), std::as_writable_bytes(std::span(brick)));
            from = reinterpret_cast<const std::byte*>(brick.data());
        }
        copy_box(intersect(own, box), from, own, reinterpret_cast<std::byte*>(out), box, sizeof(std::int32_t));
    });
}

FamilyCodec::Planes LevelStore::read(const Box& box) const {
    FamilyCodec::Planes planes(std::size_t(planes_), std::vector<std::int32_t>(box.voxels()));
    for (int c = 0; c < planes_; ++c) read(box, c, planes[std::size_t(c)].data());
    return planes;
}

}  // namespace voxloom::wavelet
